//! What the bake does when it has nothing else to do: shows what would be written, writes it, compares it.

use std::path::Path;

use super::{Note, Request, Session, ViewError};
use crate::bake::output;
use crate::lightmap::Lightmap;
use crate::scene::edit::Command;

impl Session<'_> {
    /// Writes what is asked for; the bake when it has converged.
    pub(super) fn save(&mut self, what: Request) {
        match what {
            Request::SaveBake(folder) => {
                self.save = Some(folder);
                if !self.baker.is_converged() {
                    self.tell(Note::said("the bake is saved as soon as it has converged"));
                }
            }
            Request::SaveHistory(path) => {
                let lines: Result<Vec<String>, _> = self.log.iter().map(Command::to_line).collect();
                let written = lines
                    .map_err(std::io::Error::from)
                    .and_then(|lines| std::fs::write(&path, lines.join("\n") + "\n"));
                self.tell_saved(&path, written.map_err(|e| e.to_string()));
            }
            Request::SaveScene(path) => {
                let written = self.baker.document().write(&path);
                self.tell_saved(&path, written.map_err(|e| e.to_string()));
            }
            _ => {}
        }
    }

    /// Nothing to do: what is shown becomes what would be written, and what waited for that is done.
    pub(super) fn rest(&mut self) -> Result<(), ViewError> {
        if self.baker.is_converged() {
            let stale = std::mem::take(&mut self.stale);
            if stale && self.overlays.follow_updates() {
                self.sketch()?;
            }
            if stale || self.save.is_some() || self.compare.is_some() {
                let map = self.baker.lightmap()?;
                self.pages.show(&self.baker, &map)?;
                if let Some(other) = self.compare.take() {
                    self.tell(compared(&other, &map));
                }
                if let Some(folder) = self.save.take() {
                    let report = self.baker.report();
                    let written = output::write(&folder, &self.baker, &map, &report, Vec::new());
                    self.tell_saved(&folder, written.map(drop).map_err(|e| e.to_string()));
                }
                let report = self.baker.report();
                self.status.texels = report.counts.texels;
                self.status.lights = report.counts.virtual_lights.values().sum();
            }
        } else if self.stale {
            self.refresh()?;
        }
        self.status.rate = 0.0;
        self.publish();
        Ok(())
    }

    fn tell_saved(&self, path: &Path, written: Result<(), String>) {
        self.tell(match written {
            Ok(()) => Note::said(format!("saved {}", path.display())),
            Err(error) => Note::failed(format!("not saved: {error}")),
        });
    }
}

/// What a comparison of two maps comes to.
fn compared(a: &Lightmap, b: &Lightmap) -> Note {
    let bits = |map: &Lightmap| -> Vec<[u32; 3]> {
        let texels = map.pages.iter().flatten();
        texels.map(|t| t.map(f32::to_bits)).collect()
    };
    let (a, b) = (bits(a), bits(b));
    let differ = a.iter().zip(&b).filter(|(a, b)| a != b).count() + a.len().abs_diff(b.len());
    if differ == 0 {
        Note::said("baked again from nothing: the same map, bit for bit")
    } else {
        Note::failed(format!(
            "baked again from nothing: {differ} of {} texels differ",
            b.len()
        ))
    }
}

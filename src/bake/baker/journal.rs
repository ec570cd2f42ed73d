//! What was done to the map, update by update: enough to take it all back again, since every update can be undone exactly.

use std::time::Instant;

use crate::bake::device::records::Parts;
use crate::bake::order::schedule::{Held, Kind};
use crate::cluster::CellId;

/// One update.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Which process asked for it.
    pub kind: Kind,
    /// Seconds after the journal was begun at which its lights were in the map.
    pub seconds: f64,
    /// Lumens that the plan still counted as wrong afterwards.
    pub invalid_flux: f64,
    /// The parts of the map that it was done in.
    pub(in crate::bake) parts: Parts,
    /// Cells that left, with what they held.
    pub(in crate::bake) subtracted: Vec<Held>,
    /// Cells that came, the same ones where they only followed the scene.
    pub(in crate::bake) added: Vec<Held>,
    /// Virtual lights taken away, added, and limited to the shadows of what changed.
    pub lights: [u64; 3],
    /// Lights that the map had taken in after it, indirect and direct ones.
    taken: [u64; 2],
}

impl Entry {
    pub(super) fn new(kind: Kind, parts: Parts) -> Self {
        Self {
            kind,
            parts,
            seconds: f64::NAN,
            invalid_flux: 0.0,
            taken: [0; 2],
            subtracted: Vec::new(),
            added: Vec::new(),
            lights: [0; 3],
        }
    }

    /// The first of its cells.
    pub fn cell(&self) -> Option<CellId> {
        let cells = self.subtracted.iter().chain(&self.added);
        cells.map(|h| h.selected.cell).min()
    }
}

/// The updates since it was begun; keeps nothing until then.
#[derive(Debug, Default)]
pub(in crate::bake) struct Journal(Option<Pages>);

#[derive(Debug)]
struct Pages {
    start: Instant,
    entries: Vec<Entry>,
    /// Entries whose lights are in the map.
    done: usize,
}

impl Journal {
    /// Begins to keep updates; those kept until now are gone.
    pub(in crate::bake) fn begin(&mut self) {
        self.0 = Some(Pages {
            start: Instant::now(),
            entries: Vec::new(),
            done: 0,
        });
    }

    pub(super) fn is_on(&self) -> bool {
        self.0.is_some()
    }

    /// `taken`: lights that the map has taken in (indirect, direct), those of the entry included.
    pub(super) fn note(&mut self, entry: Entry, invalid_flux: f64, taken: [u64; 2]) {
        if let Some(pages) = &mut self.0 {
            pages.entries.push(Entry {
                invalid_flux,
                taken,
                ..entry
            });
        }
    }

    /// So many lights are in the map by now.
    pub(super) fn reach(&mut self, done: [u64; 2]) {
        if let Some(pages) = &mut self.0 {
            let seconds = pages.start.elapsed().as_secs_f64();
            while let Some(entry) = pages.entries.get_mut(pages.done) {
                if (0..2).any(|q| entry.taken[q] > done[q]) {
                    break;
                }
                entry.seconds = seconds;
                pages.done += 1;
            }
        }
    }

    /// Updates that it keeps.
    #[cfg(test)]
    pub(in crate::bake) fn len(&self) -> usize {
        self.0.as_ref().map_or(0, |pages| pages.entries.len())
    }

    /// Ends it and hands over what it kept.
    pub(in crate::bake) fn end(&mut self) -> Vec<Entry> {
        self.0.take().map_or_else(Vec::new, |pages| pages.entries)
    }
}

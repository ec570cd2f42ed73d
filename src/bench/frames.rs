//! What a picture of the lit scene costs (IBGI table 1: "frame"): the viewer's passes, without a window.

use super::figure::{Better, Figure};
use super::table::since;
use super::{Bench, BenchError};
use crate::bake::{Baker, Silent};
use crate::gpu::{Gpu, GpuOptions};
use crate::view::script::{Line, View};
use crate::view::{Headless, HeadlessOptions};

/// Width and height, pixels: IBGI's.
const SIZE: [u32; 2] = [1280, 720];
/// Pictures a run.
const FRAMES: u32 = 4;

impl Bench<'_> {
    /// Looks at the scene from its first camera, with a map that is still empty: what a picture costs does not depend on what
    /// the map holds. On a device of its own, whose passes are the pictures' alone.
    pub(super) fn frames(&mut self) -> Result<(), BenchError> {
        let gpu = Gpu::new(&GpuOptions {
            device: Some(self.gpu.info().index.to_string()),
            validate: false,
        })?;
        let job = self.few(self.plan.job.atlas.texels);
        let (scene, document) = (self.scene.clone(), self.document.clone());
        self.tell("laying out for pictures");
        let mut baker = Baker::new(&gpu, scene, document, &job, &Silent)?;
        let folder = tempfile::tempdir()?;
        let options = HeadlessOptions {
            size: SIZE,
            frame: std::time::Duration::ZERO,
            folder: folder.path().to_owned(),
            reference: None,
            jpeg: false,
        };
        let mut headless = Headless::new(&gpu, &mut baker, options)?;
        let look = Line::View(View::Frame {
            count: FRAMES,
            updates: Some(0),
        });
        let script = [(1, look)];
        let path = folder.path();
        let runs = self.repeat("pictures", || {
            let before = gpu.timings();
            headless.play(&script, path)?;
            let passes = since(&gpu, &before);
            // Bringing the pages up to date is an update's cost, not a picture's.
            let of_picture = passes.iter().filter(|(name, _)| **name != "view pages");
            Ok(of_picture.map(|(_, ms)| ms).sum::<f64>() / f64::from(FRAMES))
        })?;
        let figure = Figure::new("frame, device", "ms", Better::Lower, runs);
        self.out.figures.push(figure);
        Ok(())
    }
}

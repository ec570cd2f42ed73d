//! What limiting updates to the shadows of an edit is worth, for `rebake bench`: the same lights brought to the edited scene
//! that way and by whole subtraction and addition, with the sums compared bit for bit.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use crate::bake::baker::Baker;
use crate::bake::device::records::Parts;
use crate::bake::job::BakeError;
use crate::bake::run::compare_sums;
use crate::bake::update::Sign;
use crate::bake::world::versions::Version;
use crate::cluster::VirtualLight;
use crate::gpu::GpuError;
use crate::scene::edit::Edit;

/// What it took to bring some lights from one version of a scene to another, milliseconds.
#[derive(Clone, Copy, Debug)]
pub struct UpdateCost {
    /// From the first light to the last in the map.
    pub wall: f64,
    /// Of all passes.
    pub device: f64,
}

/// Limited and whole updates of the lights that an edit leaves as they are.
#[derive(Clone, Debug)]
pub struct LimitCosts {
    /// Lights that stay as they are, while what they light may not.
    pub lights: u64,
    /// Of these, those whose light the edit can change anywhere.
    pub touched: u64,
    /// Where the edit can make a difference alone; there and back.
    pub limited: [UpdateCost; 2],
    /// Everywhere; back and there.
    pub whole: [UpdateCost; 2],
}

impl Baker {
    /// Edits the scene of a converged map and measures what bringing the lights to it costs whose own points did not change. The
    /// map is then as it was, of the scene before: [`Baker::undo`] every edit and step, or step to follow them.
    ///
    /// # Errors
    /// The edits', a lost device, and [`BakeError::Verify`] if limited updates leave other bits than whole ones.
    pub fn limit_costs(&mut self, edits: &[Edit], folder: &Path) -> Result<LimitCosts, BakeError> {
        for edit in edits {
            self.apply(edit, folder)?;
        }
        // Traces all paths: what should be held by now is known then.
        self.lights_left()?;
        let to = self.illumination.version();
        let wanted = self.wanted.cells();
        let stays = self
            .holdings
            .seen()
            .iter()
            .filter(|(cell, held)| wanted.get(cell).is_some_and(|w| **w == *held.selected));
        let lights: Vec<(VirtualLight, Version)> = stays
            .map(|(_, held)| (Arc::clone(&held.selected), held.version))
            .flat_map(|(s, version)| s.lights.clone().into_iter().map(move |l| (l, version)))
            .collect();
        let before = self.illumination.sums()?;
        // What the driver compiles at its first dispatch is no part of the cost.
        for (light, from) in lights.iter().take(16) {
            self.illumination
                .push_difference(Parts::ALL, light, *from, to)?;
            self.illumination
                .push_difference(Parts::ALL, light, to, *from)?;
        }
        let mut touched = 0;
        let there = self.cost("limited updates", |baker| {
            for (light, from) in &lights {
                touched += u64::from(baker.illumination.push_difference(
                    Parts::ALL,
                    light,
                    *from,
                    to,
                )?);
            }
            Ok(())
        })?;
        let limited = self.illumination.sums()?;
        let whole_back = self.cost("whole updates", |baker| {
            for (light, from) in &lights {
                baker.illumination.push(light.clone(), Sign::Subtract, to)?;
                baker.illumination.push(light.clone(), Sign::Add, *from)?;
            }
            Ok(())
        })?;
        compare_sums(&self.texels, &self.illumination.sums()?, &before)?;
        let whole_there = self.cost("whole updates", |baker| {
            for (light, from) in &lights {
                baker
                    .illumination
                    .push(light.clone(), Sign::Subtract, *from)?;
                baker.illumination.push(light.clone(), Sign::Add, to)?;
            }
            Ok(())
        })?;
        compare_sums(&self.texels, &self.illumination.sums()?, &limited)?;
        let back = self.cost("limited updates", |baker| {
            for (light, from) in &lights {
                baker
                    .illumination
                    .push_difference(Parts::ALL, light, to, *from)?;
            }
            Ok(())
        })?;
        compare_sums(&self.texels, &self.illumination.sums()?, &before)?;
        Ok(LimitCosts {
            lights: lights.len() as u64,
            touched,
            limited: [there, back],
            whole: [whole_back, whole_there],
        })
    }

    fn cost(
        &mut self,
        name: &str,
        work: impl FnOnce(&mut Self) -> Result<(), GpuError>,
    ) -> Result<UpdateCost, GpuError> {
        self.finish()?;
        let _span = tracing::debug_span!("updates", name).entered();
        let spent = |baker: &Self| baker.gpu.timings().iter().map(|t| t.ms).sum::<f64>();
        let (start, before) = (Instant::now(), spent(self));
        work(self)?;
        self.finish()?;
        Ok(UpdateCost {
            wall: start.elapsed().as_secs_f64() * 1e3,
            device: spent(self) - before,
        })
    }
}

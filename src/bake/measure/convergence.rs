//! How fast the map comes to its end: the error that is left after every update, of a replay and of a bake from nothing.

use std::collections::BTreeMap;
use std::ops::Range;
use std::time::{Duration, Instant};

use super::replay::Step;
use super::viewport;
use crate::bake::baker::Baker;
use crate::bake::baker::journal::Entry;
use crate::bake::device::records::Parts;
use crate::bake::job::BakeError;
use crate::bake::order::plan::Plan;
use crate::bake::order::schedule::{Held, What};
use crate::bake::passes::residual::Residual;
use crate::bake::run::compare_sums;
use crate::bake::update::{Illumination, Sign};
use crate::cluster::Ledger;
use crate::gpu::{Gpu, GpuError};
use crate::lightmap::Texel;
use crate::scene::Camera;

/// Root mean square differences from the final map over colour channels, lux.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Off {
    /// Over all texels.
    pub rms: f64,
    /// Over a picture's pixels: over what is seen from a camera. 0 if that sees nothing.
    pub viewport: f64,
}

/// A moment of a bake from nothing.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Moment {
    /// Since its first light was sent, without the time it took to measure.
    pub seconds: f64,
    /// Updates done.
    pub updates: u64,
    /// Root mean square difference from the finished map, as [`Step::rms`].
    pub rms: f64,
    /// As [`Step::viewport`].
    pub viewport: f64,
}

impl Moment {
    fn new(seconds: f64, updates: u64, off: Off) -> Self {
        Self {
            seconds,
            updates,
            rms: off.rms,
            viewport: off.viewport,
        }
    }
}

/// Measures how far the map is from what it was when this was made.
struct Meter {
    gpu: Gpu,
    residual: Residual,
    /// Tiles of the objects that are there.
    live: Vec<Range<usize>>,
    /// Values that count: of the whole map, and of the picture by weight.
    values: [f64; 2],
}

impl Meter {
    fn new(baker: &mut Baker, camera: Option<&Camera>) -> Result<Self, GpuError> {
        let weights = viewport::weights(
            baker.scene(),
            &baker.bvh,
            &baker.atlas,
            &baker.texels,
            camera,
        );
        let live: Vec<Range<usize>> = baker.live_tiles().collect();
        let gpu = baker.gpu().clone();
        let map = &mut baker.illumination;
        map.flush()?;
        let texels: f64 = live.iter().map(|range| range.len() as f64).sum();
        let seen: f64 = weights.iter().map(|w| f64::from(*w)).sum();
        Ok(Self {
            residual: Residual::new(&gpu, map.pass(), map.tiles(), &weights)?,
            gpu,
            live,
            values: [3.0 * texels, 3.0 * seen],
        })
    }

    /// Waits, then measures.
    fn off(&self, map: &mut Illumination) -> Result<Off, GpuError> {
        map.flush()?;
        let residuals = self.residual.measure(&self.gpu, map.pass())?;
        let tile = Texel::TILE;
        let mut sums = [0.0; 2];
        for range in &self.live {
            for tile in &residuals[range.start / tile..range.end / tile] {
                sums[0] += f64::from(tile[0]);
                sums[1] += f64::from(tile[1]);
            }
        }
        let rms = |i: usize| (sums[i] / self.values[i].max(1.0)).sqrt();
        Ok(Off {
            rms: rms(0),
            viewport: rms(1),
        })
    }
}

impl Baker {
    /// Walks back from the converged map to the first one, update by update, and says how far each was from the end; the
    /// map is as before afterwards. Returns the first map's difference, the final map's mean, and the updates.
    pub(super) fn convergence(
        &mut self,
        entries: Vec<Entry>,
        camera: Option<&Camera>,
    ) -> Result<(Off, f64, Vec<Step>), GpuError> {
        let meter = Meter::new(self, camera)?;
        let map = &mut self.illumination;
        let irradiance = map.irradiance()?;
        let sum = |e: &[f32; 3]| f64::from(e[0]) + f64::from(e[1]) + f64::from(e[2]);
        let live = meter
            .live
            .iter()
            .flat_map(|range| &irradiance[range.clone()]);
        let mean = live.map(sum).sum::<f64>() / meter.values[0].max(1.0);
        let mut steps = Vec::new();
        let mut off = Off::default();
        for entry in entries.into_iter().rev() {
            let [subtracted, added, limited] = entry.lights;
            steps.push(Step {
                seconds: entry.seconds,
                kind: entry.kind,
                cell: entry.cell().map_or_else(String::new, |c| c.to_string()),
                subtracted,
                added,
                limited,
                invalid_flux: entry.invalid_flux,
                rms: off.rms,
                viewport: off.viewport,
            });
            take_back(map, &entry)?;
            off = meter.off(map)?;
        }
        meter.residual.restore(&meter.gpu, map.pass())?;
        steps.reverse();
        Ok((off, mean, steps))
    }

    /// Bakes the converged map again from nothing, beside it, and says how far that was from its end on the way: what a
    /// rebake would do instead of updates. Then compares every bit of the two, as [`Baker::verify`] does.
    ///
    /// # Errors
    /// [`BakeError::Verify`], which names the worst texel. No memory, a lost device.
    pub fn rebake(&mut self, camera: Option<&Camera>) -> Result<Vec<Moment>, BakeError> {
        let meter = Meter::new(self, camera)?;
        let scene = self.scene().clone();
        let mut fresh = self.fresh_map(&scene)?;
        let mut brightness = std::mem::take(&mut self.brightness);
        let (nothing, valid) = (BTreeMap::new(), Ledger::new(&self.clusters));
        let all = self.exchanges(&mut brightness, Parts::ALL, &nothing, &valid);
        self.brightness = brightness;
        let mut plan = Plan::new(all, 0.0);
        let mut moments = vec![Moment::new(0.0, 0, meter.off(&mut fresh)?)];
        let (mut updates, mut next) = (0, 1);
        let (mut start, mut spent) = (Instant::now(), Duration::ZERO);
        while let Some(update) = plan.next(self.turns_at) {
            if let What::Exchange { add, .. } = &update.what {
                let cells = self.wanted.cells();
                for light in add
                    .iter()
                    .filter_map(|c| cells.get(c))
                    .flat_map(|s| &s.lights)
                {
                    fresh.push(light.clone(), Sign::Add, 0)?;
                }
            }
            updates += 1;
            if updates < next && plan.len() > 0 {
                continue;
            }
            fresh.flush()?;
            spent += start.elapsed();
            moments.push(Moment::new(
                spent.as_secs_f64(),
                updates,
                meter.off(&mut fresh)?,
            ));
            start = Instant::now();
            // 1 to 10, then a tenth more each time, 10, 30, 100 and 300 among them.
            let grown = updates + updates.div_ceil(10);
            let round = [10, 30, 100, 300].into_iter().find(|n| *n > updates);
            next = grown.min(round.unwrap_or(u64::MAX));
        }
        let expected = fresh.sums()?;
        let found = self.illumination.sums()?;
        compare_sums(&self.texels, &found, &expected)?;
        Ok(moments)
    }
}

/// The reverse of an update.
fn take_back(map: &mut Illumination, entry: &Entry) -> Result<(), GpuError> {
    let lights = |cells: &[Held]| cells.iter().flat_map(Held::lights).collect::<Vec<_>>();
    map.exchange(entry.parts, lights(&entry.added), lights(&entry.subtracted))?;
    Ok(())
}

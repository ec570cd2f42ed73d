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

/// How far the map is from the final one, over colour channels, lux.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Off {
    /// Root mean square difference over all texels.
    pub rms: f64,
    /// The same over a picture's pixels: over what is seen from a camera. 0 if that sees nothing.
    pub viewport: f64,
    /// The mean of the map itself.
    pub mean: f64,
    /// How far a texel is at most outside of what lies between its first value and its final one.
    pub beyond: f64,
}

/// A map before edits.
pub(super) struct First {
    sums: Vec<i64>,
    /// Texels by object, and whether it was there.
    objects: Vec<(Range<usize>, bool)>,
}

impl First {
    /// Waits, then keeps what the map is.
    pub(super) fn new(baker: &mut Baker) -> Result<Self, GpuError> {
        let objects = baker.object_texels().collect();
        let sums = baker.illumination.sums()?;
        Ok(Self { sums, objects })
    }

    /// As sums of the map as it is laid out by now: nothing where there is another object, or one that was not there.
    fn laid_out(&self, baker: &Baker, length: usize) -> Vec<i64> {
        let mut out = vec![0; length];
        for (now, (then, stood)) in baker.object_texels().map(|o| o.0).zip(&self.objects) {
            if *stood && now == *then {
                // Three channels a texel, tile by tile.
                let values = 3 * now.start..3 * now.end;
                out[values.clone()].copy_from_slice(&self.sums[values]);
            }
        }
        out
    }
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
    fn new(
        baker: &mut Baker,
        first: Option<&First>,
        camera: Option<&Camera>,
    ) -> Result<Self, GpuError> {
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
        let length = map.tiles() as usize * Texel::TILE * 3;
        let first = first.map(|first| first.laid_out(baker, length));
        let map = &baker.illumination;
        let texels: f64 = live.iter().map(|range| range.len() as f64).sum();
        let seen: f64 = weights.iter().map(|w| f64::from(*w)).sum();
        Ok(Self {
            residual: Residual::new(&gpu, map.pass(), map.tiles(), first.as_deref(), &weights)?,
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
        let mut sums = [0.0; 3];
        let mut beyond = 0f32;
        for range in &self.live {
            for tile in &residuals[range.start / tile..range.end / tile] {
                for (sum, value) in sums.iter_mut().zip(tile) {
                    *sum += f64::from(*value);
                }
                beyond = beyond.max(tile[3]);
            }
        }
        let rms = |i: usize| (sums[i] / self.values[i].max(1.0)).sqrt();
        Ok(Off {
            rms: rms(0),
            viewport: rms(1),
            mean: sums[2] / self.values[0].max(1.0),
            beyond: f64::from(beyond),
        })
    }
}

impl Baker {
    /// Walks back from the converged map to the first one, update by update, and says how far each was from the end; the
    /// map is as before afterwards. Returns the first map's difference, and the updates.
    pub(super) fn convergence(
        &mut self,
        entries: Vec<Entry>,
        first: &First,
        camera: Option<&Camera>,
    ) -> Result<(Off, Vec<Step>), GpuError> {
        let meter = Meter::new(self, Some(first), camera)?;
        let map = &mut self.illumination;
        let mut steps = Vec::new();
        let mut off = meter.off(map)?;
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
                mean: off.mean,
                beyond: off.beyond,
            });
            take_back(map, &entry)?;
            off = meter.off(map)?;
        }
        meter.residual.restore(&meter.gpu, map.pass())?;
        steps.reverse();
        Ok((off, steps))
    }

    /// Bakes the converged map again from nothing, beside it, and says how far that was from its end on the way: what a
    /// rebake would do instead of updates. Then compares every bit of the two, as [`Baker::verify`] does.
    ///
    /// # Errors
    /// [`BakeError::Verify`], which names the worst texel. No memory, a lost device.
    pub fn rebake(&mut self, camera: Option<&Camera>) -> Result<Vec<Moment>, BakeError> {
        let meter = Meter::new(self, None, camera)?;
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::bake::job::progress::Silent;
    use crate::bake::measure::replay::ReplayOptions;
    use crate::bake::{Baker, Job, Limit, Options, Quality};
    use crate::gpu::testing::gpu;
    use crate::lightmap::{AtlasOptions, Texel};
    use crate::scene::edit::Command;
    use crate::scene::{Scene, builtin::builtin};

    /// Of every update, the map's mean, and how far a value strays from what lies between the first and the last: as sums say
    /// that are read whenever an update was done.
    #[test]
    fn every_update_is_measured_as_its_sums_say() {
        let document = builtin("cornell").expect("built in");
        let scene = Scene::from_document(&document).expect("a scene");
        let job = Job {
            atlas: AtlasOptions {
                texels: 4096,
                ..AtlasOptions::default()
            },
            options: Options {
                quality: Some(Quality::Draft),
                ..Options::default()
            },
            ..Job::default()
        };
        let mut baker = Baker::new(gpu(), scene, document, &job, &Silent).expect("a bake");
        baker.step(Limit::Converged).expect("a bake");
        let mut frames = vec![(0, baker.illumination.sums().expect("sums"))];
        let mut lines = vec![
            r#"{"do": "material", "material": "lamp", "emissiveStrength": 2500}"#,
            r#"{"do": "copy", "node": "tall.box", "name": "another"}"#,
            r#"{"do": "transform", "node": "another", "translation": [0.4, 0.0, 0.5]}"#,
            r#"{"do": "remove", "node": "small.box"}"#,
        ];
        lines.extend([r#"{"do": "wait", "until": {"updates": 1}}"#; 900]);
        let script: Vec<_> = (1..)
            .zip(lines.iter().map(|line| Command::parse(line).expect(line)))
            .collect();
        let mut look = |baker: &mut Baker, _: f64| {
            frames.push((baker.journal().len(), baker.illumination.sums()?));
            Ok(())
        };
        let options = ReplayOptions::default();
        let replay = baker
            .play(&script, Path::new("."), &options, &Silent, &mut look)
            .expect("a script");

        let length = frames[frames.len() - 1].1.len();
        frames[0].1.resize(length, 0);
        let (first, last) = (&frames[0].1, &frames[frames.len() - 1].1);
        let unit = 1.0 / f64::from(baker.illumination.pass().scale());
        let values: Vec<usize> = baker
            .live_tiles()
            .flat_map(|texels| 3 * texels.start..3 * texels.end)
            .collect();
        assert!(values.len() < length && values.len().is_multiple_of(3 * Texel::TILE));
        let mut most = 0.0;
        assert!(frames.len() > 20);
        for (updates, frame) in &frames[1..] {
            let step = &replay.steps[updates - 1];
            let stray = |&at: &usize| {
                let (low, high) = (first[at].min(last[at]), first[at].max(last[at]));
                (frame[at] - high).max(low - frame[at]).max(0)
            };
            let stray = values.iter().map(stray).max().unwrap_or(0) as f64 * unit;
            let sum: i64 = values.iter().map(|&at| frame[at]).sum();
            let mean = sum as f64 * unit / values.len() as f64;
            assert!(
                (stray - step.beyond).abs() <= 1e-5 * stray,
                "{stray} {step:?}"
            );
            assert!((mean - step.mean).abs() <= 1e-5 * mean, "{mean} {step:?}");
            most = step.beyond.max(most);
        }
        assert!(most > 0.5 && replay.beyond == most, "{most}");
    }
}

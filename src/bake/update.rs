//! Changes the lightmap on the device: adds and subtracts virtual lights, each in the version of the scene that it is held
//! under, in batches whose size follows measured time.

use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

use super::accumulate::{AccumulatePass, Batch, Evaluation};
use super::occluders::Occluders;
use super::place::Receivers;
use super::records::{self, Region, ShadowSizes, Surroundings};
use super::shadow::ShadowPass;
use super::shared::BATCH;
use super::versions::{Version, Versions};
use crate::cluster::{Shape, VirtualLight};
use crate::gpu::{Gpu, Result, Stage, Ticket};
use crate::lightmap::texels::Texels;
use crate::scene::{Bounds, Scene};

/// Depth pixels of one batch: 256 MiB.
const DEPTH_ELEMENTS: u64 = 64 << 20;
/// No submission on a GPU should run longer: drivers kill those that run for seconds.
const SUBMISSION: Duration = Duration::from_millis(400);
/// Lights of the first submission there, before anything is known.
const FIRST_BATCH: usize = 4;
/// Submissions in flight: one runs while the next is recorded.
const IN_FLIGHT: usize = 2;

/// Whether a light's contribution is added or taken away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Its light comes.
    Add,
    /// Its light goes, bit for bit as it came.
    Subtract,
}

/// A light on its way to the device.
#[derive(Clone, Debug)]
struct Pending {
    light: VirtualLight,
    sign: Sign,
    version: Version,
    /// The version that the update compares with.
    other: Version,
}

/// The device side of a bake: occluders, receivers, passes, and the sums they work on.
pub struct Illumination {
    gpu: Gpu,
    versions: Versions,
    occluders: Occluders,
    receivers: Receivers,
    shadow: ShadowPass,
    accumulate: AccumulatePass,
    sizes: ShadowSizes,
    pending: Vec<Pending>,
    in_flight: VecDeque<(Ticket, Instant, usize)>,
    /// Lights per submission, so that it stays below [`SUBMISSION`].
    batch: usize,
    lights: u64,
    pairs: BTreeMap<&'static str, u64>,
}

impl Illumination {
    pub(super) fn new(
        gpu: &Gpu,
        scene: &Scene,
        texels: &Texels,
        sizes: ShadowSizes,
        evaluation: Evaluation,
    ) -> Result<Self> {
        let square = |size: u32| u64::from(size) * u64::from(size);
        let largest = (6 * square(sizes.direct))
            .max(square(sizes.sun))
            .max(3 * square(sizes.indirect));
        let elements = (3 * square(sizes.indirect) * u64::from(BATCH))
            .min(DEPTH_ELEMENTS)
            .max(largest);
        let objects = scene.objects.len() as u32;
        let standing: Vec<bool> = (0..objects).map(|o| stands(scene, o)).collect();
        let receivers = Receivers::new(gpu, scene, &standing, texels)?;
        Ok(Self {
            versions: Versions::new(gpu, &standing, scene.bounds())?,
            occluders: Occluders::new(gpu, scene)?,
            shadow: ShadowPass::new(gpu, elements)?,
            accumulate: AccumulatePass::new(gpu, &receivers, evaluation)?,
            gpu: gpu.clone(),
            receivers,
            sizes,
            pending: Vec::new(),
            in_flight: VecDeque::new(),
            // Nobody kills what runs on a CPU, and larger batches are faster there too.
            batch: if gpu.info().kind == "CPU" {
                BATCH as usize
            } else {
                FIRST_BATCH
            },
            lights: 0,
            pairs: BTreeMap::new(),
        })
    }

    /// The version that lights are added under.
    pub fn version(&self) -> Version {
        self.versions.current()
    }

    /// Where a version differs from the current one.
    pub(super) fn between(&self, version: Version) -> Vec<Region> {
        self.versions.between(version, self.versions.current())
    }

    /// Begins a version in which `objects` are where `scene` has them; `boxes` bound what they occupied before and what
    /// they occupy now. `texels`: of all objects, new ones at the end.
    pub fn change(
        &mut self,
        scene: &Scene,
        texels: &Texels,
        objects: &[u32],
        boxes: Vec<Bounds>,
    ) -> Result<Version> {
        self.send()?;
        let version = self.versions.begin(scene.bounds(), boxes);
        let mut cmd = self.gpu.commands()?;
        cmd.barrier(Stage::All, Stage::All);
        let known = (self.receivers.texel_tiles() * super::shared::TILE) as usize;
        if texels.list.len() > known {
            self.receivers
                .append(&self.gpu, &mut cmd, &texels.list[known..])?;
            self.accumulate
                .extend(&self.gpu, &mut cmd, &self.receivers)?;
        }
        let (mut standing, mut instances) = (Vec::new(), Vec::new());
        for &object in objects {
            self.versions.end_instance(object);
            if !stands(scene, object) {
                continue;
            }
            let instance = self.versions.begin_instance(object);
            self.receivers.add(
                &self.gpu,
                &mut cmd,
                instance,
                &scene.objects[object as usize].transform,
                texels.tiles[object as usize].clone(),
            )?;
            standing.push(object);
            instances.push(instance);
        }
        self.occluders
            .add(&self.gpu, &mut cmd, scene, &standing, &instances)?;
        self.versions.upload(&self.gpu, &mut cmd)?;
        self.in_flight.push_back((cmd.submit()?, Instant::now(), 0));
        Ok(version)
    }

    /// No light is held under a version before `oldest` any more: what stood only there makes room.
    pub fn forget(&mut self, oldest: Version) -> Result<()> {
        self.send()?;
        let gone = self.versions.forget(oldest);
        if gone.is_empty() {
            return Ok(());
        }
        self.occluders.remove(&gone);
        self.receivers.remove(&gone);
        let mut cmd = self.gpu.commands()?;
        cmd.barrier(Stage::All, Stage::All);
        self.versions.upload(&self.gpu, &mut cmd)?;
        self.in_flight.push_back((cmd.submit()?, Instant::now(), 0));
        Ok(())
    }

    /// Takes a light in, as it shines in a version of the scene; it is sent with its batch, at the latest by
    /// [`Illumination::flush`].
    pub fn push(&mut self, light: VirtualLight, sign: Sign, version: Version) -> Result<()> {
        self.enter(Pending {
            light,
            sign,
            version,
            other: version,
        })
    }

    /// Brings a light that was added under one version to another: takes it away where the change between the two can
    /// make a difference, and adds it there again. The sums become what they would be had the light been added under `to`,
    /// bit for bit. Returns how many evaluations that took.
    pub fn push_difference(
        &mut self,
        light: &VirtualLight,
        from: Version,
        to: Version,
    ) -> Result<u64> {
        if from == to || self.versions.between(from, to).is_empty() {
            return Ok(0);
        }
        // A parallel light's depth map spans the whole scene: with other bounds every pixel is another.
        let parallel = matches!(light.shape, Shape::Directional { .. });
        let whole = parallel && self.versions.bounds(from) != self.versions.bounds(to);
        for (sign, version, other) in [(Sign::Subtract, from, to), (Sign::Add, to, from)] {
            self.enter(Pending {
                light: light.clone(),
                sign,
                version,
                other: if whole { version } else { other },
            })?;
        }
        Ok(2)
    }

    fn enter(&mut self, new: Pending) -> Result<()> {
        let fits = self.pending.first().is_none_or(|first| {
            first.light.direct == new.light.direct
                && self.pending.len() < self.batch
                && self.elements(self.pending.iter().map(|p| &p.light))
                    + self.elements([&new.light])
                    <= self.shadow.elements()
        });
        if !fits {
            self.send()?;
        }
        self.pending.push(new);
        Ok(())
    }

    /// Sends what is pending and waits for everything.
    pub fn flush(&mut self) -> Result<()> {
        self.send()?;
        while !self.in_flight.is_empty() {
            self.retire()?;
        }
        Ok(())
    }

    pub(super) fn pass(&self) -> &AccumulatePass {
        &self.accumulate
    }

    /// Tiles of texels.
    pub(super) fn tiles(&self) -> u32 {
        self.receivers.texel_tiles()
    }

    /// How many pairs of a texel and a light each accumulation scope had evaluated when the sums were last read.
    pub fn pairs(&self) -> &BTreeMap<&'static str, u64> {
        &self.pairs
    }

    /// Virtual lights sent so far, subtractions included.
    pub fn lights_sent(&self) -> u64 {
        self.lights
    }

    /// Waits, then reads the irradiance of every texel slot, in lux.
    pub fn irradiance(&mut self) -> Result<Vec<[f32; 3]>> {
        let scale = f64::from(self.accumulate.scale());
        let sums = self.sums()?;
        let tile = super::shared::TILE as usize;
        Ok(sums
            .chunks_exact(3 * tile)
            .flat_map(|t| {
                (0..tile).map(move |i| {
                    [0, 1, 2].map(|channel| (t[channel * tile + i] as f64 / scale) as f32)
                })
            })
            .collect())
    }

    /// Waits, then reads the fixed-point sums: per tile 64 reds, 64 greens, 64 blues.
    pub fn sums(&mut self) -> Result<Vec<i64>> {
        self.flush()?;
        self.pairs = self.accumulate.pairs()?;
        self.accumulate.read()
    }

    fn elements<'a>(&self, lights: impl IntoIterator<Item = &'a VirtualLight>) -> u64 {
        let square = |size: u32| u64::from(size) * u64::from(size);
        lights
            .into_iter()
            .map(|light| match light.shape {
                Shape::Directional { .. } => square(self.sizes.sun),
                Shape::Point => 6 * square(self.sizes.direct),
                _ => {
                    3 * square(if light.direct {
                        self.sizes.direct
                    } else {
                        self.sizes.indirect
                    })
                }
            })
            .sum()
    }

    /// Sends what is pending, without waiting for it.
    pub fn send(&mut self) -> Result<()> {
        if self.pending.is_empty() {
            return Ok(());
        }
        while self.in_flight.len() >= IN_FLIGHT {
            self.retire()?;
        }
        let mut views = Vec::new();
        let mut offset = 0;
        let mut regions: Vec<Region> = Vec::new();
        let soft = self.pending[0].light.direct;
        let mut lights = Vec::new();
        let mut between = (0, 0, 0..0);
        for pending in &self.pending {
            let (a, b) = (
                pending.version.min(pending.other),
                pending.version.max(pending.other),
            );
            if (a, b) != (between.0, between.1) {
                let first = regions.len();
                if a != b {
                    regions.extend(self.versions.between(a, b));
                }
                between = (a, b, first..regions.len());
            }
            let around = Surroundings {
                version: pending.version,
                other: pending.other,
                regions: &regions[between.2.clone()],
                first_region: between.2.start as u32,
                bounds: self.versions.bounds(pending.version),
                soft,
                moved: self.accumulate.moved(),
            };
            let sign = if pending.sign == Sign::Add { 1 } else { -1 };
            lights.push(records::record(
                &pending.light,
                sign,
                &self.sizes,
                &around,
                &mut views,
                &mut offset,
            ));
        }
        let mut cmd = self.gpu.commands()?;
        cmd.barrier(Stage::All, Stage::All);
        let instances = self.versions.address();
        self.shadow
            .record(&self.gpu, &mut cmd, &self.occluders, instances, &views)?;
        let batch = Batch {
            lights: &lights,
            regions: &regions,
            soft,
        };
        self.accumulate.record(
            &self.gpu,
            &mut cmd,
            &self.receivers,
            &self.shadow,
            instances,
            &batch,
        )?;
        self.in_flight
            .push_back((cmd.submit()?, Instant::now(), lights.len()));
        self.lights += lights.len() as u64;
        self.pending.clear();
        Ok(())
    }

    /// Takes note of submissions that have finished; sends what is pending if the device has nothing to do.
    pub(super) fn poll(&mut self) -> Result<()> {
        while let Some((ticket, ..)) = self.in_flight.front() {
            if !ticket.is_done()? {
                return Ok(());
            }
            self.retire()?;
        }
        self.send()
    }

    /// Lights taken in, and of these the ones that are in the map.
    pub(super) fn taken_and_done(&self) -> (u64, u64) {
        let flying: usize = self.in_flight.iter().map(|f| f.2).sum();
        let taken = self.lights + self.pending.len() as u64;
        (taken, self.lights - flying as u64)
    }

    /// Waits for the oldest submission and learns from the time it took.
    fn retire(&mut self) -> Result<()> {
        let Some((ticket, sent, lights)) = self.in_flight.pop_front() else {
            return Ok(());
        };
        ticket.wait()?;
        if self.gpu.info().kind == "CPU" {
            return Ok(());
        }
        // A batch waits for the one before it: the span holds both.
        let took = sent.elapsed() / IN_FLIGHT as u32;
        if took > SUBMISSION {
            self.batch = (self.batch / 2).max(1);
        } else if took * 3 < SUBMISSION && lights >= self.batch {
            self.batch = (self.batch * 2).min(BATCH as usize);
        }
        Ok(())
    }
}

/// Whether an object is anywhere in a scene.
fn stands(scene: &Scene, object: u32) -> bool {
    (object as usize) < scene.objects.len() && !scene.is_gone(object)
}

//! Changes the lightmap on the device: adds and subtracts virtual lights, each in the version of the scene that it is held
//! under, in batches whose size follows measured time.

mod allowance;
mod exchange;
mod kept;
mod pending;
mod sending;

use std::collections::{BTreeMap, VecDeque};
use std::ops::Range;
use std::time::Instant;

use crate::bake::device::records::{Region, ShadowSizes, hemicube_bytes, parallel_bytes};
use crate::bake::device::shared::BATCH;
use crate::bake::job::report::ShadowCounts;
use crate::bake::passes::accumulate::{self, AccumulatePass, Evaluation};
use crate::bake::passes::shadow::ShadowPass;
use crate::bake::world::changes::Changed;
use crate::bake::world::occluders::Occluders;
use crate::bake::world::place::Receivers;
use crate::bake::world::versions::{Version, Versions};
use crate::gpu::{Buffer, Gpu, Result, Stage, Ticket};
use crate::lightmap::texels::Texels;
use crate::scene::Scene;
use allowance::{Allowance, Costs, Counts};
use kept::KeptMaps;
use pending::Queue;
pub use pending::Sign;

/// Depth maps of one batch, but for those that are kept.
const DEPTH_BYTES: u64 = 256 << 20;
/// Lights of the first submission there, before anything is known.
const FIRST_BATCH: usize = 4;
/// The device side of a bake: occluders, receivers, passes, and the sums they work on.
pub struct Illumination {
    gpu: Gpu,
    versions: Versions,
    occluders: Occluders,
    receivers: Receivers,
    shadow: ShadowPass,
    accumulate: AccumulatePass,
    sizes: ShadowSizes,
    kept: KeptMaps,
    /// By [`Pending::queue`].
    queues: [Queue; 2],
    in_flight: VecDeque<Flight>,
    /// Lights per submission, so that it stays below [`SUBMISSION`].
    batch: usize,
    /// The most that somebody wants.
    batch_limit: Option<u32>,
    /// What may be sent before there is more of it; none: everything, at once.
    allowance: Option<Allowance>,
    costs: Costs,
    /// Updates taken in so far.
    updates: u64,
    /// The last one of which lights were sent.
    touched: u64,
    /// Sent so far, indirect and direct ones.
    lights: [u64; 2],
    pairs: BTreeMap<&'static str, u64>,
    shadows: ShadowCounts,
}

/// A submission.
struct Flight {
    ticket: Ticket,
    sent: Instant,
    /// Indirect and direct lights.
    lights: [u64; 2],
    /// The same, by what they take.
    kinds: Counts,
}

impl Flight {
    /// One without lights.
    fn of(ticket: Ticket) -> Self {
        Self {
            ticket,
            sent: Instant::now(),
            lights: [0; 2],
            kinds: Counts::default(),
        }
    }
}

impl Illumination {
    pub(super) fn new(
        gpu: &Gpu,
        scene: &Scene,
        texels: &Texels,
        sizes: ShadowSizes,
        evaluation: Evaluation,
    ) -> Result<Self> {
        // A difference has its maps twice.
        let largest = 2
            * (2 * hemicube_bytes(sizes.direct))
                .max(parallel_bytes(sizes.sun))
                .max(hemicube_bytes(sizes.indirect));
        let depth = (hemicube_bytes(sizes.indirect) * u64::from(BATCH))
            .min(DEPTH_BYTES)
            .max(largest);
        let objects = scene.objects.len() as u32;
        let standing: Vec<bool> = (0..objects).map(|o| scene.stands(o)).collect();
        let receivers = Receivers::new(gpu, scene, &standing, texels)?;
        Ok(Self {
            versions: Versions::new(gpu, &standing, scene.bounds())?,
            occluders: Occluders::new(gpu, scene)?,
            shadow: ShadowPass::new(gpu, depth)?,
            accumulate: AccumulatePass::new(gpu, &receivers, evaluation)?,
            gpu: gpu.clone(),
            receivers,
            kept: KeptMaps::new(gpu, &sizes, 0),
            sizes,
            queues: Default::default(),
            in_flight: VecDeque::new(),
            // Nobody kills what runs on a CPU, and larger batches are faster there too.
            batch: if gpu.info().kind == "CPU" {
                BATCH as usize
            } else {
                FIRST_BATCH
            },
            batch_limit: None,
            allowance: None,
            costs: Costs::default(),
            updates: 0,
            touched: 0,
            lights: [0; 2],
            pairs: BTreeMap::new(),
            shadows: ShadowCounts::default(),
        })
    }

    /// Whether what is hidden is left out, in scenes of any size.
    #[cfg(test)]
    pub(super) fn set_occlusion(&mut self, on: bool) {
        self.shadow.set_occlusion(on);
        self.accumulate.set_occlusion(on);
    }

    /// Takes all light away at once.
    pub(super) fn clear(&mut self) -> Result<()> {
        self.flush()?;
        self.kept.clear();
        self.accumulate.clear(&self.gpu)
    }

    /// Keeps the depth maps of lights that it holds, in so many bytes at most. The map's bits do not depend on it. Before lights come.
    pub(super) fn keep_maps(&mut self, bytes: u64) {
        self.kept = KeptMaps::new(&self.gpu, &self.sizes, bytes);
    }

    pub(super) fn limit_batch(&mut self, lights: Option<u32>) {
        self.batch_limit = lights;
    }

    /// The version that lights are added under.
    pub fn version(&self) -> Version {
        self.versions.current()
    }

    /// Where a version differs from the current one.
    pub(super) fn between(&self, version: Version) -> Vec<Region> {
        let current = self.versions.current();
        self.versions.between(version, current).lookups.clone()
    }

    /// Begins a version in which what changed is where `scene` has it. `texels`: of all objects; `new`: the tiles that came.
    /// `replaced`: tiles of other objects, ascending, that hold the texels that have something else near them than before.
    pub fn change(
        &mut self,
        scene: &Scene,
        texels: &Texels,
        new: &[Range<u32>],
        replaced: &[u32],
        changed: Changed,
    ) -> Result<Version> {
        let _span = tracing::debug_span!("change of the scene").entered();
        self.send()?;
        let objects: Vec<u32> = changed.places.iter().map(|place| place.object).collect();
        let version = self.versions.begin(scene.bounds(), changed);
        let mut cmd = self.gpu.commands()?;
        cmd.barrier(Stage::All, Stage::All);
        if !new.is_empty() {
            let (gpu, receivers) = (&self.gpu, &mut self.receivers);
            receivers.bring(gpu, &mut cmd, texels, new)?;
            self.accumulate.extend(gpu, &mut cmd, receivers, new)?;
        }
        let (mut standing, mut instances) = (Vec::new(), Vec::new());
        for object in objects {
            self.versions.end_instance(object);
            if !scene.stands(object) {
                continue;
            }
            let instance = self.versions.begin_instance(object);
            self.receivers.add(
                &self.gpu,
                &mut cmd,
                instance,
                &scene.objects[object as usize].transform,
                texels,
                texels.tiles[object as usize].clone(),
            )?;
            standing.push(object);
            instances.push(instance);
        }
        let versions = &mut self.versions;
        let mut begin = |instance, all| versions.begin_part(instance, all);
        self.receivers
            .replace(&self.gpu, &mut cmd, scene, texels, replaced, &mut begin)?;
        self.occluders
            .add(&self.gpu, &mut cmd, scene, &standing, &instances)?;
        self.versions.upload(&self.gpu, &mut cmd)?;
        self.in_flight.push_back(Flight::of(cmd.submit()?));
        Ok(version)
    }

    /// No light is held under a version before `oldest` any more: what stood only there makes room.
    pub fn forget(&mut self, oldest: Version) -> Result<()> {
        self.send()?;
        let gone = self.versions.forget(oldest);
        if gone.is_empty() {
            return Ok(());
        }
        let mut cmd = self.gpu.commands()?;
        cmd.barrier(Stage::All, Stage::All);
        self.occluders
            .remove(&mut cmd, &gone, self.versions.nobody());
        self.receivers.remove(&mut cmd, &gone);
        self.versions.upload(&self.gpu, &mut cmd)?;
        self.in_flight.push_back(Flight::of(cmd.submit()?));
        Ok(())
    }

    /// From here on the tiles of texels that are `seen` are the part [`Parts::SEEN`] of the map, all others the rest. Both must hold
    /// the same lights, and none may wait.
    pub(super) fn divide(&mut self, seen: &[bool]) -> Result<()> {
        let mut cmd = self.gpu.commands()?;
        self.receivers.divide(&mut cmd, seen)?;
        self.in_flight.push_back(Flight::of(cmd.submit()?));
        Ok(())
    }

    pub(super) fn pass(&self) -> &AccumulatePass {
        &self.accumulate
    }

    /// Texels, tile by tile.
    pub(super) fn texels(&self) -> &Buffer {
        self.receivers.texels()
    }

    /// Tiles of texels.
    pub(super) fn tiles(&self) -> u32 {
        self.receivers.texel_tiles()
    }

    /// How many pairs of a texel and a light each accumulation scope had evaluated when the sums were last read.
    pub fn pairs(&self) -> &BTreeMap<&'static str, u64> {
        &self.pairs
    }

    /// What was drawn into depth maps when the sums were last read.
    pub(super) fn shadows(&self) -> ShadowCounts {
        self.shadows
    }

    /// Lookups that [`Illumination::pairs`] took at most.
    pub(super) fn taps(&self) -> BTreeMap<&'static str, u64> {
        let taps = self.pairs.iter();
        taps.map(|(&scope, &pairs)| (scope, pairs * u64::from(accumulate::taps(scope))))
            .collect()
    }

    /// Virtual lights sent so far, subtractions included; differences count once.
    pub fn lights_sent(&self) -> u64 {
        self.lights.iter().sum()
    }

    /// Waits, then reads the irradiance of every texel slot, in lux.
    pub fn irradiance(&mut self) -> Result<Vec<[f32; 3]>> {
        let scale = f64::from(self.accumulate.scale());
        let sums = self.sums()?;
        let tile = crate::bake::device::shared::TILE as usize;
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
        self.shadows = self.shadow.counts()?;
        self.accumulate.read()
    }
}

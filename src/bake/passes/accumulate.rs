//! Adds a batch of lights to the lightmap: cull tiles per form, then evaluate each form over its tiles.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use super::shadow::ShadowPass;
use crate::bake::device::list::Heads;
use crate::bake::device::pool::{grow, renew};
use crate::bake::device::records::{Light, Region};
use crate::bake::device::shaders;
use crate::bake::device::shared::{
    BATCH, FILTER_TAPS, FORM_CLIPPED, FORM_DIRECTIONAL, FORM_DISK, FORM_POLYGON, FORM_PUNCTUAL,
    FORMS, LIGHT_DIRECTIONAL, LIGHT_DISK, LIGHT_POLYGON, SEARCH_TAPS, TILE,
};
use crate::bake::world::place::Receivers;
use crate::gpu::{Address, Buffer, Commands, Gpu, Memory, Pipeline, Result, Stage};

/// A polygon further away than this many of its radii is evaluated as a disk; twice as far where a horizon may cut it.
/// Face on, that is 4 % too much there. With 6 radii the Cornell box has a median error of 0.71 %, not 0.74 %, for 14 %
/// more time.
pub(in crate::bake) const FAR: f32 = 4.0;
/// The same for direct lights, which are few and whose errors nothing averages: 0.3 % at most.
const DIRECT_FAR: f32 = 20.0;
/// Relative slack of depth comparisons.
const BIAS: f32 = 2e-3;
/// The same for direct lights, whose maps are finer.
const DIRECT_BIAS: f32 = 5e-4;
/// Slack of parallel light's depth comparisons, in units of the scene's depth.
const PARALLEL_BIAS: f32 = 2e-6;

/// Numbers that every contribution depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::bake) struct Evaluation {
    /// Fixed-point units per lux, a power of two.
    pub scale: f32,
    /// Half a texel, metres.
    pub epsilon: f32,
    /// Factor of a disk's area in its form factor's denominator (1: Wallace et al. 1989).
    pub disk_area: f32,
}

/// The accumulation passes, their buffers, and the sums themselves.
pub(in crate::bake) struct AccumulatePass {
    cull: Pipeline,
    /// Tiles that an invocation of it looks at.
    each: u32,
    /// By form and softness, made when first needed.
    pipelines: BTreeMap<(u32, bool), Pipeline>,
    heads: Heads,
    lists: Buffer,
    lights: Buffer,
    regions: Buffer,
    sums: Buffer,
    /// Pairs of a texel and a light that culling left in: by form, those of soft lights after the others.
    pairs: Buffer,
    /// Pairs in all tiles that culling looked at.
    offered: u64,
    /// Tiles that have sums.
    tiles: u32,
    /// Tiles that see nothing of a light are left out: the same bits, sooner.
    occlusion: bool,
    evaluation: Evaluation,
}

/// A batch of lights as the device gets it.
pub(in crate::bake) struct Batch<'a> {
    pub lights: &'a [Light],
    /// Where the versions differ that updates are limited to.
    pub regions: &'a [Region],
    /// Percentage-closer soft shadows.
    pub soft: bool,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct CullPush {
    tiles: Address,
    instances: Address,
    regions: Address,
    lights: Address,
    lists: Address,
    heads: Address,
    pairs: Address,
    views: Address,
    parts: Address,
    tile_count: u32,
    light_count: u32,
    epsilon: f32,
    far: f32,
    occlusion: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    receivers: Address,
    tiles: Address,
    instances: Address,
    lights: Address,
    list: Address,
    head: Address,
    views: Address,
    sums: Address,
    scale: f32,
    epsilon: f32,
    disk_area: f32,
    bias: f32,
}

impl AccumulatePass {
    /// How far receivers are moved out of an emitter's plane at most, metres: up to twice epsilon along a direction that
    /// climbs a quarter as fast (the shader's `transfer`).
    pub(in crate::bake) fn moved(&self) -> f32 {
        8.0 * self.evaluation.epsilon
    }

    /// Half a texel, metres.
    pub(in crate::bake) fn epsilon(&self) -> f32 {
        self.evaluation.epsilon
    }

    pub(in crate::bake) fn new(
        gpu: &Gpu,
        receivers: &Receivers,
        evaluation: Evaluation,
    ) -> Result<Self> {
        let tiles = u64::from(receivers.texel_tiles());
        let sums = gpu.buffer(
            "lightmap sums",
            tiles * u64::from(TILE) * 24,
            Memory::Device,
        )?;
        let each = if gpu.info().kind == "CPU" { 4 } else { 1 };
        let pairs = gpu.buffer("pairs", 2 * u64::from(FORMS) * 8, Memory::Device)?;
        let mut cmd = gpu.commands()?;
        cmd.fill(&pairs, 0, pairs.size(), 0);
        cmd.fill(&sums, 0, sums.size(), 0);
        cmd.submit()?.wait()?;
        Ok(Self {
            cull: gpu.pipeline(shaders::TILE_CULL, &[each])?,
            each,
            pipelines: BTreeMap::new(),
            heads: Heads::new(gpu, "tile lists", FORMS)?,
            lists: gpu.buffer("tile entries", tiles * 8 * u64::from(FORMS), Memory::Device)?,
            regions: gpu.buffer("regions", 16, Memory::Device)?,
            lights: gpu.buffer(
                "lights",
                u64::from(BATCH) * size_of::<Light>() as u64,
                Memory::Device,
            )?,
            sums,
            pairs,
            offered: 0,
            tiles: receivers.texel_tiles(),
            occlusion: true,
            evaluation,
        })
    }

    /// Makes room for the sums of tiles that came to `receivers`: they begin at 0.
    pub(in crate::bake) fn extend(
        &mut self,
        gpu: &Gpu,
        cmd: &mut Commands,
        receivers: &Receivers,
        new: &[Range<u32>],
    ) -> Result<()> {
        let tile = u64::from(TILE) * 24;
        let all = u64::from(receivers.texel_tiles());
        grow(gpu, cmd, &mut self.sums, all * tile)?;
        for tiles in new {
            let bytes = tiles.len() as u64 * tile;
            cmd.fill(&self.sums, u64::from(tiles.start) * tile, bytes, 0);
        }
        cmd.barrier(Stage::Transfer, Stage::All);
        self.tiles = receivers.texel_tiles();
        Ok(())
    }

    /// Whether tiles that see nothing of a light are left out.
    #[cfg(test)]
    pub(in crate::bake) fn set_occlusion(&mut self, on: bool) {
        self.occlusion = on;
    }

    /// Sets all sums to 0.
    pub(in crate::bake) fn clear(&mut self, gpu: &Gpu) -> Result<()> {
        let mut cmd = gpu.commands()?;
        cmd.barrier(Stage::All, Stage::All);
        cmd.fill(&self.sums, 0, self.sums.size(), 0);
        cmd.barrier(Stage::All, Stage::All);
        cmd.submit()?.wait()
    }

    /// Adds a batch whose depth maps `shadow` has drawn. `instances`: the table that says which tiles stand in a light's version.
    pub(in crate::bake) fn record(
        &mut self,
        gpu: &Gpu,
        cmd: &mut Commands,
        receivers: &Receivers,
        shadow: &ShadowPass,
        instances: Address,
        batch: &Batch,
    ) -> Result<()> {
        let &Batch {
            lights,
            regions,
            soft,
        } = batch;
        assert!(
            lights.len() <= BATCH as usize,
            "a batch has a bit for each of its lights"
        );
        let forms = forms_of(lights);
        for &form in &forms {
            if let Entry::Vacant(entry) = self.pipelines.entry((form, soft)) {
                let constants = [form, soft.into(), lanes(gpu)];
                entry.insert(gpu.pipeline(shaders::ACCUMULATE, &constants)?);
            }
        }
        let tile_count = receivers.count();
        self.offered += u64::from(tile_count * TILE) * lights.len() as u64;
        renew(
            gpu,
            &mut self.lists,
            u64::from(tile_count) * 8 * u64::from(FORMS),
        )?;
        renew(
            gpu,
            &mut self.regions,
            std::mem::size_of_val(regions) as u64,
        )?;
        cmd.upload(&self.lights, 0, lights)?;
        cmd.upload(&self.regions, 0, regions)?;
        self.heads.clear(cmd);
        cmd.barrier(Stage::All, Stage::Compute);
        cmd.scope("tile cull", |cmd| {
            let push = CullPush {
                tiles: receivers.tiles.address(),
                instances,
                regions: self.regions.address(),
                lights: self.lights.address(),
                lists: self.lists.address(),
                heads: self.heads.address(0),
                pairs: self
                    .pairs
                    .address_at(u64::from(soft) * u64::from(FORMS) * 8),
                views: shadow.views(),
                parts: receivers.parts.address(),
                tile_count,
                light_count: lights.len() as u32,
                epsilon: self.evaluation.epsilon,
                far: if soft { DIRECT_FAR } else { FAR },
                occlusion: u32::from(self.occlusion && !soft),
            };
            cmd.dispatch(&self.cull, &push, [tile_count.div_ceil(self.each), 1, 1]);
            self.heads.finish(cmd, &[]);
        });
        for form in forms {
            let push = Push {
                receivers: receivers.receivers.address(),
                tiles: receivers.tiles.address(),
                instances,
                lights: self.lights.address(),
                list: self
                    .lists
                    .address_at(u64::from(form) * u64::from(tile_count) * 8),
                head: self.heads.address(form),
                views: shadow.views(),
                sums: self.sums.address(),
                scale: self.evaluation.scale,
                epsilon: self.evaluation.epsilon,
                disk_area: self.evaluation.disk_area,
                bias: match (form, soft) {
                    (FORM_DIRECTIONAL, _) => PARALLEL_BIAS,
                    (_, true) => DIRECT_BIAS,
                    (_, false) => BIAS,
                },
            };
            cmd.scope(scope_name(form, soft), |cmd| {
                let pipeline = &self.pipelines[&(form, soft)];
                self.heads.dispatch(cmd, pipeline, &push, form);
            });
            // The next form may add to the same texels.
            cmd.barrier(Stage::Compute, Stage::Compute);
        }
        Ok(())
    }

    /// The sums themselves.
    pub(in crate::bake) fn sums(&self) -> &Buffer {
        &self.sums
    }

    /// The sums: per tile 64 reds, 64 greens, 64 blues.
    pub(in crate::bake) fn read(&self) -> Result<Vec<i64>> {
        self.sums.read(0..(self.tiles * TILE * 3) as usize)
    }

    /// How many pairs of a texel and a light each scope of [`crate::gpu::Gpu::timings`] has evaluated: those that culling
    /// left in, in whole tiles.
    pub(in crate::bake) fn pairs(&self) -> Result<BTreeMap<&'static str, u64>> {
        let counts = self.pairs.read::<u64>(0..2 * FORMS as usize)?;
        let mut pairs = BTreeMap::new();
        for (slot, count) in (0..).zip(counts).filter(|(_, count)| *count > 0) {
            *pairs
                .entry(scope_name(slot % FORMS, slot >= FORMS))
                .or_default() += count;
        }
        Ok(pairs)
    }

    /// Pairs of a texel and a light in the tiles that culling looked at so far.
    pub(in crate::bake) fn offered(&self) -> u64 {
        self.offered
    }

    /// Fixed-point units per lux.
    pub(in crate::bake) fn scale(&self) -> f32 {
        self.evaluation.scale
    }
}

/// Invocations of a workgroup: one a texel on a GPU; on a CPU, where every invocation reads a light's record by itself,
/// eight texels share the reading.
fn lanes(gpu: &Gpu) -> u32 {
    if gpu.info().kind == "CPU" {
        TILE / 8
    } else {
        TILE
    }
}

fn forms_of(lights: &[Light]) -> Vec<u32> {
    let any = |kinds: &[u32]| lights.iter().any(|l| kinds.contains(&l.kind));
    let mut forms = Vec::new();
    if any(&[LIGHT_POLYGON]) {
        forms.extend([FORM_CLIPPED, FORM_POLYGON]);
    }
    if any(&[LIGHT_POLYGON, LIGHT_DISK]) {
        forms.push(FORM_DISK);
    }
    if any(&[
        crate::bake::device::shared::LIGHT_POINT,
        crate::bake::device::shared::LIGHT_SPOT,
    ]) {
        forms.push(FORM_PUNCTUAL);
    }
    if any(&[LIGHT_DIRECTIONAL]) {
        forms.push(FORM_DIRECTIONAL);
    }
    forms
}

/// Lookups in depth maps that a pair of a scope takes at most.
pub(in crate::bake) fn taps(scope: &str) -> u32 {
    let soft = scope.ends_with("soft") || scope == scope_name(FORM_PUNCTUAL, true);
    if soft { SEARCH_TAPS + FILTER_TAPS } else { 1 }
}

fn scope_name(form: u32, soft: bool) -> &'static str {
    match (form, soft) {
        (FORM_CLIPPED, false) => "accumulate clipped polygons",
        (FORM_CLIPPED, true) => "accumulate clipped polygons, soft",
        (FORM_POLYGON, false) => "accumulate polygons",
        (FORM_POLYGON, true) => "accumulate polygons, soft",
        (FORM_DISK, false) => "accumulate disks",
        (FORM_DISK, true) => "accumulate disks, soft",
        (FORM_PUNCTUAL, _) => "accumulate points and spots",
        _ => "accumulate parallel light",
    }
}

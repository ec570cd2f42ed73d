//! What casts shadows: world-space triangles on the device, in chunks small and compact enough to be culled.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::coarse::{self, Corners};
use super::cutout::{Coverage, Masks};
use crate::bake::device::pool::{Pool, grow, vacate};
use crate::bake::device::records::{Chunk, Cutout, Group, Triangle};
use crate::bake::device::shared::{CHUNK, GROUP, LEVELS};
use crate::gpu::{Buffer, Commands, Gpu, Memory, Result};
use crate::scene::Scene;

/// The triangles of all instances as the shadow passes read them: those that stop all light, and those with a cutout.
pub struct Occluders {
    pub(in crate::bake) whole: Chunks,
    pub(in crate::bake) masked: Chunks,
    /// The masks' bits.
    pub(in crate::bake) bits: Buffer,
    masks: Masks,
}

/// Chunks of one kind of triangle: chunk `c` has the triangles (and cutouts) from `c * CHUNK` on.
pub(in crate::bake) struct Chunks {
    pub(in crate::bake) triangles: Buffer,
    pub(in crate::bake) cutouts: Buffer,
    pub(in crate::bake) chunks: Buffer,
    pub(in crate::bake) groups: Buffer,
    pool: Pool,
    group_pool: Pool,
    /// By instance.
    taken: BTreeMap<u32, Taken>,
    masked: bool,
}

/// What an instance takes.
struct Taken {
    chunks: Range<u32>,
    groups: Range<u32>,
    triangles: u64,
}

/// A triangle in world space, and its cutout if it has one.
type Part = ([Vec3; 3], Option<Cutout>);

impl Occluders {
    /// Uploads all triangles of all objects, object `i` as instance `i`. Those without area cast no shadow and are left
    /// out, as are those whose alpha lets all light pass.
    pub fn new(gpu: &Gpu, scene: &Scene) -> Result<Self> {
        let mut out = Self {
            whole: Chunks::new(gpu, false)?,
            masked: Chunks::new(gpu, true)?,
            bits: gpu.buffer("alpha masks", 16, Memory::Device)?,
            masks: Masks::default(),
        };
        let objects: Vec<u32> = (0..scene.objects.len() as u32).collect();
        let mut cmd = gpu.commands()?;
        out.add(gpu, &mut cmd, scene, &objects, &objects)?;
        cmd.submit()?.wait()?;
        Ok(out)
    }

    /// Adds instances of objects where they stand in `scene`.
    pub(in crate::bake) fn add(
        &mut self,
        gpu: &Gpu,
        cmd: &mut Commands,
        scene: &Scene,
        objects: &[u32],
        instances: &[u32],
    ) -> Result<()> {
        let new = self.masks.learn(scene, objects, instances);
        let masks = &self.masks;
        grow(gpu, cmd, &mut self.bits, masks.bits.len() as u64 * 4)?;
        for words in new {
            let own = words.start as usize..words.end as usize;
            cmd.upload(&self.bits, u64::from(words.start) * 4, &masks.bits[own])?;
        }
        let prepared: Vec<[Prepared; 2]> = objects
            .par_iter()
            .map(|&object| {
                let (whole, masked) = parts_of(scene, masks, object);
                [Prepared::new(whole, true), Prepared::new(masked, false)]
            })
            .collect();
        let of = |kind: usize| {
            let prepared = prepared.iter().map(move |p| &p[kind]);
            instances.iter().copied().zip(prepared).collect::<Vec<_>>()
        };
        self.whole.add(gpu, cmd, &of(0))?;
        self.masked.add(gpu, cmd, &of(1))
    }

    /// Gives back what the instances took: nothing on the device names them any more, but the instance `nobody`, which stands
    /// nowhere.
    pub(in crate::bake) fn remove(&mut self, cmd: &mut Commands, instances: &[u32], nobody: u32) {
        self.masks.forget(instances);
        for chunks in [&mut self.whole, &mut self.masked] {
            let mut free = Vec::new();
            for taken in instances.iter().filter_map(|i| chunks.taken.remove(i)) {
                chunks.pool.give(taken.chunks);
                chunks.group_pool.give(taken.groups.clone());
                free.push(taken.groups);
            }
            // Chunks are reached through their groups alone.
            vacate(cmd, &chunks.groups, size_of::<Group>(), free, nobody);
        }
    }

    /// Triangles that cast a shadow, of all instances.
    pub fn triangles(&self) -> u64 {
        let all = self.whole.taken.values().chain(self.masked.taken.values());
        all.map(|taken| taken.triangles).sum()
    }
}

impl Chunks {
    fn new(gpu: &Gpu, masked: bool) -> Result<Self> {
        let buffer = |name| gpu.buffer(name, 16, Memory::Device);
        Ok(Self {
            triangles: buffer("occluder triangles")?,
            cutouts: buffer("occluder cutouts")?,
            chunks: buffer("occluder chunks")?,
            groups: buffer("occluder groups")?,
            pool: Pool::default(),
            group_pool: Pool::default(),
            taken: BTreeMap::new(),
            masked,
        })
    }

    /// Chunks at most that there are.
    pub(in crate::bake) fn count(&self) -> u32 {
        self.pool.end()
    }

    /// Groups to go through; some may be no instance's.
    pub(in crate::bake) fn group_count(&self) -> u32 {
        self.group_pool.end()
    }

    fn add(&mut self, gpu: &Gpu, cmd: &mut Commands, all: &[(u32, &Prepared)]) -> Result<()> {
        let slots = CHUNK as usize;
        let mut placed: Vec<(Range<u32>, Range<u32>, u32, &Prepared)> = Vec::new();
        for &(instance, prepared) in all {
            let chunks = self.pool.take((prepared.slots.len() / slots) as u32);
            let groups = self.group_pool.take(prepared.groups.len() as u32);
            placed.push((chunks.clone(), groups.clone(), instance, prepared));
            let taken = Taken {
                chunks,
                groups,
                triangles: prepared.triangles,
            };
            self.taken.insert(instance, taken);
        }
        let end = u64::from(self.pool.end());
        let bytes = |of: usize| end * of as u64;
        grow(gpu, cmd, &mut self.chunks, bytes(size_of::<Chunk>()))?;
        let triangles = bytes(slots * size_of::<Triangle>());
        grow(gpu, cmd, &mut self.triangles, triangles)?;
        if self.masked {
            let cutouts = bytes(slots * size_of::<Cutout>());
            grow(gpu, cmd, &mut self.cutouts, cutouts)?;
        }
        let groups = u64::from(self.group_pool.end()) * size_of::<Group>() as u64;
        grow(gpu, cmd, &mut self.groups, groups)?;
        // Ranges that follow each other go in one copy.
        for run in placed.chunk_by(|(_, a, ..), (_, b, ..)| a.end == b.start) {
            let groups: Vec<Group> = run
                .iter()
                .flat_map(|(chunks, _, instance, prepared)| {
                    let own = |group: &Group| Group {
                        instance: *instance,
                        first: group.first.map(|f| f + chunks.start),
                        ..*group
                    };
                    prepared.groups.iter().map(own)
                })
                .collect();
            let first = u64::from(run[0].1.start);
            cmd.upload(&self.groups, first * size_of::<Group>() as u64, &groups)?;
        }
        for run in placed.chunk_by(|(a, ..), (b, ..)| a.end == b.start) {
            let first = u64::from(run[0].0.start);
            let all = || run.iter().flat_map(|(.., prepared)| &prepared.slots);
            let chunks: Vec<Chunk> = run
                .iter()
                .flat_map(|(.., prepared)| prepared.slots.chunks(slots).map(chunk))
                .collect();
            cmd.upload(&self.chunks, first * size_of::<Chunk>() as u64, &chunks)?;
            let zero = bytemuck::Zeroable::zeroed;
            let triangle = |([a, b, c], _): &Part| Triangle {
                a: a.to_array(),
                b: b.to_array(),
                c: c.to_array(),
            };
            let triangles: Vec<Triangle> = all()
                .map(|part| part.as_ref().map_or_else(zero, triangle))
                .collect();
            let at = first * (slots * size_of::<Triangle>()) as u64;
            cmd.upload(&self.triangles, at, &triangles)?;
            if self.masked {
                let cutout = |part: &Option<Part>| part.as_ref().and_then(|p| p.1);
                let cutouts: Vec<Cutout> = all()
                    .map(|part| cutout(part).unwrap_or_else(bytemuck::Zeroable::zeroed))
                    .collect();
                let at = first * (slots * size_of::<Cutout>()) as u64;
                cmd.upload(&self.cutouts, at, &cutouts)?;
            }
        }
        Ok(())
    }
}

/// The triangles of an object as the device will have them.
struct Prepared {
    /// Whole chunks, filled up with nothing: those of the triangles, then those of the levels of groups.
    slots: Vec<Option<Part>>,
    /// With chunks counted from the object's first, and no instance.
    groups: Vec<Group>,
    triangles: u64,
}

impl Prepared {
    /// `coarser`: other triangles may stand for them.
    fn new(mut parts: Vec<Part>, coarser: bool) -> Self {
        split(&mut parts);
        let size = (CHUNK * GROUP) as usize;
        let levels = if coarser {
            let corners: Vec<Corners> = parts.iter().map(|p| p.0).collect();
            coarse::levels(&corners, size, LEVELS as usize - 1)
        } else {
            Vec::new()
        };
        let fill = |slots: &mut Vec<Option<Part>>, parts: &[Part]| {
            let first = slots.len() as u32 / CHUNK;
            slots.extend(parts.iter().copied().map(Some));
            slots.resize(slots.len().next_multiple_of(CHUNK as usize), None);
            (first, slots.len() as u32 / CHUNK - first)
        };
        let mut slots = Vec::new();
        fill(&mut slots, &parts);
        let mut levels = levels.into_iter();
        let mut groups = Vec::new();
        for (own, at) in parts.chunks(size).zip((0..).step_by(GROUP as usize)) {
            let mut group: Group = bytemuck::Zeroable::zeroed();
            group.first[0] = at;
            group.count[0] = (own.len() as u32).div_ceil(CHUNK);
            let mut bounds = bounds_of(own);
            for (level, k) in levels.next().into_iter().flatten().zip(1..) {
                let mut parts: Vec<Part> = level.triangles.iter().map(|t| (*t, None)).collect();
                split(&mut parts);
                (group.first[k], group.count[k]) = fill(&mut slots, &parts);
                group.cell[k] = level.cell;
                let [low, high] = bounds_of(&parts);
                bounds = [bounds[0].min(low), bounds[1].max(high)];
            }
            (group.center, group.extent) = box_of(bounds);
            groups.push(group);
        }
        Self {
            slots,
            groups,
            triangles: parts.len() as u64,
        }
    }
}

/// The triangles of an object that stop all light, and those that stop some.
fn parts_of(scene: &Scene, masks: &Masks, object: u32) -> (Vec<Part>, Vec<Part>) {
    (0..scene.mesh(object).triangles.len() as u32)
        .map(|t| (t, scene.world_triangle(object, t)))
        .filter(|(_, [a, b, c])| (b - a).cross(c - a).length_squared() > 0.0)
        .filter_map(|(t, triangle)| match masks.coverage(scene, object, t) {
            Coverage::Whole => Some((triangle, None)),
            Coverage::Part(cutout) => Some((triangle, Some(cutout))),
            Coverage::Nothing => None,
        })
        .partition(|part| part.1.is_none())
}

fn chunk(slots: &[Option<Part>]) -> Chunk {
    let (center, extent) = box_of(bounds_of(slots.iter().flatten()));
    Chunk {
        center,
        extent,
        count: slots.iter().flatten().count() as u32,
    }
}

fn bounds_of<'a>(parts: impl IntoIterator<Item = &'a Part>) -> [Vec3; 2] {
    let start = [Vec3::INFINITY, Vec3::NEG_INFINITY];
    let vertices = parts.into_iter().flat_map(|p| p.0);
    vertices.fold(start, |[low, high], v| [low.min(v), high.max(v)])
}

/// The centre and half the size of a box.
fn box_of([low, high]: [Vec3; 2]) -> ([f32; 3], [f32; 3]) {
    let extent = 0.5 * (high - low) + 1e-6 * (low.abs() + high.abs());
    ((0.5 * (low + high)).to_array(), extent.to_array())
}

/// Orders triangles so that every run of [`CHUNK`] is compact: halves at the median of the longest extent of the
/// centroids, the left half a multiple of the chunk. In a run large ones come first: invocations that run together then
/// have about as many pixels to look at.
fn split(parts: &mut [Part]) {
    if parts.len() <= CHUNK as usize {
        let size = |(t, _): &Part| (t[1] - t[0]).cross(t[2] - t[0]).length_squared();
        parts.sort_by(|a, b| size(b).total_cmp(&size(a)));
        return;
    }
    let centroid = |part: &Part| (part.0[0] + part.0[1] + part.0[2]) / 3.0;
    let (low, high) = parts
        .iter()
        .map(centroid)
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), c| {
            (low.min(c), high.max(c))
        });
    let axis = (high - low).max_position();
    let middle = (parts.len() / 2)
        .next_multiple_of(CHUNK as usize)
        .min(parts.len() - 1);
    parts.select_nth_unstable_by(middle, |a, b| {
        centroid(a)[axis].total_cmp(&centroid(b)[axis])
    });
    let (left, right) = parts.split_at_mut(middle);
    split(left);
    split(right);
}

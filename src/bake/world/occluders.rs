//! What casts shadows: world-space triangles on the device, in chunks small and compact enough to be culled.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::cutout::{Coverage, Masks};
use crate::bake::device::pool::{Pool, grow, vacate};
use crate::bake::device::records::{Chunk, Cutout, Triangle};
use crate::bake::device::shared::CHUNK;
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
    pool: Pool,
    /// By instance: its chunks, and its triangles in them.
    taken: BTreeMap<u32, (Range<u32>, u64)>,
    masked: bool,
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
        let parts: Vec<[Vec<Part>; 2]> = objects
            .par_iter()
            .map(|&object| {
                let (mut whole, mut masked) = parts_of(scene, masks, object);
                split(&mut whole);
                split(&mut masked);
                [whole, masked]
            })
            .collect();
        let of = |kind: usize| {
            let parts = parts.iter().map(move |p| &p[kind][..]);
            instances.iter().copied().zip(parts).collect::<Vec<_>>()
        };
        self.whole.add(gpu, cmd, &of(0))?;
        self.masked.add(gpu, cmd, &of(1))
    }

    /// Gives back what the instances took: nothing on the device names them any more, but the instance `nobody`, which stands
    /// nowhere.
    pub(in crate::bake) fn remove(&mut self, cmd: &mut Commands, instances: &[u32], nobody: u32) {
        self.masks.forget(instances);
        for chunks in [&mut self.whole, &mut self.masked] {
            let taken = instances.iter().filter_map(|i| chunks.taken.remove(i));
            let free: Vec<Range<u32>> = taken.map(|(range, _)| range).collect();
            for range in &free {
                chunks.pool.give(range.clone());
            }
            vacate(cmd, &chunks.chunks, size_of::<Chunk>(), free, nobody);
        }
    }

    /// Triangles that cast a shadow, of all instances.
    pub fn triangles(&self) -> u64 {
        let all = self.whole.taken.values().chain(self.masked.taken.values());
        all.map(|(_, triangles)| triangles).sum()
    }
}

impl Chunks {
    fn new(gpu: &Gpu, masked: bool) -> Result<Self> {
        let buffer = |name| gpu.buffer(name, 16, Memory::Device);
        Ok(Self {
            triangles: buffer("occluder triangles")?,
            cutouts: buffer("occluder cutouts")?,
            chunks: buffer("occluder chunks")?,
            pool: Pool::default(),
            taken: BTreeMap::new(),
            masked,
        })
    }

    /// Chunks to go through; some may be no instance's.
    pub(in crate::bake) fn count(&self) -> u32 {
        self.pool.end()
    }

    fn add(&mut self, gpu: &Gpu, cmd: &mut Commands, parts: &[(u32, &[Part])]) -> Result<()> {
        let mut placed: Vec<(Range<u32>, u32, &[Part])> = Vec::new();
        for &(instance, parts) in parts {
            let range = self.pool.take((parts.len() as u32).div_ceil(CHUNK));
            self.taken
                .insert(instance, (range.clone(), parts.len() as u64));
            placed.push((range, instance, parts));
        }
        let (end, slots) = (u64::from(self.pool.end()), u64::from(CHUNK));
        grow(gpu, cmd, &mut self.chunks, end * size_of::<Chunk>() as u64)?;
        grow(
            gpu,
            cmd,
            &mut self.triangles,
            end * slots * size_of::<Triangle>() as u64,
        )?;
        if self.masked {
            grow(
                gpu,
                cmd,
                &mut self.cutouts,
                end * slots * size_of::<Cutout>() as u64,
            )?;
        }
        // Ranges that follow each other go in one copy.
        for run in placed.chunk_by(|(a, ..), (b, ..)| a.end == b.start) {
            let first = u64::from(run[0].0.start);
            let chunks: Vec<Chunk> = run
                .iter()
                .flat_map(|(_, instance, parts)| {
                    parts.chunks(CHUNK as usize).map(|p| chunk(p, *instance))
                })
                .collect();
            let padded = run.iter().flat_map(|(_, _, parts)| {
                let filled = parts.len().next_multiple_of(CHUNK as usize);
                parts
                    .iter()
                    .map(Some)
                    .chain(std::iter::repeat_n(None, filled - parts.len()))
            });
            let triangles: Vec<Triangle> = padded
                .clone()
                .map(|part| {
                    part.map_or(bytemuck::Zeroable::zeroed(), |([a, b, c], _)| Triangle {
                        a: a.to_array(),
                        b: b.to_array(),
                        c: c.to_array(),
                    })
                })
                .collect();
            cmd.upload(&self.chunks, first * size_of::<Chunk>() as u64, &chunks)?;
            cmd.upload(
                &self.triangles,
                first * slots * size_of::<Triangle>() as u64,
                &triangles,
            )?;
            if self.masked {
                let cutouts: Vec<Cutout> = padded
                    .map(|part| {
                        part.and_then(|p| p.1)
                            .unwrap_or(bytemuck::Zeroable::zeroed())
                    })
                    .collect();
                cmd.upload(
                    &self.cutouts,
                    first * slots * size_of::<Cutout>() as u64,
                    &cutouts,
                )?;
            }
        }
        Ok(())
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

fn chunk(parts: &[Part], instance: u32) -> Chunk {
    let vertices = parts.iter().flat_map(|p| p.0);
    let low = vertices.clone().fold(Vec3::INFINITY, Vec3::min);
    let high = vertices.fold(Vec3::NEG_INFINITY, Vec3::max);
    Chunk {
        center: (0.5 * (low + high)).to_array(),
        extent: (0.5 * (high - low) + 1e-6 * (low.abs() + high.abs())).to_array(),
        count: parts.len() as u32,
        instance,
    }
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

//! What casts shadows: world-space triangles on the device, in chunks small and compact enough to be culled.

use glam::Vec3;
use rayon::prelude::*;

use super::cutout::{Coverage, Masks};
use super::records::{Chunk, Cutout, Triangle};
use super::shared::CHUNK;
use crate::gpu::{Buffer, Gpu, Result};
use crate::scene::Scene;

/// The scene's triangles as the shadow passes read them: first those that stop all light, then those with a cutout,
/// in chunks of their own.
pub struct Occluders {
    pub(super) triangles: Buffer,
    pub(super) chunks: Buffer,
    /// One for each triangle from `first_masked_triangle` on.
    pub(super) cutouts: Buffer,
    /// The masks' bits.
    pub(super) bits: Buffer,
    pub(super) chunk_count: u32,
    /// The first chunk of triangles with a cutout.
    pub(super) first_masked_chunk: u32,
    pub(super) first_masked_triangle: u32,
    /// Triangles that cast a shadow.
    pub triangle_count: u64,
}

/// A triangle in world space, and its cutout if it has one.
type Part = ([Vec3; 3], Option<Cutout>);

impl Occluders {
    /// Uploads all triangles of all objects. Those without area cast no shadow and are left out, as are those whose
    /// alpha lets all light pass.
    pub fn new(gpu: &Gpu, scene: &Scene) -> Result<Self> {
        let masks = Masks::new(scene);
        let objects: Vec<[Vec<Part>; 2]> = (0..scene.objects.len() as u32)
            .into_par_iter()
            .map(|object| {
                let (mut whole, mut masked) = parts_of(scene, &masks, object);
                split(&mut whole);
                split(&mut masked);
                [whole, masked]
            })
            .collect();
        let mut parts: Vec<&Part> = Vec::new();
        let mut chunks = Vec::new();
        let mut first_masked = (0, 0);
        for kind in 0..2 {
            first_masked = (chunks.len() as u32, parts.len() as u32);
            for object in &objects {
                for part in object[kind].chunks(CHUNK as usize) {
                    chunks.push(chunk(part, parts.len() as u32));
                    parts.extend(part);
                }
            }
        }
        let triangles: Vec<Triangle> = parts
            .iter()
            .map(|([a, b, c], _)| Triangle {
                a: a.to_array(),
                b: b.to_array(),
                c: c.to_array(),
            })
            .collect();
        let cutouts: Vec<Cutout> = parts.iter().filter_map(|p| p.1).collect();
        Ok(Self {
            triangles: gpu.buffer_with("occluder triangles", &triangles)?,
            chunks: gpu.buffer_with("occluder chunks", &chunks)?,
            cutouts: gpu.buffer_with("occluder cutouts", &cutouts)?,
            bits: gpu.buffer_with("alpha masks", &masks.bits)?,
            chunk_count: chunks.len() as u32,
            first_masked_chunk: first_masked.0,
            first_masked_triangle: first_masked.1,
            triangle_count: triangles.len() as u64,
        })
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

fn chunk(parts: &[Part], first: u32) -> Chunk {
    let vertices = parts.iter().flat_map(|p| p.0);
    let low = vertices.clone().fold(Vec3::INFINITY, Vec3::min);
    let high = vertices.fold(Vec3::NEG_INFINITY, Vec3::max);
    Chunk {
        center: (0.5 * (low + high)).to_array(),
        extent: (0.5 * (high - low) + 1e-6 * (low.abs() + high.abs())).to_array(),
        first,
        count: parts.len() as u32,
    }
}

/// Orders triangles so that every run of [`CHUNK`] is compact: halves at the median of the longest extent of the
/// centroids, the left half a multiple of the chunk.
fn split(parts: &mut [Part]) {
    if parts.len() <= CHUNK as usize {
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

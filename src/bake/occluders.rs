//! What casts shadows: world-space triangles on the device, in chunks small and compact enough to be culled.

use glam::Vec3;
use rayon::prelude::*;

use super::records::{Chunk, Triangle};
use super::shared::CHUNK;
use crate::gpu::{Buffer, Gpu, Result};
use crate::scene::Scene;

/// The scene's triangles as the shadow passes read them.
pub struct Occluders {
    pub(super) triangles: Buffer,
    pub(super) chunks: Buffer,
    pub(super) chunk_count: u32,
    /// Triangles with an area.
    pub triangle_count: u64,
}

impl Occluders {
    /// Uploads all triangles of all objects. Those without area cast no shadow and are left out.
    pub fn new(gpu: &Gpu, scene: &Scene) -> Result<Self> {
        let objects: Vec<(Vec<Triangle>, Vec<Chunk>)> = (0..scene.objects.len())
            .into_par_iter()
            .map(|object| chunks_of(scene, object))
            .collect();
        let mut triangles = Vec::with_capacity(objects.iter().map(|o| o.0.len()).sum());
        let mut chunks = Vec::with_capacity(objects.iter().map(|o| o.1.len()).sum());
        for (own_triangles, own_chunks) in objects {
            let first = triangles.len() as u32;
            chunks.extend(own_chunks.into_iter().map(|c| Chunk {
                first: c.first + first,
                ..c
            }));
            triangles.extend(own_triangles);
        }
        Ok(Self {
            triangles: gpu.buffer_with("occluder triangles", &triangles)?,
            chunks: gpu.buffer_with("occluder chunks", &chunks)?,
            chunk_count: chunks.len() as u32,
            triangle_count: triangles.len() as u64,
        })
    }
}

fn chunks_of(scene: &Scene, object: usize) -> (Vec<Triangle>, Vec<Chunk>) {
    let count = scene.meshes[scene.objects[object].mesh as usize]
        .triangles
        .len();
    let mut triangles: Vec<[Vec3; 3]> = (0..count)
        .map(|triangle| scene.world_triangle(object as u32, triangle as u32))
        .filter(|[a, b, c]| (b - a).cross(c - a).length_squared() > 0.0)
        .collect();
    let centroid = |t: &[Vec3; 3]| (t[0] + t[1] + t[2]) / 3.0;
    split(&mut triangles, &centroid);
    let chunks = triangles
        .chunks(CHUNK as usize)
        .enumerate()
        .map(|(i, part)| {
            let vertices = part.iter().flatten();
            let low = vertices.clone().fold(Vec3::INFINITY, |low, v| low.min(*v));
            let high = vertices.fold(Vec3::NEG_INFINITY, |high, v| high.max(*v));
            Chunk {
                center: (0.5 * (low + high)).to_array(),
                extent: (0.5 * (high - low) + 1e-6 * (low.abs() + high.abs())).to_array(),
                first: i as u32 * CHUNK,
                count: part.len() as u32,
            }
        })
        .collect();
    let triangles = triangles
        .iter()
        .map(|[a, b, c]| Triangle {
            a: a.to_array(),
            b: b.to_array(),
            c: c.to_array(),
        })
        .collect();
    (triangles, chunks)
}

/// Orders triangles so that every run of [`CHUNK`] is compact: halves at the median of the longest extent of the
/// centroids, the left half a multiple of the chunk.
fn split(triangles: &mut [[Vec3; 3]], centroid: &impl Fn(&[Vec3; 3]) -> Vec3) {
    if triangles.len() <= CHUNK as usize {
        return;
    }
    let (low, high) = triangles
        .iter()
        .map(centroid)
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), c| {
            (low.min(c), high.max(c))
        });
    let axis = (high - low).max_position();
    let middle = (triangles.len() / 2)
        .next_multiple_of(CHUNK as usize)
        .min(triangles.len() - 1);
    triangles.select_nth_unstable_by(middle, |a, b| {
        centroid(a)[axis].total_cmp(&centroid(b)[axis])
    });
    let (left, right) = triangles.split_at_mut(middle);
    split(left, centroid);
    split(right, centroid);
}

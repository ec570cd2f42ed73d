//! Emissive surfaces as light sources: their triangles, and those with an emission texture in pieces.

use std::f32::consts::PI;

use glam::Vec3;

use super::bvh::weights;
use super::emission::mean;
use crate::scene::Scene;

/// Triangles of a surface light with an emission texture are cut into `TEXTURE_CUTS`² pieces of constant radiance.
const TEXTURE_CUTS: u32 = 8;

/// A part of an emissive triangle with constant radiance.
#[derive(Clone, Debug)]
pub struct Piece {
    /// Triangle of the object's mesh.
    pub triangle: u32,
    /// World space, metres, in the mesh's vertex order.
    pub corners: [Vec3; 3],
    /// Unit normal of the front.
    pub normal: Vec3,
    /// Emitted radiance in cd/m².
    pub radiance: Vec3,
    /// Emits from both sides.
    pub double_sided: bool,
}

impl Piece {
    /// m², of one side.
    pub fn area(&self) -> f32 {
        (self.corners[1] - self.corners[0])
            .cross(self.corners[2] - self.corners[0])
            .length()
            * 0.5
    }

    /// Lumens, both sides where both emit: pi L A a side.
    pub fn flux(&self) -> Vec3 {
        self.radiance * (PI * self.area() * if self.double_sided { 2.0 } else { 1.0 })
    }
}

/// The emissive triangles of an object, those with an emission texture cut into small ones.
pub(super) fn surface_pieces(scene: &Scene, object: u32) -> Vec<Piece> {
    let instance = &scene.objects[object as usize];
    let mesh = &scene.meshes[instance.mesh as usize];
    let mirror = instance.transform.matrix3.determinant().signum();
    let mut pieces = Vec::new();
    for primitive in &mesh.primitives {
        let material = &scene.materials[primitive.material as usize];
        if material.emission.max_element() <= 0.0 {
            continue;
        }
        let cuts = if material.emission_texture.is_some() {
            TEXTURE_CUTS
        } else {
            1
        };
        for t in primitive.triangles.clone() {
            let world = mesh.triangles[t as usize].map(|v| {
                instance
                    .transform
                    .transform_point3(mesh.positions[v as usize])
            });
            let [a, b, c] = world;
            let normal = (b - a).cross(c - a).normalize_or_zero() * mirror;
            for corners in cut_triangle(cuts) {
                let middle = corners
                    .iter()
                    .fold(Vec3::ZERO, |sum, &c| sum + weights(c) / 3.0);
                let piece = Piece {
                    triangle: t,
                    corners: corners.map(|[s, t]| a + (b - a) * s + (c - a) * t),
                    normal,
                    radiance: scene.emission(object, t, middle),
                    double_sided: material.double_sided,
                };
                if mean(piece.flux()) > 0.0 {
                    pieces.push(piece);
                }
            }
        }
    }
    pieces
}

/// `n`² equal triangles that fill a triangle: weights of the second and third vertex at each corner.
pub(super) fn cut_triangle(n: u32) -> impl Iterator<Item = [[f32; 2]; 3]> {
    let at = move |i: u32, j: u32| [i as f32 / n as f32, j as f32 / n as f32];
    (0..n).flat_map(move |i| {
        (0..n - i).flat_map(move |j| {
            let up = [at(i, j), at(i + 1, j), at(i, j + 1)];
            let down = [at(i + 1, j + 1), at(i, j + 1), at(i + 1, j)];
            std::iter::once(up).chain((i + j + 2 <= n).then_some(down))
        })
    })
}

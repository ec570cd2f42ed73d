//! Rays against the scene: closest hits and occlusion that do not depend on the shape of the tree.

use std::time::Duration;

use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::{Ray, RayHit};
use obvhs::{Boundable, BvhBuildParams};
use rayon::prelude::*;

use super::intersect::{intersect, offset, padded_box, reciprocal};
use crate::scene::{AlphaMode, Scene};

/// A closest hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Metres along the ray.
    pub t: f32,
    /// Index into [`Scene::objects`].
    pub object: u32,
    /// Index into the object's [`crate::scene::Mesh::triangles`].
    pub triangle: u32,
    /// Weights of the triangle's second and third vertex, in the mesh's vertex order.
    pub bary: [f32; 2],
    /// World space, from the weights (more exact than stepping along the ray).
    pub position: Vec3,
    /// Unit geometric normal of the triangle's front side, whichever side was hit.
    pub normal: Vec3,
    /// The front side was hit.
    pub front: bool,
    /// Index into [`Scene::materials`].
    pub material: u32,
}

/// World-space triangles under one compressed wide BVH (Ylitie et al. 2017, built by `obvhs`).
///
/// One flat tree over all objects traverses faster than a tree of trees. Edits need not rebuild it: [`SceneBvh::moved`]
/// masks the edited objects out and keeps them in a second, small tree, and no result tells the two apart.
#[derive(Clone)]
pub struct SceneBvh {
    trees: Vec<Tree>,
}

#[derive(Clone)]
struct Tree {
    bvh: std::sync::Arc<CwBvh>,
    triangles: std::sync::Arc<Vec<Triangle>>,
    /// Objects of the scene that are not in this tree (any more); those after the last one are not, either.
    masked: Vec<bool>,
}

/// Vertices in the mesh's order; the spare lanes would be padding, so the ids lie beside them.
#[derive(Clone, Copy)]
struct Triangle {
    vertices: [Vec3A; 3],
    object: u32,
    triangle: u32,
    material: u32,
    /// The object mirrors: its front is the other side.
    mirrored: bool,
    /// Has an alpha mask to look up.
    masked: bool,
}

struct Padded(Aabb);

impl Boundable for Padded {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

/// The traversal's node test ignores boxes closer than 1e-4 in ray parameters; slower parameters make that 1e-7 m.
const PARAMETERS_PER_METRE: f32 = 1024.0;

/// Found hits cull nodes behind this multiple of their distance, so that equally near triangles are all seen
/// in spite of the rounding of the node test.
const TIE_SLACK: f32 = 1.0 + 4e-6;

/// A second tree with more than this part of the first one's triangles costs rays more than a new tree costs once.
const OVERLAY_SHARE: usize = 4;

impl SceneBvh {
    /// Builds over all objects. Triangles without area or with non-finite vertices are left out.
    pub fn build(scene: &Scene) -> Self {
        let objects: Vec<u32> = (0..scene.objects.len() as u32).collect();
        Self {
            trees: vec![Tree::build(scene, &objects)],
        }
    }

    /// The tree after `objects` were moved, changed, added or emptied in `scene`; indices of other objects must not have
    /// changed. Costs time proportional to the triangles of all objects that moved since [`SceneBvh::build`]; once these are
    /// more than a quarter of the scene, builds anew.
    pub fn moved(&self, scene: &Scene, objects: &[u32]) -> Self {
        let mut base = self.trees[0].clone();
        base.masked.resize(scene.objects.len(), true);
        for &object in objects {
            // An undone addition is an object that the scene no longer has.
            if let Some(masked) = base.masked.get_mut(object as usize) {
                *masked = true;
            }
        }
        let overlay: Vec<u32> = (0..scene.objects.len() as u32)
            .filter(|&o| base.masked[o as usize])
            .collect();
        let moved: usize = overlay.iter().map(|&o| scene.mesh(o).triangles.len()).sum();
        if moved > base.triangles.len() / OVERLAY_SHARE {
            return Self::build(scene);
        }
        Self {
            trees: vec![base, Tree::build(scene, &overlay)],
        }
    }

    /// Number of triangles that rays can hit.
    pub fn triangles(&self) -> usize {
        self.trees
            .iter()
            .map(|t| t.triangles.iter().filter(|x| !t.hidden(x)).count())
            .sum()
    }

    /// The closest hit before `t_max` metres. `direction` has unit length. Of equally near triangles the one with the smallest
    /// (object, triangle) is hit; where a material's alpha is masked out, the ray passes.
    pub fn closest(&self, scene: &Scene, origin: Vec3, direction: Vec3, t_max: f32) -> Option<Hit> {
        let mut best = Found {
            t: t_max,
            object: u32::MAX,
            triangle: u32::MAX,
            index: 0,
            tree: 0,
            bary: [0.0; 2],
        };
        let (o, d) = (Vec3A::from(origin), Vec3A::from(direction));
        let inverse = reciprocal(d);
        for (which, tree) in self.trees.iter().enumerate() {
            let ray = traversal_ray(o, d, best.t * TIE_SLACK);
            tree.bvh
                .ray_traverse(ray, &mut RayHit::none(), |ray, slot| {
                    let index = tree.bvh.primitive_indices[slot] as usize;
                    let triangle = &tree.triangles[index];
                    let Some((t, bary)) = intersect(&triangle.vertices, o, d, inverse) else {
                        return f32::INFINITY;
                    };
                    let nearer = t < best.t
                        || (t == best.t
                            && (triangle.object, triangle.triangle) < (best.object, best.triangle));
                    if !nearer || tree.hidden(triangle) || !triangle.stops(scene, bary) {
                        return f32::INFINITY;
                    }
                    best = Found {
                        t,
                        object: triangle.object,
                        triangle: triangle.triangle,
                        index,
                        tree: which,
                        bary,
                    };
                    (t * PARAMETERS_PER_METRE * TIE_SLACK).min(ray.tmax)
                });
        }
        if best.object == u32::MAX {
            return None;
        }
        let triangle = &self.trees[best.tree].triangles[best.index];
        let [a, b, c] = triangle.vertices;
        let (e1, e2) = (b - a, c - a);
        let cross = e1.cross(e2).normalize_or_zero();
        let normal = if triangle.mirrored { -cross } else { cross };
        Some(Hit {
            t: best.t,
            object: best.object,
            triangle: best.triangle,
            bary: best.bary,
            position: (a + e1 * best.bary[0] + e2 * best.bary[1]).into(),
            normal: normal.into(),
            front: normal.dot(d) < 0.0,
            material: triangle.material,
        })
    }

    /// Whether anything blocks the ray before `t_max` metres. `direction` has unit length.
    pub fn occluded(&self, scene: &Scene, origin: Vec3, direction: Vec3, t_max: f32) -> bool {
        let (o, d) = (Vec3A::from(origin), Vec3A::from(direction));
        let inverse = reciprocal(d);
        self.trees.iter().any(|tree| {
            let ray = traversal_ray(o, d, t_max);
            !tree.bvh.ray_traverse_miss(ray, |_, slot| {
                let triangle = &tree.triangles[tree.bvh.primitive_indices[slot] as usize];
                match intersect(&triangle.vertices, o, d, inverse) {
                    Some((t, bary))
                        if t < t_max && !tree.hidden(triangle) && triangle.stops(scene, bary) =>
                    {
                        0.0
                    }
                    _ => f32::INFINITY,
                }
            })
        })
    }

    /// Whether two surface points see each other: the segment between them, shortened by their offsets, is free.
    /// The normals point to the sides that look at each other.
    pub fn visible(&self, scene: &Scene, a: Vec3, a_normal: Vec3, b: Vec3, b_normal: Vec3) -> bool {
        let (from, to) = (offset(a, a_normal), offset(b, b_normal));
        let d = to - from;
        let length = d.length();
        length < 1e-9 || !self.occluded(scene, from, d / length, length)
    }
}

struct Found {
    t: f32,
    object: u32,
    triangle: u32,
    index: usize,
    tree: usize,
    bary: [f32; 2],
}

impl Tree {
    fn build(scene: &Scene, objects: &[u32]) -> Self {
        let triangles: Vec<Triangle> = objects
            .par_iter()
            .flat_map_iter(|&o| {
                let object = &scene.objects[o as usize];
                let mesh = scene.meshes[object.mesh as usize].clone();
                let mirrored = object.transform.matrix3.determinant() < 0.0;
                let transform = object.transform;
                let runs: Vec<(u32, u32, bool)> = mesh
                    .primitives
                    .iter()
                    .map(|p| {
                        let masked = !matches!(
                            scene.materials[p.material as usize].alpha,
                            AlphaMode::Opaque
                        );
                        (p.triangles.end, p.material, masked)
                    })
                    .collect();
                (0..mesh.triangles.len() as u32).filter_map(move |t| {
                    let vertices = mesh.triangles[t as usize]
                        .map(|v| transform.transform_point3a(mesh.positions[v as usize].into()));
                    let area = (vertices[1] - vertices[0])
                        .cross(vertices[2] - vertices[0])
                        .length();
                    let &(_, material, masked) =
                        runs.get(runs.partition_point(|&(end, ..)| end <= t))?;
                    (area > 0.0 && area.is_finite()).then_some(Triangle {
                        vertices,
                        object: o,
                        triangle: t,
                        mirrored,
                        material,
                        masked,
                    })
                })
            })
            .collect();
        let boxes: Vec<Padded> = triangles
            .par_iter()
            .map(|t| Padded(padded_box(&t.vertices)))
            .collect();
        let bvh = build_cwbvh(
            &boxes,
            BvhBuildParams::fast_build(),
            &mut Duration::default(),
        );
        Self {
            bvh: bvh.into(),
            triangles: triangles.into(),
            masked: vec![false; scene.objects.len()],
        }
    }

    fn hidden(&self, triangle: &Triangle) -> bool {
        self.masked
            .get(triangle.object as usize)
            .is_none_or(|&masked| masked)
    }
}

impl Triangle {
    fn stops(&self, scene: &Scene, bary: [f32; 2]) -> bool {
        !self.masked || !scene.alpha_passes(self.object, self.triangle, weights(bary))
    }
}

/// Weights of all three vertices, from those of the second and third.
pub fn weights([b, c]: [f32; 2]) -> Vec3 {
    Vec3::new(1.0 - b - c, b, c)
}

fn traversal_ray(origin: Vec3A, direction: Vec3A, t_max: f32) -> Ray {
    // Without negative zeros: the traversal takes the sign of a direction from a comparison, but that of its inverse,
    // which has to agree, would be the zero's.
    let slow = direction / PARAMETERS_PER_METRE + Vec3A::ZERO;
    Ray {
        origin,
        direction: slow,
        inv_direction: reciprocal(slow),
        tmin: 0.0,
        tmax: t_max * PARAMETERS_PER_METRE,
    }
}

#[cfg(test)]
mod tests;

//! Rays against the scene: closest hits and occlusion that do not depend on the shape of the tree.

use std::time::Duration;

use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::{Ray, RayHit};
use obvhs::{Boundable, BvhBuildParams};
use rayon::prelude::*;

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

/// Grown by a few units in the last place, so that the rounding of the node test cannot lose a triangle.
fn padded_box(vertices: &[Vec3A; 3]) -> Aabb {
    let min = vertices[0].min(vertices[1]).min(vertices[2]);
    let max = vertices[0].max(vertices[1]).max(vertices[2]);
    let pad = min.abs().max(max.abs()).max_element() * 2e-6;
    Aabb::new(min - pad, max + pad)
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

/// One over each component; large where that would be infinite, so that no product with it is undefined.
pub(super) fn reciprocal(direction: Vec3A) -> Vec3A {
    let one = |x: f32| {
        if x.abs() < 1e-18 {
            1e18f32.copysign(x)
        } else {
            1.0 / x
        }
    };
    Vec3A::new(one(direction.x), one(direction.y), one(direction.z))
}

/// Where a line enters and leaves a box; it misses the box if that is in the wrong order.
#[inline(always)]
pub(super) fn slab(min: Vec3A, max: Vec3A, origin: Vec3A, inverse: Vec3A) -> [f32; 2] {
    let (a, b) = ((min - origin) * inverse, (max - origin) * inverse);
    [a.min(b).max_element(), a.max(b).min_element()]
}

/// Distance and weights of a ray's hit. The edge tests are those of Embree's robust mode: an edge that two triangles share gives
/// exactly opposite values, so no ray slips between them.
#[inline(always)]
fn intersect(
    vertices: &[Vec3A; 3],
    origin: Vec3A,
    direction: Vec3A,
    inverse: Vec3A,
) -> Option<(f32, [f32; 2])> {
    let v0 = vertices[0] - origin;
    let v1 = vertices[1] - origin;
    let v2 = vertices[2] - origin;
    let (e0, e1, e2) = (v2 - v0, v0 - v1, v1 - v2);
    let u = (v2 + v0).cross(e0).dot(direction);
    let v = (v0 + v1).cross(e1).dot(direction);
    let w = (v1 + v2).cross(e2).dot(direction);
    let sum = u + v + w;
    let slack = f32::EPSILON * sum.abs();
    let inside = u.min(v).min(w) >= -slack || u.max(v).max(w) <= slack;
    if !inside || sum == 0.0 {
        return None;
    }
    let normal = e0.cross(e1);
    let along = normal.dot(direction);
    // In the triangle's plane the quotient means nothing: what is hit lies in the triangle's box.
    let bounds = padded_box(vertices);
    let [enter, leave] = slab(bounds.min, bounds.max, origin, inverse);
    let quotient = v0.dot(normal) / along;
    let t = quotient.min(leave).max(enter);
    if !quotient.is_finite() || t <= 0.0 {
        return None;
    }
    let scale = 1.0 / sum;
    // u belongs to the edge from v2 to v0, opposite v1; v to the edge from v0 to v1, opposite v2.
    Some((
        t,
        [(u * scale).clamp(0.0, 1.0), (v * scale).clamp(0.0, 1.0)],
    ))
}

/// A point moved off its surface along `normal`, by a few hundred units in the last place of each coordinate
/// (Wächter and Binder 2019, "A fast and robust method for avoiding self-intersection").
pub fn offset(position: Vec3, normal: Vec3) -> Vec3 {
    const ORIGIN: f32 = 1.0 / 32.0;
    const FLOAT_SCALE: f32 = 1.0 / 65536.0;
    const INT_SCALE: f32 = 256.0;
    let one = |p: f32, n: f32| {
        if p.abs() < ORIGIN {
            return p + FLOAT_SCALE * n;
        }
        let step = (INT_SCALE * n) as i32;
        f32::from_bits((p.to_bits() as i32 + if p < 0.0 { -step } else { step }) as u32)
    };
    Vec3::new(
        one(position.x, normal.x),
        one(position.y, normal.y),
        one(position.z, normal.z),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Mesh;
    use crate::transport::sampling::{Sequence, sphere};
    use crate::transport::testing::{add_quads, box_quads, cornell, material, quad, room};
    use glam::Affine3A;

    /// Every triangle of every object, the slow way.
    fn brute_force(scene: &Scene, origin: Vec3, direction: Vec3) -> Option<(u32, u32, f32)> {
        let mut best: Option<(u32, u32, f32)> = None;
        for (o, object) in scene.objects.iter().enumerate() {
            let mesh = &scene.meshes[object.mesh as usize];
            for (t, triangle) in mesh.triangles.iter().enumerate() {
                let vertices = triangle.map(|v| {
                    object
                        .transform
                        .transform_point3a(mesh.positions[v as usize].into())
                });
                if let Some((d, _)) = intersect(
                    &vertices,
                    origin.into(),
                    direction.into(),
                    reciprocal(direction.into()),
                ) && best.is_none_or(|b| d < b.2)
                {
                    best = Some((o as u32, t as u32, d));
                }
            }
        }
        best
    }

    fn rays(count: u32) -> impl Iterator<Item = (Vec3, Vec3)> {
        let sequence = Sequence::new(7, 0);
        (0..count).map(move |i| {
            let [a, b, c, d] = sequence.sample(i, 0);
            (
                Vec3::new(a, b, c) * 1.8 - 0.9,
                sphere([d, sequence.sample(i, 1)[0]]),
            )
        })
    }

    /// Two copies of a mirrored, scaled crate in one place: every hit on them is a tie.
    fn with_ties() -> Scene {
        let mut scene = cornell();
        for _ in 0..2 {
            let crate_ = box_quads(Vec3::splat(-0.2), Vec3::splat(0.2), false);
            let object = add_quads(&mut scene, &crate_, material(Vec3::ONE, Vec3::ZERO, false));
            scene.objects[object as usize].transform =
                Affine3A::from_scale(Vec3::new(-1.0, 1.5, 1.0)) * Affine3A::from_rotation_y(0.3);
        }
        scene
    }

    #[test]
    fn closest_hits_equal_brute_force_and_break_ties_by_index() {
        let scene = with_ties();
        let bvh = SceneBvh::build(&scene);
        let mut ties = 0;
        for (o, d) in rays(4000) {
            let expected = brute_force(&scene, o, d);
            let hit = bvh.closest(&scene, o, d, f32::INFINITY);
            assert_eq!(hit.map(|h| (h.object, h.triangle, h.t)), expected);
            assert_eq!(bvh.occluded(&scene, o, d, 100.0), hit.is_some());
            if let Some(h) = hit {
                assert!((o + d * h.t - h.position).length() < 1e-5);
                assert!(!bvh.occluded(&scene, o, d, h.t * 0.999));
                assert_ne!(h.object, 7, "the tie went to the later object");
                ties += u32::from(h.object == 6);
                // From outside, a crate shows its front, mirrored or not.
                assert!(h.object != 6 || h.front || o.length() < 0.5);
            }
        }
        assert!(ties > 50);
    }

    #[test]
    fn rays_along_an_axis_hit_whatever_the_sign_of_their_zeros() {
        let scene = cornell();
        let bvh = SceneBvh::build(&scene);
        let zeros = [0.0f32, -0.0];
        for i in 0..6 {
            for (a, b) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let mut d = [zeros[a], zeros[b], 0.0];
                d[2] = if i % 2 == 0 { 1.0 } else { -1.0 };
                d.rotate_right(i / 2);
                let (o, d) = (Vec3::new(0.03, -0.41, 0.17), Vec3::from(d));
                let hit = bvh.closest(&scene, o, d, f32::INFINITY);
                assert_eq!(
                    hit.map(|h| (h.object, h.triangle, h.t)),
                    brute_force(&scene, o, d),
                    "{d:?}"
                );
                assert_eq!(bvh.occluded(&scene, o, d, f32::INFINITY), hit.is_some());
            }
        }
    }

    #[test]
    fn moving_objects_leaves_no_trace_of_the_tree() {
        let mut scene = with_ties();
        let crumbs = (0..20).flat_map(|i| {
            let at = Vec3::new(0.09 * i as f32 - 0.9, 0.8, -0.5);
            box_quads(at, at + 0.05, false)
        });
        let crumbs: Vec<_> = crumbs.collect();
        add_quads(&mut scene, &crumbs, material(Vec3::ONE, Vec3::ZERO, false));
        let before = SceneBvh::build(&scene);
        scene.objects[4].transform = Affine3A::from_translation(Vec3::new(0.3, 0.2, 0.5));
        scene.objects[6].transform = Affine3A::from_rotation_x(1.0);
        let moved = before.moved(&scene, &[4]).moved(&scene, &[6]);
        assert_eq!(moved.trees.len(), 2);
        equal(&scene, &moved);
        // One more, as large as the third, and one gone; then the first edits undone.
        let copy = scene.objects[6].clone();
        scene.objects.push(copy);
        scene.meshes.push(Mesh::default().into());
        scene.objects[7].mesh = scene.meshes.len() as u32 - 1;
        let chained = moved.moved(&scene, &[7]);
        assert_eq!(chained.trees.len(), 2);
        equal(&scene, &chained);
        assert_eq!(chained.moved(&scene, &[8]).trees.len(), 1);
        scene.objects.pop();
        equal(&scene, &chained.moved(&scene, &[4, 6]));
        equal(&scene, &before.moved(&scene, &[4, 6, 7]));
    }

    /// No ray tells the tree from a new one.
    fn equal(scene: &Scene, bvh: &SceneBvh) {
        let built = SceneBvh::build(scene);
        assert_eq!(bvh.triangles(), built.triangles());
        for (o, d) in rays(3000) {
            assert_eq!(
                bvh.closest(scene, o, d, 9.0),
                built.closest(scene, o, d, 9.0)
            );
            assert_eq!(
                bvh.occluded(scene, o, d, 0.7),
                built.occluded(scene, o, d, 0.7)
            );
        }
    }

    #[test]
    fn nothing_leaks_through_edges_and_corners() {
        let scene = room(0.5);
        let bvh = SceneBvh::build(&scene);
        for (o, d) in rays(20_000) {
            // Aim at the edges: rays whose target has one coordinate on an edge of the room, and at the diagonals.
            let target = (o + d).signum() * Vec3::new(1.0, 1.0, d.z.abs());
            for aim in [target, Vec3::new(d.x, d.x, 1.0)] {
                let aim = (aim - o).normalize();
                let hit = bvh
                    .closest(&scene, o, aim, f32::INFINITY)
                    .expect("the room is closed");
                let start = offset(hit.position, hit.normal);
                assert!(bvh.closest(&scene, start, -aim, f32::INFINITY).is_some());
                assert!(
                    !bvh.occluded(&scene, start, hit.normal, 1e-4)
                        || hit.position.abs().min_element() > 0.999
                );
            }
        }
    }

    #[test]
    fn hits_nearer_than_a_tenth_of_a_millimetre_count() {
        let mut scene = Scene::default();
        add_quads(
            &mut scene,
            &[quad(Vec3::ZERO, Vec3::X, Vec3::Y)],
            material(Vec3::ONE, Vec3::ZERO, false),
        );
        let bvh = SceneBvh::build(&scene);
        let hit = bvh
            .closest(&scene, Vec3::new(0.3, 0.4, 1e-5), Vec3::NEG_Z, 1.0)
            .expect("a hit");
        assert!((hit.t - 1e-5).abs() < 1e-9 && hit.front);
        assert!(
            bvh.closest(&scene, Vec3::new(0.3, 0.4, 1e-5), Vec3::Z, 1.0)
                .is_none()
        );
        assert!(
            SceneBvh::build(&Scene::default())
                .closest(&scene, Vec3::ZERO, Vec3::X, 1.0)
                .is_none()
        );
    }
}

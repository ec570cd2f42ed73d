//! What an edit touched, as rays see it: objects that they hit, and boxes where something new may stand in their way.

use glam::{Vec3, Vec3A};

use super::Scatter;
use super::intersect::{reciprocal, slab};
use crate::scene::Scene;

/// Fewer triangles than this are not worth a box of their own.
const SPLIT: usize = 16;
/// Boxes an object, at most, as a power of two.
const DEPTH: u32 = 4;

/// Objects that changed, and where they are now.
pub struct Touched {
    /// By object: it moved, came, went, or reflects otherwise.
    objects: Vec<bool>,
    any: bool,
    /// Around everything that can block rays where it did not before.
    all: Bound,
    /// Per object: its box, and those of its parts.
    occluders: Vec<(Bound, Vec<Bound>)>,
}

#[derive(Clone, Copy)]
struct Bound {
    min: Vec3A,
    max: Vec3A,
}

/// A ray, ready for the test of boxes.
struct Segment {
    origin: Vec3A,
    inverse: Vec3A,
    length: f32,
    /// Boxes are widened by this: more than what rays and their hits are off by rounding.
    slack: f32,
}

impl Touched {
    /// `occluders` may stand elsewhere than before or stop light elsewhere, `surfaces` only reflect it otherwise.
    pub fn new(scene: &Scene, occluders: &[u32], surfaces: &[u32]) -> Self {
        let mut objects = vec![false; scene.objects.len()];
        for &object in occluders.iter().chain(surfaces) {
            // One that the scene no longer has keeps its rays' links.
            objects.resize(objects.len().max(object as usize + 1), false);
            objects[object as usize] = true;
        }
        let occluders: Vec<(Bound, Vec<Bound>)> = occluders
            .iter()
            .filter(|&&o| (o as usize) < scene.objects.len())
            .filter_map(|&o| {
                let mut triangles: Vec<Bound> = triangles(scene, o).collect();
                let mut parts = Vec::new();
                split(&mut triangles, DEPTH, &mut parts);
                let whole = parts.iter().copied().reduce(Bound::join)?;
                Some((whole, parts))
            })
            .collect();
        Self {
            any: objects.contains(&true),
            objects,
            all: occluders
                .iter()
                .map(|o| o.0)
                .fold(Bound::EMPTY, Bound::join),
            occluders,
        }
    }

    /// Nothing was.
    pub fn is_empty(&self) -> bool {
        !self.any
    }

    /// Whether a ray can find something else than it did. Sure to be true where it does.
    pub fn can_change(&self, origin: Vec3, ray: &Scatter) -> bool {
        if self.objects.get(ray.object as usize) == Some(&true) {
            return true;
        }
        if self.occluders.is_empty() {
            return false;
        }
        let far = self.all.min.abs().max(self.all.max.abs()).max_element();
        let segment = Segment {
            origin: origin.into(),
            inverse: reciprocal(ray.direction.into()),
            length: ray.distance,
            slack: 1e-5 * (far + origin.abs().max_element()),
        };
        segment.meets(&self.all)
            && self.occluders.iter().any(|(whole, parts)| {
                segment.meets(whole) && parts.iter().any(|part| segment.meets(part))
            })
    }
}

impl Segment {
    /// [`super::bvh`] finds every hit inside the box of the triangle that is hit.
    #[inline(always)]
    fn meets(&self, bound: &Bound) -> bool {
        let [enter, leave] = slab(
            bound.min - self.slack,
            bound.max + self.slack,
            self.origin,
            self.inverse,
        );
        enter <= leave && leave >= 0.0 && enter <= self.length
    }
}

impl Bound {
    const EMPTY: Self = Self {
        min: Vec3A::INFINITY,
        max: Vec3A::NEG_INFINITY,
    };

    fn join(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }
}

/// The boxes of an object's triangles that rays can hit.
fn triangles(scene: &Scene, object: u32) -> impl Iterator<Item = Bound> {
    let transform = scene.objects[object as usize].transform;
    let mesh = scene.mesh(object);
    mesh.triangles.iter().filter_map(move |triangle| {
        let [a, b, c] =
            triangle.map(|v| transform.transform_point3a(mesh.positions[v as usize].into()));
        let bound = Bound {
            min: a.min(b).min(c),
            max: a.max(b).max(c),
        };
        (bound.min.is_finite() && bound.max.is_finite()).then_some(bound)
    })
}

/// Boxes of parts, halved at the median along the longest side.
fn split(triangles: &mut [Bound], depth: u32, parts: &mut Vec<Bound>) {
    let Some(whole) = triangles.iter().copied().reduce(Bound::join) else {
        return;
    };
    if depth == 0 || triangles.len() < SPLIT {
        parts.push(whole);
        return;
    }
    let axis = Vec3::from(whole.max - whole.min).max_position();
    let middle = triangles.len() / 2;
    triangles.select_nth_unstable_by(middle, |a, b| {
        (a.min[axis] + a.max[axis]).total_cmp(&(b.min[axis] + b.max[axis]))
    });
    let (low, high) = triangles.split_at_mut(middle);
    split(low, depth - 1, parts);
    split(high, depth - 1, parts);
}

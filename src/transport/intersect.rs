//! Rays against boxes and triangles, and points moved off surfaces: the arithmetic of [`super::SceneBvh`].

use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;

/// Grown by a few units in the last place, so that the rounding of the node test cannot lose a triangle.
pub(super) fn padded_box(vertices: &[Vec3A; 3]) -> Aabb {
    let min = vertices[0].min(vertices[1]).min(vertices[2]);
    let max = vertices[0].max(vertices[1]).max(vertices[2]);
    let pad = min.abs().max(max.abs()).max_element() * 2e-6;
    Aabb::new(min - pad, max + pad)
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
pub(super) fn intersect(
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

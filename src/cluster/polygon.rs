//! Convex polygons in a plane: hull, simplification to eight vertices, clipping, and the estimate of the lit area (VPL13 section 5.2).

use arrayvec::ArrayVec;
use glam::{Vec2, Vec3};

use crate::transport::emission::convex_hull;
use crate::transport::sampling::basis;

/// Most vertices that a polygon light has.
pub const MAX_VERTICES: usize = 8;

/// A plane with coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    /// A point of it, the origin of the coordinates.
    pub origin: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    x: Vec3,
    y: Vec3,
}

impl Plane {
    /// Through a point.
    pub fn new(origin: Vec3, normal: Vec3) -> Self {
        let (x, y) = basis(normal);
        Self {
            origin,
            normal,
            x,
            y,
        }
    }

    /// Coordinates of a point's foot on the plane.
    pub fn project(&self, p: Vec3) -> Vec2 {
        Vec2::new((p - self.origin).dot(self.x), (p - self.origin).dot(self.y))
    }

    /// World space.
    pub fn lift(&self, p: Vec2) -> Vec3 {
        self.origin + self.x * p.x + self.y * p.y
    }

    /// Distance along the normal.
    pub fn height(&self, p: Vec3) -> f32 {
        (p - self.origin).dot(self.normal)
    }

    /// What of a polygon lies inside an axis-aligned box.
    pub fn clip_to_box(&self, mut polygon: Vec<Vec2>, lo: Vec3, hi: Vec3) -> Vec<Vec2> {
        for axis in 0..3 {
            let along = Vec2::new(self.x[axis], self.y[axis]);
            // Along an axis that the plane is perpendicular to, all of it is inside: its VPLs are.
            if along.length_squared() > 1e-8 {
                polygon = clip(&polygon, along, hi[axis] - self.origin[axis]);
                polygon = clip(&polygon, -along, self.origin[axis] - lo[axis]);
            }
        }
        polygon
    }
}

/// Signed area, positive for counter-clockwise polygons.
pub fn area(polygon: &[Vec2]) -> f32 {
    let twice = |i: usize| (polygon[i] - polygon[0]).perp_dot(polygon[i + 1] - polygon[0]);
    (1..polygon.len().saturating_sub(1)).map(twice).sum::<f32>() * 0.5
}

/// Centre of gravity of the area, or of the vertices where there is no area.
pub fn centroid(polygon: &[Vec2]) -> Vec2 {
    let (mut sum, mut weight) = (Vec2::ZERO, 0.0);
    for i in 1..polygon.len().saturating_sub(1) {
        let twice = (polygon[i] - polygon[0]).perp_dot(polygon[i + 1] - polygon[0]);
        sum += (polygon[0] + polygon[i] + polygon[i + 1]) * (twice / 3.0);
        weight += twice;
    }
    if weight.abs() > 1e-30 {
        sum / weight
    } else {
        polygon.iter().sum::<Vec2>() / polygon.len().max(1) as f32
    }
}

/// The part of a convex polygon where `p . normal <= offset` (Sutherland and Hodgman).
pub fn clip(polygon: &[Vec2], normal: Vec2, offset: f32) -> Vec<Vec2> {
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (da, db) = (a.dot(normal) - offset, b.dot(normal) - offset);
        if da <= 0.0 {
            out.push(a);
        }
        if (da < 0.0 && db > 0.0) || (da > 0.0 && db < 0.0) {
            out.push(a + (b - a) * (da / (da - db)));
        }
    }
    out
}

/// Takes edges out of a convex polygon by lengthening their neighbours, the one that adds the least area first, until
/// `max` vertices are left. The result contains the polygon.
pub fn simplify_outwards(mut polygon: Vec<Vec2>, max: usize) -> Vec<Vec2> {
    while polygon.len() > max.max(3) {
        let n = polygon.len();
        let best = (0..n)
            .filter_map(|i| {
                let (before, a, b, after) = (
                    polygon[(i + n - 1) % n],
                    polygon[i],
                    polygon[(i + 1) % n],
                    polygon[(i + 2) % n],
                );
                let (u, v) = (a - before, after - b);
                let cross = u.perp_dot(v);
                // The neighbours meet beyond the edge only if they turn by less than half a turn together.
                if cross <= 1e-6 * u.length() * v.length() {
                    return None;
                }
                let meet = a + u * ((b - a).perp_dot(v) / cross);
                Some(((a - meet).perp_dot(b - meet).abs(), i, meet))
            })
            .min_by(|x, y| x.0.total_cmp(&y.0));
        let Some((_, i, meet)) = best else {
            return simplify_inwards(polygon, max);
        };
        polygon[i] = meet;
        polygon.remove((i + 1) % n);
    }
    polygon
}

/// Takes out vertices of a convex polygon, those that cost the least area first, until `max` are left.
pub fn simplify_inwards(mut polygon: Vec<Vec2>, max: usize) -> Vec<Vec2> {
    while polygon.len() > max.max(3) {
        let n = polygon.len();
        let cost = |i: usize| {
            (polygon[i] - polygon[(i + n - 1) % n]).perp_dot(polygon[(i + 1) % n] - polygon[i])
        };
        let cheapest = (0..n)
            .min_by(|&i, &j| cost(i).total_cmp(&cost(j)))
            .unwrap_or(0);
        polygon.remove(cheapest);
    }
    polygon
}

/// The convex region that points on a plane were drawn from, as well as they tell; none if they lie on a line.
///
/// The hull of n uniform points misses a share of the region that equals, in expectation, the share of points that
/// are hull vertices (Efron 1965), whatever the region's shape: the simplified hull is scaled about its centre to make up for
/// it. (VPL13's border of 1.5 sqrt(A/n) is several times wider; it relies on the clipping at the cell and reaches through walls
/// where a surface ends inside of the cell.)
pub fn region(points: &[Vec2]) -> Option<Vec<Vec2>> {
    let hull = convex_hull(points.to_vec());
    let hull_area = area(&hull);
    let reach = hull
        .iter()
        .map(|p| p.distance_squared(hull[0]))
        .fold(0.0, f32::max);
    if hull.len() < 3 || hull_area <= 1e-4 * reach {
        return None;
    }
    let missing = hull.len() as f32 / (points.len() + 1) as f32;
    let wanted = hull_area / (1.0 - missing.min(0.75));
    let simple = simplify_outwards(hull, MAX_VERTICES);
    let scale = (wanted / area(&simple)).sqrt();
    let center = centroid(&simple);
    Some(
        simple
            .into_iter()
            .map(|p| center + (p - center) * scale)
            .collect(),
    )
}

/// World-space vertices, counter-clockwise around the plane's normal; none if less than a triangle is left.
pub fn vertices(plane: &Plane, polygon: Vec<Vec2>) -> Option<ArrayVec<Vec3, MAX_VERTICES>> {
    let polygon = simplify_inwards(polygon, MAX_VERTICES);
    (polygon.len() >= 3 && area(&polygon) > 0.0)
        .then(|| polygon.iter().map(|&p| plane.lift(p)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Random points: the estimate is made for these, stratified ones have larger hulls.
    fn points(n: u32, seed: u32) -> Vec<Vec2> {
        let mut state = u64::from(seed) + 1;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 24) as f32
        };
        (0..n).map(|_| Vec2::new(3.0 * next(), next())).collect()
    }

    #[test]
    fn regions_have_the_area_that_points_were_drawn_from() {
        for n in [12, 30, 100] {
            let areas: Vec<f32> = (0..200)
                .map(|seed| {
                    let region = region(&points(n, seed)).expect("an area");
                    assert!(region.len() <= MAX_VERTICES);
                    area(&region)
                })
                .collect();
            let mean = areas.iter().sum::<f32>() / 200.0;
            assert!(
                (mean / 3.0 - 1.0).abs() < 0.12,
                "{n} points: {mean} instead of 3"
            );
        }
        assert!(region(&[Vec2::ZERO, Vec2::ONE, Vec2::ONE * 2.0]).is_none());
        assert!(region(&[Vec2::ZERO; 20]).is_none());
    }

    #[test]
    fn outward_simplification_contains_and_inward_is_contained() {
        for seed in 0..40 {
            let hull = convex_hull(points(60, seed));
            let out = simplify_outwards(hull.clone(), 5);
            assert!(
                out.len() <= 5 && area(&out) >= area(&hull) * 0.9999,
                "{hull:?} {out:?}"
            );
            let inside = |p: Vec2, polygon: &[Vec2]| {
                (0..polygon.len()).all(|i| {
                    (polygon[(i + 1) % polygon.len()] - polygon[i]).perp_dot(p - polygon[i]) > -1e-4
                })
            };
            assert!(hull.iter().all(|&p| inside(p, &out)));
            let within = simplify_inwards(hull.clone(), 5);
            assert!(within.len() == 5 && within.iter().all(|p| hull.contains(p)));
        }
    }

    #[test]
    fn clipping_to_a_box_keeps_what_is_inside() {
        let plane = Plane::new(
            Vec3::new(0.5, 0.5, 0.5),
            Vec3::new(1.0, 1.0, 0.0).normalize(),
        );
        let big: Vec<Vec2> = [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)]
            .map(|(x, y)| Vec2::new(x, y))
            .to_vec();
        let clipped = plane.clip_to_box(big, Vec3::ZERO, Vec3::ONE);
        // A diagonal section of the unit cube.
        assert!((area(&clipped) - 2f32.sqrt()).abs() < 1e-4);
        assert!((plane.lift(centroid(&clipped)) - 0.5).abs().max_element() < 1e-5);
        let corners = vertices(&plane, clipped).expect("a polygon");
        assert!(
            corners.iter().all(
                |v| v.cmpge(Vec3::splat(-1e-5)).all() && v.cmple(Vec3::splat(1.0 + 1e-5)).all()
            )
        );
        // Counter-clockwise around the normal.
        let turn = (corners[1] - corners[0]).cross(corners[2] - corners[1]);
        assert!(turn.dot(plane.normal) > 0.0);
    }
}

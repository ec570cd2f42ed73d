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

    /// The plane inside an axis-aligned box that holds its origin.
    pub fn section(&self, lo: Vec3, hi: Vec3) -> Vec<Vec2> {
        let reach = lo.distance(hi);
        let all = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let all = all.map(|corner| Vec2::from(corner) * reach);
        self.clip_to_box(all.to_vec(), lo, hi)
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

/// Where this many points should lie, and none does, the region that they were drawn from is taken to end: chance leaves a
/// given piece as empty once in 150 times. Of few points, this share.
const MISSED: f32 = 5.0;
const MISSED_SHARE: f32 = 1.0 / 6.0;
/// How much larger a region may be than its points' hull tells.
const EXCESS: f32 = 1.1;

/// Where points on a plane were drawn from, as well as they tell.
pub struct Region {
    /// Convex.
    pub outline: Vec<Vec2>,
    /// The centre of the points' hull: of the surface itself, whatever the outline makes of gaps between points.
    pub middle: Vec2,
}

impl Region {
    /// The part of `section` (what of the plane lies in the cell) that points on the plane were drawn from; none if they lie
    /// on a line.
    ///
    /// All of the section, less what sides of the points' hull cut off, the largest piece first, as long as points are missed
    /// there, or as it is larger than it should be: the hull of n uniform points misses a share of their region that equals, in
    /// expectation, the share of points that are hull vertices (Efron 1965), whatever the region's shape. So a surface that fills
    /// its cell does so to the corners, which hulls of random points never reach: polygon lights meet without gaps, where a
    /// wall beside them would show each as a dark spot. (VPL13 widens the hull by 1.5 sqrt(A/n) and clips it at the cell, which
    /// reaches through walls where a surface ends inside of the cell.)
    pub fn of(points: &[Vec2], section: Vec<Vec2>) -> Option<Self> {
        let hull = convex_hull(points.to_vec());
        let reach = hull
            .iter()
            .map(|p| p.distance_squared(hull[0]))
            .fold(0.0, f32::max);
        if hull.len() < 3 || area(&hull) <= 1e-4 * reach {
            return None;
        }
        let count = points.len() as f32;
        let outside = hull.len() as f32 / (count + 1.0);
        let wanted = area(&hull) / (1.0 - outside.min(0.75));
        let missed = MISSED.min(MISSED_SHARE * count);
        let side = |i: usize| {
            let normal = -(hull[(i + 1) % hull.len()] - hull[i])
                .perp()
                .try_normalize()?;
            Some((normal, hull[i].dot(normal)))
        };
        let mut sides: Vec<(Vec2, f32)> = (0..hull.len()).filter_map(side).collect();
        let mut tight = section.clone();
        let mut chosen = Vec::new();
        while tight.len() >= 3 {
            let whole = area(&tight);
            let cuts = sides.iter().enumerate();
            let largest = cuts
                .map(|(i, &(normal, offset))| (i, beyond(&tight, normal, offset).0))
                .max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((i, cut)) = largest else {
                break;
            };
            if cut * count < missed * (whole - cut) && whole <= EXCESS * wanted {
                break;
            }
            let side = sides.swap_remove(i);
            let rest = clip(&tight, side.0, side.1);
            if rest.len() <= MAX_VERTICES {
                tight = rest;
                chosen.push(side);
            }
        }
        // What is still missing lies between the sides and the points next to them.
        let strip = (wanted - area(&tight)).max(0.0) / chosen.len().max(1) as f32;
        let within = 1e-3 * reach.sqrt();
        let wider = |region: Vec<Vec2>, (normal, offset): (Vec2, f32)| {
            let length = beyond(&tight, normal, offset - within).1;
            clip(&region, normal, offset + strip / length.max(within))
        };
        Some(Self {
            outline: chosen.into_iter().fold(section, wider),
            middle: centroid(&hull),
        })
    }
}

/// Of the part of a convex polygon where `p . normal > offset`: the area, and the length along the cut.
fn beyond(polygon: &[Vec2], normal: Vec2, offset: f32) -> (f32, f32) {
    let height = |p: Vec2| p.dot(normal) - offset;
    let mut part: ArrayVec<Vec2, { MAX_VERTICES + 2 }> = ArrayVec::new();
    let mut ends: ArrayVec<Vec2, 2> = ArrayVec::new();
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (from, to) = (height(a), height(b));
        if from > 0.0 {
            part.push(a);
        }
        if (from > 0.0) != (to > 0.0) {
            let crossing = a + (b - a) * (from / (from - to));
            part.push(crossing);
            let _ = ends.try_push(crossing);
        }
    }
    let chord = match ends[..] {
        [a, b] => a.distance(b),
        _ => 0.0,
    };
    (area(&part), chord)
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

    fn outline(points: &[Vec2], section: Vec<Vec2>) -> Option<Vec<Vec2>> {
        Some(Region::of(points, section)?.outline)
    }

    fn rectangle(lo: [f32; 2], hi: [f32; 2]) -> Vec<Vec2> {
        [[lo[0], lo[1]], [hi[0], lo[1]], hi, [lo[0], hi[1]]]
            .map(Vec2::from)
            .to_vec()
    }

    #[test]
    fn regions_have_the_area_that_points_were_drawn_from() {
        // Open space around, a wall on two sides, walls all around.
        let sections = [
            ([-4.0, -4.0], [7.0, 5.0]),
            ([0.0, 0.0], [7.0, 5.0]),
            ([0.0, 0.0], [3.0, 1.0]),
        ];
        for (lo, hi) in sections {
            for n in [12, 30, 100] {
                let areas: Vec<f32> = (0..200)
                    .map(|seed| {
                        let region = outline(&points(n, seed), rectangle(lo, hi)).expect("an area");
                        assert!(region.len() <= MAX_VERTICES);
                        area(&region)
                    })
                    .collect();
                let mean = areas.iter().sum::<f32>() / 200.0;
                assert!(
                    (mean / 3.0 - 1.0).abs() < 0.14,
                    "{n} points: {mean} instead of 3"
                );
            }
        }
        let any = || rectangle([-9.0; 2], [9.0; 2]);
        assert!(outline(&[Vec2::ZERO, Vec2::ONE, Vec2::ONE * 2.0], any()).is_none());
        assert!(outline(&[Vec2::ZERO; 20], any()).is_none());
    }

    /// Polygons of neighbouring cells meet in the cells' corners: no dark spot on a wall beside them.
    #[test]
    fn surfaces_that_go_on_behind_their_cell_fill_it_to_the_corners() {
        let section = rectangle([0.0; 2], [3.0, 1.0]);
        let full = (0..200).filter(|&seed| {
            let region = outline(&points(100, seed), section.clone()).expect("an area");
            section.iter().all(|corner| region.contains(corner))
        });
        let full = full.count();
        assert!(full >= 150, "{full} of 200 regions reach all corners");
    }

    #[test]
    fn what_lies_beyond_a_line_is_what_clipping_there_takes_away() {
        for seed in 0..40 {
            let hull = simplify_outwards(convex_hull(points(30, seed)), MAX_VERTICES);
            let normal = Vec2::from_angle(seed as f32);
            let offset = centroid(&hull).dot(normal) + 0.01 * (seed as f32 - 20.0);
            let (cut, chord) = beyond(&hull, normal, offset);
            let rest = clip(&hull, normal, offset);
            assert!((area(&rest) + cut - area(&hull)).abs() < 1e-4);
            let on = rest
                .iter()
                .filter(|p| (p.dot(normal) - offset).abs() < 1e-5);
            let along = on.map(|p| p.perp_dot(normal));
            let ends = along.fold([f32::MAX, f32::MIN], |e, t| [e[0].min(t), e[1].max(t)]);
            assert!((ends[1] - ends[0] - chord).abs() < 1e-4);
        }
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

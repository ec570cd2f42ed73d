//! Which texels bilinear filtering can fetch: the slow, obvious oracle of the GPU's rasterization.

use glam::{DVec2, UVec2};

use super::Atlas;

/// A triangle in texels.
pub(crate) type Triangle2 = [DVec2; 3];

/// Calls `visit` for every texel within `size` that a bilinear lookup at some point of `triangle` weighs above zero.
///
/// A lookup at `p` fetches the texels whose centres lie within one texel of `p` in x and in y (exclusive: at one texel the weight is 0). So a
/// texel is fetched where the triangle meets the open square of side 2 around its centre. Triangles without
/// area (lines, points) count like any other.
pub(crate) fn footprint(triangle: &Triangle2, size: UVec2, mut visit: impl FnMut(u32, u32)) {
    let [a, b, c] = *triangle;
    let (lo, hi) = (a.min(b).min(c), a.max(b).max(c));
    if !(lo.is_finite() && hi.is_finite()) {
        return;
    }
    let (first, end) = covered_range(lo.y, hi.y, size.y);
    for y in first..end {
        let centre = f64::from(y) + 0.5;
        // The x extent of the triangle inside the band of rows that fetch this one. By convexity it is spanned by the corners
        // in the band and by the edges' crossings of its borders.
        let (below, above) = (centre - 1.0, centre + 1.0);
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut extend = |x: f64| {
            left = left.min(x);
            right = right.max(x);
        };
        for (p, q) in [(a, b), (b, c), (c, a)] {
            if (below..=above).contains(&p.y) {
                extend(p.x);
            }
            for border in [below, above] {
                if (p.y < border) != (q.y < border) {
                    let t = ((border - p.y) / (q.y - p.y)).clamp(0.0, 1.0);
                    extend(p.x + t * (q.x - p.x));
                }
            }
        }
        let (first, end) = covered_range(left, right, size.x);
        for x in first..end {
            visit(x, y);
        }
    }
}

/// Texels whose centre is less than 1 away from some point of `lo..=hi`.
fn covered_range(lo: f64, hi: f64, size: u32) -> (u32, u32) {
    if lo > hi {
        return (0, 0);
    }
    // lo - 1 < i + 0.5 < hi + 1
    let first = (lo - 1.5).floor() + 1.0;
    let end = (hi + 0.5).ceil();
    (
        first.clamp(0.0, f64::from(size)) as u32,
        end.clamp(0.0, f64::from(size)) as u32,
    )
}

/// A texel that some surface point fetches, and whose value is not that surface's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Missing {
    /// The object that fetches it.
    pub object: u32,
    /// Page index.
    pub page: u32,
    /// Texel of the page.
    pub texel: UVec2,
    /// The object that the texel belongs to, if any.
    pub found: Option<u32>,
}

/// Lists every texel that bilinear filtering of a surface point can fetch and that does not hold a value of that surface's
/// object, each once per object, by rows. `covered` tells the object whose value a texel (page, x, y) holds.
pub fn missing(atlas: &Atlas, covered: impl Fn(u32, u32, u32) -> Option<u32>) -> Vec<Missing> {
    let mut missing = Vec::new();
    for (index, object) in atlas.objects.iter().enumerate() {
        let fetched = fetched(&object.layout, object.size);
        for (i, _) in fetched.iter().enumerate().filter(|(_, f)| **f) {
            let texel =
                object.origin + UVec2::new(i as u32 % object.size.x, i as u32 / object.size.x);
            let found = covered(object.page, texel.x, texel.y);
            if found != Some(index as u32) {
                missing.push(Missing {
                    object: index as u32,
                    page: object.page,
                    texel,
                    found,
                });
            }
        }
    }
    missing
}

/// Which texels of a layout's rectangle bilinear filtering can fetch, row by row.
pub fn fetched(layout: &super::UvLayout, size: UVec2) -> Vec<bool> {
    let owners = owners(layout, size);
    owners.into_iter().map(|chart| chart != u32::MAX).collect()
}

/// The chart that each texel of a layout's rectangle can be fetched for, row by row; [`u32::MAX`] for none.
pub(super) fn owners(layout: &super::UvLayout, size: UVec2) -> Vec<u32> {
    let mut owners = vec![u32::MAX; size.x as usize * size.y as usize];
    for (corners, &chart) in layout.triangles.iter().zip(&layout.charts) {
        let triangle = corners.map(|v| layout.vertices[v as usize].uv.as_dvec2());
        footprint(&triangle, size, |x, y| {
            owners[(y * size.x + x) as usize] = chart
        });
    }
    owners
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Separating axes between the triangle and the open square around a texel's centre.
    fn meets(triangle: &Triangle2, x: u32, y: u32) -> bool {
        let centre = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let edges = [0, 1, 2].map(|i| (triangle[(i + 1) % 3] - triangle[i]).perp());
        [DVec2::X, DVec2::Y]
            .into_iter()
            .chain(edges)
            .filter(|n| *n != DVec2::ZERO)
            .all(|axis| {
                let reach = axis.x.abs() + axis.y.abs();
                let along = triangle.map(|p| (p - centre).dot(axis));
                along.iter().any(|d| *d < reach) && along.iter().any(|d| *d > -reach)
            })
    }

    fn footprint_set(triangle: &Triangle2, size: UVec2) -> Vec<bool> {
        let mut set = vec![false; (size.x * size.y) as usize];
        footprint(triangle, size, |x, y| set[(y * size.x + x) as usize] = true);
        set
    }

    #[test]
    fn a_point_fetches_what_bilinear_filtering_weighs() {
        let at = |x, y| {
            footprint_set(&[DVec2::new(x, y); 3], UVec2::splat(4))
                .iter()
                .filter(|c| **c)
                .count()
        };
        assert_eq!(at(2.0, 2.0), 4);
        assert_eq!(at(1.5, 2.0), 2, "on a column of centres");
        assert_eq!(at(1.5, 1.5), 1, "on a centre");
    }

    proptest! {
        // On a quarter grid, so that touching without overlap and degenerate triangles come up often and are exact.
        #[test]
        fn equals_the_separating_axis_test(points in prop::array::uniform6(0i32..40)) {
            let p = points.map(|v| f64::from(v) / 4.0);
            let triangle = [DVec2::new(p[0], p[1]), DVec2::new(p[2], p[3]), DVec2::new(p[4], p[5])];
            let size = UVec2::new(11, 10);
            let set = footprint_set(&triangle, size);
            for y in 0..size.y {
                for x in 0..size.x {
                    // Crossings at quarters divide inexactly; leave out what touches within rounding.
                    let nudged = [-1e-9, 1e-9].map(|d| {
                        let centre = DVec2::splat(5.0);
                        meets(&triangle.map(|p| centre + (p - centre) * (1.0 + d)), x, y)
                    });
                    let got = set[(y * size.x + x) as usize];
                    prop_assert!(got == meets(&triangle, x, y) || nudged[0] != nudged[1], "{triangle:?} at {x} {y}: {got}");
                }
            }
        }
    }
}

//! The passes against an oracle that asks every texel about every triangle, and against bilinear filtering itself.

use std::sync::Arc;

use super::*;
use crate::gpu::testing::gpu;
use crate::lightmap::{Texel, UvLayout, UvSource, UvVertex};

/// Random numbers from a seed (PCG32).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u32 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        ((((self.0 >> 18) ^ self.0) >> 27) as u32).rotate_right((self.0 >> 59) as u32)
    }

    /// In [0, 1).
    fn unit(&mut self) -> f32 {
        (self.next() >> 8) as f32 / (1 << 24) as f32
    }

    fn point(&mut self, size: Vec2) -> Vec2 {
        Vec2::new(self.unit(), self.unit()) * size
    }
}

fn object(page: u32, origin: UVec2, size: UVec2, triangles: &[[Vec2; 3]]) -> ObjectAtlas {
    let vertices = triangles.iter().flatten().enumerate();
    ObjectAtlas {
        page,
        origin,
        size,
        source: UvSource::Unwrapped,
        layout: Arc::new(UvLayout {
            vertices: vertices
                .map(|(i, &uv)| UvVertex {
                    source: i as u32,
                    uv,
                })
                .collect(),
            triangles: (0..triangles.len() as u32)
                .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
                .collect(),
            charts: vec![0; triangles.len()],
        }),
    }
}

/// Triangles of every kind that unwrapping can yield, and worse.
fn triangles(random: &mut Random, size: Vec2, count: usize) -> Vec<[Vec2; 3]> {
    (0..count)
        .map(|i| {
            let a = random.point(size);
            let inside = |p: Vec2| p.clamp(Vec2::ZERO, size);
            let mut near = |reach: f32| inside(a + (random.point(Vec2::ONE) - 0.5) * reach);
            match i % 8 {
                0 => [a, near(2.0 * size.x), near(2.0 * size.x)],
                1 => [a, near(6.0), near(6.0)],
                2 => [a, near(0.5), near(0.5)],
                3 => [a, near(0.01), near(2.0 * size.x)],
                4 => [a, a, near(8.0)],
                5 => [a, a, a],
                // Through texel centres and corners, along axes.
                6 => [near(9.0), near(9.0), near(9.0)].map(|p| (p * 2.0).round() / 2.0),
                _ => [
                    a,
                    inside(a + Vec2::new(size.x, 0.0)),
                    inside(a + Vec2::new(0.0, 0.01)),
                ],
            }
        })
        .collect()
}

/// The same rule, asked texel by texel.
fn oracle(atlas: &Atlas, page: u32) -> Vec<u32> {
    let mut claims = vec![Claims::NONE; (atlas.page_size as usize).pow(2)];
    let mut id = 0;
    for layout in &atlas.objects {
        for triangle in &layout.layout.triangles {
            let uv = triangle.map(|vertex| layout.layout.vertices[vertex as usize].uv);
            let corner = grid_triangle(uv, layout, id)
                .corner
                .map(|c| c.map(i128::from));
            let end = layout.origin + layout.size;
            for (y, x) in
                (layout.origin.y..end.y).flat_map(|y| (layout.origin.x..end.x).map(move |x| (y, x)))
            {
                let center = [x, y].map(|v| i128::from(v * UV_UNIT + UV_UNIT / 2));
                if layout.page == page
                    && let Some(pass) = claiming_pass(corner, center)
                {
                    let claim = &mut claims[(y * atlas.page_size + x) as usize];
                    *claim = (*claim).min(pass << 30 | id);
                }
            }
            id += 1;
        }
    }
    claims
}

/// What the claim's high bits say; none if the triangle does not reach the texel.
fn claiming_pass(corner: [[i128; 2]; 3], center: [i128; 2]) -> Option<u32> {
    let cross = |a: [i128; 2], b: [i128; 2], c: [i128; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let [a, b, c] = corner;
    let area = cross(a, b, c);
    let sides = [
        cross(a, b, center),
        cross(b, c, center),
        cross(c, a, center),
    ];
    if area != 0 && sides.iter().all(|side| side * area >= 0) {
        return Some(0);
    }
    let edges = [(a, b), (b, c), (c, a)];
    let any = |reach: u32| {
        edges
            .iter()
            .any(|&(a, b)| a != b && touches(a, b, center, reach.into()))
    };
    if any(UV_UNIT / 2) {
        Some(1)
    } else if any(UV_REACH) {
        Some(2)
    } else {
        (a == b && b == c && touches(a, b, center, UV_REACH.into())).then_some(3)
    }
}

/// Does the edge meet the open box around the centre? It is cut to the box along u, then along v, in fractions of its
/// length (Liang and Barsky's clipping).
fn touches(a: [i128; 2], b: [i128; 2], center: [i128; 2], reach: i128) -> bool {
    let (mut from, mut to) = ((0, 1), (1, 1));
    for i in 0..2 {
        let d = b[i] - a[i];
        let (low, high) = (center[i] - reach - a[i], center[i] + reach - a[i]);
        if d == 0 {
            if low >= 0 || high <= 0 {
                return false;
            }
            continue;
        }
        let (enter, leave) = if d > 0 {
            ((low, d), (high, d))
        } else {
            ((-high, -d), (-low, -d))
        };
        // An edge that ends on the box's border does not reach into it.
        if enter.0 >= enter.1 || leave.0 <= 0 {
            return false;
        }
        if enter.0 * from.1 > from.0 * enter.1 {
            from = enter;
        }
        if leave.0 * to.1 < to.0 * leave.1 {
            to = leave;
        }
    }
    from.0 * to.1 < to.0 * from.1
}

fn check(atlas: &Atlas) -> Claims {
    let claims = rasterize(gpu(), atlas).unwrap();
    for page in 0..atlas.pages {
        let expected = oracle(atlas, page);
        let found = &claims.pages[page as usize];
        for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let (x, y) = (i as u32 % atlas.page_size, i as u32 / atlas.page_size);
            assert_eq!(found, expected, "page {page}, texel ({x}, {y})");
        }
    }
    claims
}

#[test]
fn claims_are_those_of_the_oracle() {
    let mut random = Random(1);
    // The last size is for one triangle that fills a page: more texels than lavapipe's loops have rounds.
    for (page_size, count) in [(16, 8), (64, 24), (128, 120), (512, 1)] {
        let half = page_size / 2;
        let mut add = |page, origin, size: UVec2| {
            object(
                page,
                origin,
                size,
                &triangles(&mut random, size.as_vec2(), count),
            )
        };
        // Rectangles that touch: a claim past its own would be seen.
        let objects = vec![
            add(0, UVec2::ZERO, UVec2::new(half, half)),
            add(1, UVec2::ZERO, UVec2::splat(page_size)),
            add(0, UVec2::new(half, 0), UVec2::new(half, page_size)),
        ];
        check(&Atlas {
            page_size,
            pages: 2,
            density: 1.0,
            objects,
        });
    }
}

/// Bilinear filtering itself: the four texels around a surface point are its object's, where they have weight.
#[test]
fn whatever_is_fetched_is_claimed_by_the_same_object() {
    let mut random = Random(2);
    let size = UVec2::new(100, 60);
    // The outermost texels are padding, so that points on the border have all four.
    let inset = Vec2::ONE;
    let objects: Vec<_> = [UVec2::ZERO, UVec2::new(0, 60), UVec2::new(100, 7)]
        .map(|origin| {
            let list = triangles(&mut random, size.as_vec2() - 2.0 * inset, 160);
            let list: Vec<_> = list.iter().map(|t| t.map(|p| p + inset)).collect();
            object(0, origin, size, &list)
        })
        .into();
    let atlas = Atlas {
        page_size: 200,
        pages: 1,
        density: 1.0,
        objects,
    };
    let claims = rasterize(gpu(), &atlas).unwrap();
    let mut fetches = 0;
    for (index, layout) in atlas.objects.iter().enumerate() {
        let own = claims.first_triangle[index]..claims.first_triangle[index + 1];
        for (i, triangle) in layout.layout.triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|v| layout.layout.vertices[v as usize].uv);
            for sample in 0..200 {
                // Inside, along an edge, at a corner.
                let mut u = random.point(Vec2::ONE);
                if u.x + u.y > 1.0 {
                    u = 1.0 - u;
                }
                let weights = [u, Vec2::new(u.x, 0.0), Vec2::ZERO][sample % 3];
                let uv = a + (b - a) * weights.x + (c - a) * weights.y;
                // As a file stores it.
                let stored = (uv + layout.origin.as_vec2()) / atlas.page_size as f32;
                let at = (stored * atlas.page_size as f32 - 0.5).as_dvec2();
                let (first, part) = (at.floor(), at - at.floor());
                for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let weight = |part: f64, d: i32| if d == 0 { 1.0 - part } else { part };
                    if weight(part.x, dx) * weight(part.y, dy) == 0.0 {
                        continue;
                    }
                    let (x, y) = (first.x as i32 + dx, first.y as i32 + dy);
                    let claim = claims.pages[0][(y * atlas.page_size as i32 + x) as usize];
                    let owner = Claims::triangle(claim);
                    assert!(
                        owner.is_some_and(|owner| own.contains(&owner)),
                        "object {index}, triangle {i} at {uv} fetches ({x}, {y}) of {owner:?}"
                    );
                    fetches += 1;
                }
            }
        }
    }
    assert!(fetches > 100_000);
}

#[test]
fn statistics_count_owners_and_what_triangles_miss() {
    let square = [
        Vec2::new(1.0, 1.0),
        Vec2::new(5.0, 1.0),
        Vec2::new(1.0, 5.0),
    ];
    // Covered by the first, so that it owns nothing.
    let hidden = [
        Vec2::new(1.9, 1.9),
        Vec2::new(2.1, 1.9),
        Vec2::new(1.9, 2.1),
    ];
    let point = [Vec2::new(8.0, 8.0); 3];
    let objects = vec![object(
        0,
        UVec2::ZERO,
        UVec2::splat(10),
        &[square, hidden, point],
    )];
    let atlas = Atlas {
        page_size: 16,
        pages: 1,
        density: 1.0,
        objects,
    };
    let claims = check(&atlas);
    let statistics = claims.statistics;
    // Centres 1.5, 2.5, 3.5, 4.5: 4 + 3 + 2 + 1 under the hypotenuse, border included.
    let covered = claims.pages[0].iter().filter(|c| Claims::is_covered(**c));
    assert_eq!(covered.count(), 10);
    assert_eq!(statistics.t_uv, 2);
    assert_eq!(statistics.texels - statistics.p_uv, 10);
    let by_vertex = claims.pages[0]
        .iter()
        .filter(|c| **c != Claims::NONE && **c >> 30 == 3);
    assert_eq!(by_vertex.count(), 4);
}

#[test]
fn nothing_to_claim_and_nonsense_are_no_trouble() {
    let empty = Atlas {
        page_size: 16,
        pages: 1,
        density: 1.0,
        objects: Vec::new(),
    };
    assert_eq!(check(&empty).statistics.texels, 0);
    let nonsense = [
        [Vec2::NAN, Vec2::INFINITY, Vec2::NEG_INFINITY],
        [Vec2::splat(1e30), Vec2::splat(-1e30), Vec2::new(1e30, 0.0)],
    ];
    let objects = vec![object(0, UVec2::splat(3), UVec2::splat(9), &nonsense)];
    check(&Atlas { objects, ..empty });
    let too_large = Atlas {
        page_size: 1 << 16,
        pages: 1,
        density: 1.0,
        objects: Vec::new(),
    };
    assert!(matches!(
        rasterize(gpu(), &too_large),
        Err(GpuError::OutOfMemory { .. })
    ));
}

#[test]
fn structures_lie_as_the_shaders_read_them() {
    use crate::bake::device::shaders::LAYOUTS;
    use std::mem::offset_of;
    let expected: [(&str, &[usize]); 3] = [
        (
            "Texel",
            &[
                offset_of!(Texel, position),
                offset_of!(Texel, object),
                offset_of!(Texel, normal),
                offset_of!(Texel, face),
                offset_of!(Texel, pixel),
            ],
        ),
        (
            "UvTriangle",
            &[
                offset_of!(UvTriangle, corner),
                offset_of!(UvTriangle, id),
                offset_of!(UvTriangle, low),
                offset_of!(UvTriangle, high),
            ],
        ),
        (
            "UvStrip",
            &[offset_of!(UvStrip, primitive), offset_of!(UvStrip, rows)],
        ),
    ];
    for (name, offsets) in expected {
        let (_, members) = LAYOUTS.iter().find(|(n, _)| *n == name).expect(name);
        let found: Vec<_> = members.iter().map(|(_, offset)| *offset as usize).collect();
        assert_eq!(found, offsets, "{name}");
    }
}

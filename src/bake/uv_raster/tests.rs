//! The passes against an oracle that asks every texel about every triangle, and against bilinear filtering itself.

use std::sync::Arc;

use super::*;
use crate::gpu::testing::gpu;
use crate::lightmap::{UvLayout, UvSource, UvVertex};

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
            let triangle = match i % 8 {
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
            };
            triangle
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
    // Does the edge pass through the open box around the centre? Cut to the box along u, then along v (Liang-Barsky),
    // in fractions t = p / q of the edge.
    let reach = i128::from(UV_REACH);
    let touches = |a: [i128; 2], b: [i128; 2]| {
        let (mut from, mut to) = ((0, 1), (1, 1));
        for i in 0..2 {
            let (d, low, high) = (
                b[i] - a[i],
                center[i] - reach - a[i],
                center[i] + reach - a[i],
            );
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
            // At its ends the box is open: an edge that starts or ends on its border does not touch it.
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
    };
    let lines = [(a, b), (b, c), (c, a)];
    if lines.iter().any(|&(a, b)| a != b && touches(a, b)) {
        return Some(1);
    }
    (lines.iter().any(|&(a, b)| a == b && touches(a, b))).then_some(2)
}

fn assert_oracle(atlas: &Atlas) -> Claims {
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
    for (page_size, count) in [(16, 1), (64, 24), (128, 200)] {
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
        assert_oracle(&Atlas {
            page_size,
            pages: 2,
            density: 1.0,
            objects,
        });
    }
}

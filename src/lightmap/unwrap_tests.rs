//! Charts: none overlaps another, all are as large as they should be, and they are the same every time.

use super::*;
use crate::lightmap::coverage::{self, Triangle2};

/// A mesh with one normal per vertex: the geometric one of its last triangle.
pub(crate) fn mesh(positions: &[Vec3], triangles: &[[u32; 3]]) -> Mesh {
    let mut normals = vec![Vec3::ZERO; positions.len()];
    for t in triangles {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        for &v in t {
            normals[v as usize] = (b - a).cross(c - a).normalize_or_zero();
        }
    }
    Mesh {
        name: "test".into(),
        positions: positions.to_vec(),
        normals,
        triangles: triangles.to_vec(),
        ..Mesh::default()
    }
}

fn check(mesh: &Mesh, layout: &UvLayout, size: UVec2) {
    assert_eq!(layout.triangles.len(), mesh.triangles.len());
    assert_eq!(layout.charts.len(), mesh.triangles.len());
    let mut owner = vec![u32::MAX; (size.x * size.y) as usize];
    for (t, corners) in layout.triangles.iter().enumerate() {
        for (&corner, &source) in corners.iter().zip(&mesh.triangles[t]) {
            let vertex = layout.vertices[corner as usize];
            assert_eq!(vertex.source, source, "triangle {t} lost a corner");
            let inside = vertex.uv.cmpge(Vec2::splat(PADDING as f32 - 1e-4)).all()
                && vertex
                    .uv
                    .cmple(size.as_vec2() - PADDING as f32 + 1e-4)
                    .all();
            assert!(inside, "triangle {t} at {} of {size}", vertex.uv);
        }
        // Texels that bilinear filtering may fetch, and one more around them: still no other chart's.
        let triangle: Triangle2 = corners.map(|v| layout.vertices[v as usize].uv.as_dvec2());
        coverage::footprint(&triangle, size, |x, y| {
            let slot = &mut owner[(y * size.x + x) as usize];
            assert!(
                *slot == u32::MAX || *slot == layout.charts[t],
                "charts meet at {x} {y}"
            );
            *slot = layout.charts[t];
        });
    }
    for y in 0..size.y {
        for x in 0..size.x {
            let here = owner[(y * size.x + x) as usize];
            for (dx, dy) in [(1, 0), (0, 1), (1, 1)] {
                if x + dx < size.x && y + dy < size.y {
                    let there = owner[((y + dy) * size.x + x + dx) as usize];
                    assert!(here == there || here == u32::MAX || there == u32::MAX);
                }
            }
        }
    }
}

/// A box whose sides share no vertex.
fn cube(size: Vec3) -> Mesh {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        for side in [0.0, 1.0] {
            let base = positions.len() as u32;
            for (i, j) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                let mut p = [0.0; 3];
                (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, i, j);
                positions.push(Vec3::from(p) * size);
            }
            let flip = if side > 0.0 {
                [[0, 1, 2], [0, 2, 3]]
            } else {
                [[0, 2, 1], [0, 3, 2]]
            };
            triangles.extend(flip.map(|t| t.map(|v| v + base)));
        }
    }
    mesh(&positions, &triangles)
}

/// Its longest edge ends 0.0004 texels past a whole one.
#[test]
fn what_ends_just_past_a_texel_stays_inside() {
    let positions = [
        Vec3::new(0.0, 1.0, 2.0),
        Vec3::ZERO,
        Vec3::new(3.0, 1.0, 2.0),
        Vec3::new(-3.0, -3.0, -1.0),
    ];
    let mesh = mesh(&positions, &[[0, 1, 1], [2, 3, 0]]);
    let (layout, size) = unwrap(&mesh, &mesh.positions, 1.0243483, 4096).unwrap();
    check(&mesh, &layout, size);
}

#[test]
fn a_box_gets_six_charts_of_the_right_size() {
    let cube = cube(Vec3::new(1.0, 2.0, 3.0));
    let (layout, size) = unwrap(&cube, &cube.positions, 10.0, 4096).unwrap();
    check(&cube, &layout, size);
    assert_eq!(layout.charts.iter().max(), Some(&5));
    let area: f32 = layout
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| layout.vertices[v as usize].uv);
            0.5 * (b - a).perp_dot(c - a).abs()
        })
        .sum();
    assert!(
        (area - 2200.0).abs() < 1.0,
        "{area} texels for 22 m² at 10 texels/m"
    );
}

#[test]
fn split_vertices_do_not_cut_a_flat_surface() {
    // Two triangles of a square that share positions but no vertex.
    let p = [
        Vec3::ZERO,
        Vec3::X,
        Vec3::X + Vec3::Z,
        Vec3::ZERO,
        Vec3::X + Vec3::Z,
        Vec3::Z,
    ];
    let square = mesh(&p, &[[0, 1, 2], [3, 4, 5]]);
    let (layout, size) = unwrap(&square, &p, 8.0, 4096).unwrap();
    check(&square, &layout, size);
    assert_eq!(layout.charts, [0, 0]);
}

#[test]
fn triangles_without_area_keep_a_place() {
    let p = [
        Vec3::ZERO,
        Vec3::X,
        Vec3::Y,
        Vec3::splat(9.0),
        Vec3::splat(8.0),
    ];
    let some = mesh(&p, &[[0, 1, 2], [1, 1, 2], [3, 4, 3], [3, 3, 3]]);
    let (layout, size) = unwrap(&some, &p, 8.0, 4096).unwrap();
    check(&some, &layout, size);
    assert_eq!(layout.charts, [0, 0, 1, 1]);

    let only = mesh(&p, &[[3, 3, 3], [3, 4, 3]]);
    let (layout, size) = unwrap(&only, &p, 8.0, 4096).unwrap();
    check(&only, &layout, size);
    assert_eq!(size, UVec2::splat(5));
}

#[test]
fn packing_anew_keeps_the_charts() {
    let wave = wave(24);
    let (first, _) = unwrap(&wave, &wave.positions, 20.0, 4096).unwrap();
    let (again, size) = repack(&wave, &wave.positions, &first, &[], 13.0, 4096).unwrap();
    check(&wave, &again, size);
    assert_eq!(
        crate::lightmap::edges::charts(&wave, &again),
        crate::lightmap::edges::charts(&wave, &first)
    );
    let length = |layout: &UvLayout| {
        let [a, b] = [0, 1].map(|k| layout.vertices[layout.triangles[100][k] as usize].uv);
        a.distance(b)
    };
    assert!((length(&again) / length(&first) - 13.0 / 20.0).abs() < 0.01);
}

#[test]
fn one_thread_and_many_give_the_same_charts() {
    let wave = wave(24);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| format!("{:?}", unwrap(&wave, &wave.positions, 20.0, 4096).unwrap()))
    };
    assert_eq!(with(1), with(3));
}

/// A curved height field of `2 n²` triangles.
fn wave(n: u32) -> Mesh {
    let at = |i: u32, j: u32| {
        let (x, z) = (i as f32 / n as f32, j as f32 / n as f32);
        Vec3::new(x, 0.3 * (9.0 * x).sin() * (7.0 * z).cos(), z)
    };
    let positions: Vec<Vec3> = (0..=n)
        .flat_map(|j| (0..=n).map(move |i| at(i, j)))
        .collect();
    let triangles: Vec<[u32; 3]> = (0..n * n)
        .flat_map(|k| {
            let v = k / n * (n + 1) + k % n;
            [[v, v + n + 1, v + 1], [v + 1, v + n + 1, v + n + 2]]
        })
        .collect();
    let mut wave = mesh(&positions, &triangles);
    wave.normals.fill(Vec3::ZERO);
    wave
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(24))]
    #[test]
    fn any_soup_of_triangles_is_laid_out_apart(
        points in proptest::collection::vec((-4i8..4, -4i8..4, -4i8..4), 3..20),
        corners in proptest::collection::vec((0usize..20, 0usize..20, 0usize..20), 1..24),
        density in 0.5f32..12.0,
    ) {
        let p: Vec<Vec3> = points.iter().map(|&(x, y, z)| Vec3::new(x.into(), y.into(), z.into())).collect();
        let n = p.len();
        let t: Vec<[u32; 3]> = corners.iter().map(|&(a, b, c)| [a, b, c].map(|v| (v % n) as u32)).collect();
        let soup = mesh(&p, &t);
        let (layout, size) = unwrap(&soup, &p, density, 4096).unwrap();
        check(&soup, &layout, size);
    }
}

//! Charts for a mesh: cut, flattened without overlap, and packed into one rectangle by `uvunwrap`.

use std::collections::HashMap;

use glam::{UVec2, Vec2, Vec3};

use super::edges::{shared_edges, weld};
use super::{PADDING, UvLayout, UvVertex};
use crate::scene::Mesh;

/// Shading normals that differ by more than this across an edge mark a hard edge: light may jump there, so charts end there.
const HARD_EDGE_COS: f32 = 0.866;
/// Triangles that lean further than this from their chart's mean normal start a new chart, degrees. Lower means less
/// stretching and more seams; above 70 the flattening fails often and is retried with smaller charts.
const MAX_CHART_ANGLE: f32 = 65.0;
/// The same where the whole mesh has fewer texels than triangles: nobody sees a seam there, and flat charts are quick.
const MAX_CHART_ANGLE_TINY: f32 = 40.0;
/// Up to this many triangles, charts are nested by their shapes, which fills about a tenth more of the rectangle; packing
/// thousands of charts that way takes seconds.
const NEST_UP_TO: usize = 4096;

/// Lays `mesh` out at `density` texels per metre. `positions` are the mesh's, scaled to metres of the world, and finite.
///
/// The rectangle is as small as it gets, but rather no side is longer than `limit` texels (it may be all the same: the caller has to look).
/// Charts keep 2 [`PADDING`] texels from each other and `PADDING` from the rectangle's border. Every triangle gets a place: one without
/// area shares the texel of a neighbour, or has one for itself and its like.
pub(crate) fn unwrap(
    mesh: &Mesh,
    positions: &[Vec3],
    density: f32,
    limit: u32,
) -> Result<(UvLayout, UVec2), uvunwrap::Error> {
    let welded = weld(positions);
    let triangles: Vec<[u32; 3]> = mesh
        .triangles
        .iter()
        .map(|t| t.map(|v| welded[v as usize]))
        .collect();
    let seams = hard_edges(mesh, &triangles);
    let area: f64 = triangles.iter().map(|t| triangle_area(positions, t)).sum();
    let texels = area * f64::from(density) * f64::from(density);
    let points: Vec<[f32; 3]> = positions.iter().map(|p| p.to_array()).collect();
    let input = uvunwrap::MeshInput {
        seams: Some(&seams),
        ..uvunwrap::MeshInput::new(&points, triangles.as_flattened())
    };
    let angle = if texels < triangles.len() as f64 {
        MAX_CHART_ANGLE_TINY
    } else {
        MAX_CHART_ANGLE
    };
    generate(mesh, input, angle, density, limit)
}

/// [`unwrap`] at another density: the charts of `first` are kept, and packed anew, each `factors[chart]` times as dense
/// (1 where there is none).
pub(crate) fn repack(
    mesh: &Mesh,
    positions: &[Vec3],
    first: &UvLayout,
    factors: &[f32],
    density: f32,
    limit: u32,
) -> Result<(UvLayout, UVec2), uvunwrap::Error> {
    let welded = weld(positions);
    let mut points: Vec<[f32; 3]> = vec![[0.0; 3]; first.vertices.len()];
    for (corners, &chart) in first.triangles.iter().zip(&first.charts) {
        // A chart's texels go with its surface: a denser chart says that it is larger.
        let factor = factors.get(chart as usize).copied().unwrap_or(1.0);
        for &corner in corners {
            let source = first.vertices[corner as usize].source;
            let at = positions[welded[source as usize] as usize] * factor;
            points[corner as usize] = at.to_array();
        }
    }
    let coordinates: Vec<[f32; 2]> = first.vertices.iter().map(|v| v.uv.to_array()).collect();
    let input = uvunwrap::MeshInput {
        existing_uvs: Some(&coordinates),
        ..uvunwrap::MeshInput::new(&points, first.triangles.as_flattened())
    };
    generate(mesh, input, MAX_CHART_ANGLE, density, limit)
}

fn generate(
    mesh: &Mesh,
    input: uvunwrap::MeshInput,
    max_chart_angle: f32,
    density: f32,
    limit: u32,
) -> Result<(UvLayout, UVec2), uvunwrap::Error> {
    let at = |page_size| uvunwrap::Density::Fixed {
        texels_per_unit: density,
        page_size,
    };
    let options = uvunwrap::Options {
        max_chart_angle,
        density: at(None),
        padding: PADDING,
        packing: if mesh.triangles.len() <= NEST_UP_TO {
            uvunwrap::Packing::Shape
        } else {
            uvunwrap::Packing::Fast
        },
        ..uvunwrap::Options::default()
    };
    let mut atlas = uvunwrap::generate(&[input], &options)?;
    if atlas.width.max(atlas.height) > limit && limit > 2 * PADDING {
        // The smallest rectangle is not always the squarest one.
        let options = uvunwrap::Options {
            density: at(Some(limit)),
            ..options
        };
        match uvunwrap::generate(&[input], &options) {
            Ok(page) if page.page_count == 1 => atlas = page,
            _ => {}
        }
    }
    Ok(layout(mesh, &atlas))
}

/// Area in m².
pub(crate) fn triangle_area(positions: &[Vec3], corners: &[u32; 3]) -> f64 {
    let [a, b, c] = corners.map(|v| positions[v as usize].as_dvec3());
    0.5 * (b - a).cross(c - a).length()
}

/// Marks the edges where shading normals jump. `triangles` index welded vertices.
fn hard_edges(mesh: &Mesh, triangles: &[[u32; 3]]) -> Vec<[bool; 3]> {
    let mut seams = vec![[false; 3]; triangles.len()];
    for shared in shared_edges(triangles) {
        let [(t, e), (u, f)] =
            [0, 1].map(|k| (shared.triangles[k] as usize, shared.edges[k] as usize));
        // The edge runs from e to e + 1 in one triangle and back in the other.
        let hard = [(e, (f + 1) % 3), ((e + 1) % 3, f)]
            .into_iter()
            .any(|(i, j)| {
                let (a, b) = (mesh.triangles[t][i], mesh.triangles[u][j]);
                let (n, m) = (mesh.normals[a as usize], mesh.normals[b as usize]);
                a != b && n != Vec3::ZERO && m != Vec3::ZERO && n.dot(m) < HARD_EDGE_COS
            });
        if hard {
            seams[t][e] = true;
            seams[u][f] = true;
        }
    }
    seams
}

/// Texels by which charts may end past a whole one without taking another: page coordinates are that exact.
const ROUNDING: f32 = 1e-3;

/// Reads the result back: texels instead of page coordinates, and vertices split by the mesh's own attributes too.
fn layout(mesh: &Mesh, atlas: &uvunwrap::Atlas) -> (UvLayout, UVec2) {
    let output = &atlas.meshes[0];
    let scale = Vec2::new(atlas.width as f32, atlas.height as f32);
    let used = output.vertices.iter().filter(|v| v.chart.is_some());
    let end = used.fold(Vec2::ZERO, |end, v| end.max(Vec2::from(v.uv) * scale));
    let mut size = if atlas.chart_count == 0 {
        UVec2::ZERO
    } else {
        (end - ROUNDING).ceil().as_uvec2() + PADDING
    };
    // What the rectangle was not made larger for ends at its last whole texel.
    let most = (end - ROUNDING).ceil();
    let spare = output.vertices.iter().any(|v| v.chart.is_none()).then(|| {
        // Triangles that no chart could take, nor a neighbour's: one texel below the charts.
        let uv = Vec2::new(PADDING as f32 + 0.5, (size.y + PADDING) as f32 + 0.5);
        size = UVec2::new(size.x.max(2 * PADDING + 1), size.y + 2 * PADDING + 1);
        uv
    });
    let mut built = UvLayout::default();
    let mut split: HashMap<(u32, u32), u32> = HashMap::with_capacity(output.vertices.len());
    for (corners, placed) in mesh.triangles.iter().zip(output.indices.chunks_exact(3)) {
        let chart = output.vertices[placed[0] as usize]
            .chart
            .unwrap_or(atlas.chart_count);
        built.charts.push(chart);
        built.triangles.push([0, 1, 2].map(|k| {
            *split.entry((corners[k], placed[k])).or_insert_with(|| {
                let vertex = &output.vertices[placed[k] as usize];
                let uv = match spare {
                    Some(uv) if vertex.chart.is_none() => uv,
                    _ => (Vec2::from(vertex.uv) * scale).min(most),
                };
                built.vertices.push(UvVertex {
                    source: corners[k],
                    uv,
                });
                built.vertices.len() as u32 - 1
            })
        }));
    }
    (built, size)
}

#[cfg(test)]
mod tests {
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
}

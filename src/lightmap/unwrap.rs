//! Charts for a mesh: cut, flattened without overlap, and packed into one rectangle by `uvunwrap`.

use std::collections::HashMap;

use glam::{UVec2, Vec2, Vec3};

use super::edges::{shared_edges, weld};
use super::flat::project;
use super::{PADDING, UvLayout, UvVertex};
use crate::scene::Mesh;

/// Shading normals that differ by more than this across an edge mark a hard edge: light may jump there, so charts end there.
const HARD_EDGE_COS: f32 = 0.866;
/// Triangles that lean further than this from their chart's mean normal start a new chart, degrees. Lower means less
/// stretching and more seams; above 70 the flattening fails often and is retried with smaller charts.
const MAX_CHART_ANGLE: f32 = 65.0;
/// The same where the whole mesh has fewer texels than triangles: nobody sees a seam there, and flat charts are quick.
const MAX_CHART_ANGLE_TINY: f32 = 40.0;
/// Texels a triangle below which charts of a mesh of [`MANY_TRIANGLES`] are projected, not unrolled.
const FEW_TEXELS: f64 = 0.125;
/// Fewer are unrolled in no time.
const MANY_TRIANGLES: usize = 8192;
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
    let tiny = triangles.len() >= MANY_TRIANGLES && texels < FEW_TEXELS * triangles.len() as f64;
    if let Some(flat) = tiny
        .then(|| project(mesh, positions, &triangles, &seams))
        .flatten()
    {
        return repack(mesh, positions, &flat, &[], density, limit);
    }
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
#[path = "unwrap_tests.rs"]
mod tests;

//! Makes both sides of a chart border agree: where a smooth surface is cut into charts, a renderer shows the step between them as a line.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::edges::{shared_edges, weld};
use super::{Atlas, UvLayout, sample};
use crate::scene::{Mesh, Scene};

/// Shading normals within this angle (10 degrees) across an edge make it smooth; a harder edge is meant to show.
const SMOOTH_COS: f32 = 0.985;
/// How much more the agreement of a seam counts than a texel's own value. A step shrinks to about 1 / (1 + this).
const AGREEMENT: f32 = 40.0;
/// Steps of the conjugate gradient method: the system is well conditioned (at most a few times [`AGREEMENT`]), and a fixed number gives
/// the same bits every time.
const STEPS: usize = 20;

/// Two lookups that should give the same value: the texels of each in a rectangle of a layout, and their weights.
#[derive(Clone, Copy, Debug)]
struct Sample {
    /// One side's four texels, then the other's: column, row, weight.
    taps: [(u16, u16, f32); 8],
    /// Texels of border that it stands for, at most 1.
    length: f32,
}

/// The seams of an atlas. They depend on the layouts alone, not on where objects are or how they are lit.
pub(crate) struct Seams {
    /// One list per distinct layout.
    layouts: Vec<Vec<Sample>>,
    /// Per object, its entry in `layouts`.
    objects: Vec<usize>,
}

impl Seams {
    /// Finds the chart borders inside smooth surfaces.
    pub fn new(scene: &Scene, atlas: &Atlas) -> Self {
        let mut known = BTreeMap::new();
        let mut distinct = Vec::new();
        let mut objects = Vec::with_capacity(atlas.objects.len());
        for (object, place) in scene.objects.iter().zip(&atlas.objects) {
            let next = distinct.len();
            let slot = *known
                .entry((Arc::as_ptr(&place.layout), object.mesh))
                .or_insert(next);
            if slot == next {
                distinct.push((&*scene.meshes[object.mesh as usize], &*place.layout));
            }
            objects.push(slot);
        }
        let layouts = distinct
            .into_par_iter()
            .map(|(mesh, layout)| samples(mesh, layout))
            .collect();
        Self { layouts, objects }
    }

    /// Changes texels along the seams, by as little as makes the sides agree. `owned` tells which texels hold a value; a
    /// lookup that needs any other is left out. Values stay at zero or above.
    pub fn apply(&self, atlas: &Atlas, pages: &mut [Vec<[f32; 3]>], owned: &[Vec<u8>]) {
        let size = atlas.page_size;
        let objects = || self.objects.par_iter().zip(&atlas.objects);
        let changes: Vec<Vec<(usize, Vec3)>> = {
            let pages = &*pages;
            objects()
                .map(|(&layout, place)| {
                    let page = place.page as usize;
                    let index = |x: u16, y: u16| {
                        let (x, y) = (u32::from(x) + place.origin.x, u32::from(y) + place.origin.y);
                        y as usize * size as usize + x as usize
                    };
                    solve(&self.layouts[layout], &pages[page], &owned[page], index)
                })
                .collect()
        };
        for (place, changes) in atlas.objects.iter().zip(changes) {
            let page = &mut pages[place.page as usize];
            for (texel, value) in changes {
                page[texel] = value.max(Vec3::ZERO).to_array();
            }
        }
    }
}

/// Pairs of lookups along every seam of a layout.
fn samples(mesh: &Mesh, layout: &UvLayout) -> Vec<Sample> {
    let welded = weld(&mesh.positions);
    let triangles: Vec<[u32; 3]> = mesh
        .triangles
        .iter()
        .map(|t| t.map(|v| welded[v as usize]))
        .collect();
    let uv = |t: u32, corner: usize| {
        layout.vertices[layout.triangles[t as usize][corner % 3] as usize].uv
    };
    let mut samples = Vec::new();
    for shared in shared_edges(&triangles) {
        let [t, u] = shared.triangles;
        let [e, f] = shared.edges.map(usize::from);
        // The edge runs from e to e + 1 in one triangle and back in the other.
        let (a, b) = ([uv(t, e), uv(t, e + 1)], [uv(u, f + 1), uv(u, f)]);
        if a == b || !smooth(mesh, [t, u], [(e, f + 1), (e + 1, f)]) {
            continue;
        }
        let length = a[0].distance(a[1]).max(b[0].distance(b[1]));
        // Twice a texel: the two sides have their centres at different places along the edge.
        let count = (2.0 * length).ceil().max(1.0);
        for k in 0..count as u32 {
            let s = (k as f32 + 0.5) / count;
            let (p, q) = (taps(a[0].lerp(a[1], s)), taps(b[0].lerp(b[1], s)));
            let mut both = [(0, 0, 0.0); 8];
            both[..4].copy_from_slice(&p);
            both[4..].copy_from_slice(&q.map(|(x, y, w)| (x, y, -w)));
            samples.push(Sample {
                taps: both,
                length: length / count,
            });
        }
    }
    samples
}

/// Whether the shading normals agree at both ends of an edge; `ends` pairs the corners of the two triangles that meet.
fn smooth(mesh: &Mesh, triangles: [u32; 2], ends: [(usize, usize); 2]) -> bool {
    let normal = |t: u32, corner: usize| {
        let corners = mesh.triangles[t as usize];
        let given = mesh.normals[corners[corner % 3] as usize];
        if given != Vec3::ZERO {
            return given;
        }
        let [a, b, c] = corners.map(|v| mesh.positions[v as usize]);
        (b - a).cross(c - a).normalize_or_zero()
    };
    ends.into_iter()
        .all(|(i, j)| normal(triangles[0], i).dot(normal(triangles[1], j)) >= SMOOTH_COS)
}

/// The texels of a bilinear lookup and their weights. Layouts keep clear of their rectangle's border.
fn taps(at: Vec2) -> [(u16, u16, f32); 4] {
    let size = 1 << 16;
    sample::taps(at, size).map(|(i, w)| ((i & (size as usize - 1)) as u16, (i >> 16) as u16, w))
}

/// Least squares: every texel wants to keep its value, every sample wants its two lookups equal. Returns the changed texels.
fn solve(
    samples: &[Sample],
    page: &[[f32; 3]],
    owned: &[u8],
    index: impl Fn(u16, u16) -> usize,
) -> Vec<(usize, Vec3)> {
    // Number the texels that take part.
    let mut texels: Vec<usize> = Vec::new();
    let mut rows: Vec<([usize; 8], [f32; 8])> = Vec::new();
    for sample in samples {
        let at = sample.taps.map(|(x, y, _)| index(x, y));
        let present = sample
            .taps
            .iter()
            .zip(at)
            .all(|(tap, i)| tap.2 == 0.0 || owned[i] != 0);
        if present && sample.length > 0.0 {
            // Rows are scaled by the root of their weight: the square of a row is what counts.
            let scale = (AGREEMENT * sample.length).sqrt();
            rows.push((at, sample.taps.map(|tap| tap.2 * scale)));
            texels.extend(at);
        }
    }
    texels.sort_unstable();
    texels.dedup();
    for (at, _) in &mut rows {
        for i in at {
            *i = texels.partition_point(|t| *t < *i);
        }
    }
    let across = |row: &([usize; 8], [f32; 8]), x: &[Vec3]| -> Vec3 {
        (0..8).map(|k| x[row.0[k]] * row.1[k]).sum()
    };
    let scatter = |row: &([usize; 8], [f32; 8]), value: Vec3, to: &mut [Vec3]| {
        for k in 0..8 {
            to[row.0[k]] += value * row.1[k];
        }
    };
    let start: Vec<Vec3> = texels.iter().map(|t| Vec3::from(page[*t])).collect();
    // Solve (1 + RᵀR) d = -RᵀR x for the change d, each colour by itself (Hestenes and Stiefel 1952).
    let mut residual = vec![Vec3::ZERO; texels.len()];
    for row in &rows {
        scatter(row, -across(row, &start), &mut residual);
    }
    let dot = |a: &[Vec3], b: &[Vec3]| -> Vec3 { a.iter().zip(b).map(|(a, b)| *a * *b).sum() };
    let divide = |a: Vec3, b: Vec3| Vec3::select(b.cmpgt(Vec3::ZERO), a / b, Vec3::ZERO);
    let mut change = vec![Vec3::ZERO; texels.len()];
    let mut direction = residual.clone();
    let mut square = dot(&residual, &residual);
    for _ in 0..STEPS {
        let mut image = direction.clone();
        for row in &rows {
            scatter(row, across(row, &direction), &mut image);
        }
        let step = divide(square, dot(&direction, &image));
        for i in 0..texels.len() {
            change[i] += direction[i] * step;
            residual[i] -= image[i] * step;
        }
        let next = dot(&residual, &residual);
        let turn = divide(next, square);
        for (d, r) in direction.iter_mut().zip(&residual) {
            *d = *r + *d * turn;
        }
        square = next;
    }
    let changed = texels
        .iter()
        .zip(start)
        .zip(change)
        .filter(|(_, c)| *c != Vec3::ZERO && c.is_finite());
    changed
        .map(|((texel, value), change)| (*texel, value + change))
        .collect()
}

//! Charts for surfaces whose triangles are far smaller than texels: projected along the way that they face, not unrolled. How a
//! chart stretches within a texel nobody sees, and unrolling a hundred thousand triangles takes seconds.

use std::collections::{BTreeMap, HashMap};

use glam::Vec3;

use super::edges::shared_edges;
use super::{UvLayout, UvVertex};
use crate::scene::Mesh;

/// The cosine between a triangle's normal and its chart's axis at least, where the chart grows.
const GROWN: f32 = 0.766;
/// The same where a chart is joined to a larger one: half its area is left there.
const JOINED: f32 = 0.5;
/// Triangles around the first one of a chart whose mean normal is the axis at first.
const PATCH: usize = 64;

const NONE: u32 = u32::MAX;

struct Surface {
    /// Zero where a triangle has no area.
    normals: Vec<Vec3>,
    areas: Vec<f32>,
    /// Across each edge, [`NONE`] where charts end anyhow.
    neighbours: Vec<[u32; 3]>,
}

/// Charts of a mesh, each vertex's coordinates in metres; none if one of them would lie over itself, as those of a spiral ramp do.
/// `triangles` index welded vertices; `seams`: edges that charts do not cross.
pub(super) fn project(
    mesh: &Mesh,
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    seams: &[[bool; 3]],
) -> Option<UvLayout> {
    let surface = Surface::new(positions, triangles, seams);
    let (mut charts, axes) = surface.grow();
    surface.join(&mut charts, &axes);
    if surface.overlaps(positions, triangles, &charts, &axes) {
        return None;
    }
    let mut layout = UvLayout::default();
    let mut split: HashMap<(u32, u32), u32> = HashMap::new();
    // Coordinates begin at a point of the chart, so that they have all their digits.
    let mut origins: BTreeMap<u32, Vec3> = BTreeMap::new();
    for ((corners, places), &chart) in mesh.triangles.iter().zip(triangles).zip(&charts) {
        let axis = axes[chart as usize];
        let (x, y) = axis.any_orthonormal_pair();
        let origin = *origins
            .entry(chart)
            .or_insert_with(|| positions[places[0] as usize]);
        layout.charts.push(chart);
        layout.triangles.push([0, 1, 2].map(|k| {
            *split.entry((corners[k], chart)).or_insert_with(|| {
                let at = positions[places[k] as usize] - origin;
                layout.vertices.push(UvVertex {
                    source: corners[k],
                    uv: [at.dot(x), at.dot(y)].into(),
                });
                layout.vertices.len() as u32 - 1
            })
        }));
    }
    Some(layout)
}

impl Surface {
    fn new(positions: &[Vec3], triangles: &[[u32; 3]], seams: &[[bool; 3]]) -> Self {
        let crosses = triangles.iter().map(|t| {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            (b - a).cross(c - a)
        });
        let crosses: Vec<Vec3> = crosses.collect();
        let mut neighbours = vec![[NONE; 3]; triangles.len()];
        for shared in shared_edges(triangles) {
            let [t, u] = shared.triangles;
            let [e, f] = shared.edges.map(usize::from);
            if !seams[t as usize][e] && !seams[u as usize][f] {
                neighbours[t as usize][e] = u;
                neighbours[u as usize][f] = t;
            }
        }
        Self {
            normals: crosses.iter().map(|c| c.normalize_or_zero()).collect(),
            areas: crosses.iter().map(|c| 0.5 * c.length()).collect(),
            neighbours,
        }
    }

    /// Makes triangles that are connected with the seed and face along the axis parts of a chart, the nearest first, at most so
    /// many or a few more. Returns them.
    fn patch(
        &self,
        seed: u32,
        most: usize,
        chart: u32,
        axis: Vec3,
        charts: &mut [u32],
    ) -> Vec<u32> {
        charts[seed as usize] = chart;
        let mut patch = vec![seed];
        let mut at = 0;
        while at < patch.len() && patch.len() < most {
            for next in self.neighbours[patch[at] as usize] {
                if next != NONE && charts[next as usize] == NONE && self.faces(next, axis, GROWN) {
                    charts[next as usize] = chart;
                    patch.push(next);
                }
            }
            at += 1;
        }
        patch
    }

    fn faces(&self, t: u32, axis: Vec3, cosine: f32) -> bool {
        let normal = self.normals[t as usize];
        normal == Vec3::ZERO || normal.dot(axis) >= cosine
    }

    /// The mean normal of some triangles, if the first one faces that way; else its own.
    fn axis(&self, triangles: &[u32]) -> Vec3 {
        let own = self.normals[triangles[0] as usize];
        let weighted = |t: &u32| self.normals[*t as usize] * self.areas[*t as usize];
        let mean = triangles.iter().map(weighted).sum::<Vec3>();
        let mean = mean.normalize_or(Vec3::Z);
        if own == Vec3::ZERO || own.dot(mean) >= GROWN {
            mean
        } else {
            own
        }
    }

    /// A chart for every triangle, and each chart's axis.
    fn grow(&self) -> (Vec<u32>, Vec<Vec3>) {
        let mut charts = vec![NONE; self.normals.len()];
        let mut axes = Vec::new();
        for seed in 0..charts.len() as u32 {
            if charts[seed as usize] != NONE {
                continue;
            }
            let chart = axes.len() as u32;
            let mut axis = self.normals[seed as usize];
            // What grows around the seed says where the chart should face; then it is grown again.
            for most in [PATCH, usize::MAX] {
                let patch = self.patch(seed, most, chart, axis, &mut charts);
                for &t in &patch {
                    charts[t as usize] = NONE;
                }
                axis = self.axis(&patch);
            }
            self.patch(seed, usize::MAX, chart, axis, &mut charts);
            axes.push(axis);
        }
        (charts, axes)
    }

    /// Whether a chart has parts above each other: what of it lies in a few triangles' width spans more height than a surface
    /// that faces within 60 degrees of the axis can.
    fn overlaps(
        &self,
        positions: &[Vec3],
        triangles: &[[u32; 3]],
        charts: &[u32],
        axes: &[Vec3],
    ) -> bool {
        let mut sums = vec![(0.0, 0.0f32); axes.len()];
        for (&chart, &area) in charts.iter().zip(&self.areas) {
            let sum = &mut sums[chart as usize];
            *sum = (sum.0 + area, sum.1 + 1.0);
        }
        // The steepest surface rises by 2.5 across a square.
        const STEEPEST: f32 = 3.0;
        let mut heights: HashMap<(u32, [i64; 2]), [f32; 2]> = HashMap::new();
        triangles.iter().zip(charts).any(|(t, &chart)| {
            let (area, count) = sums[chart as usize];
            let square = 2.0 * (area / count).sqrt();
            if square <= 0.0 {
                return false;
            }
            let axis = axes[chart as usize];
            let (x, y) = axis.any_orthonormal_pair();
            let middle = t.iter().map(|&v| positions[v as usize]).sum::<Vec3>() / 3.0;
            let at = [x, y].map(|side| (side.dot(middle) / square).floor() as i64);
            let height = axis.dot(middle);
            let span = heights.entry((chart, at)).or_insert([height; 2]);
            *span = [span[0].min(height), span[1].max(height)];
            span[1] - span[0] > STEEPEST * square
        })
    }

    /// Gives charts, the smallest first, to larger ones beside them that face about the same way.
    fn join(&self, charts: &mut [u32], axes: &[Vec3]) {
        let mut members: Vec<Vec<u32>> = vec![Vec::new(); axes.len()];
        let mut areas = vec![0.0f64; axes.len()];
        for (t, &chart) in (0..).zip(charts.iter()) {
            members[chart as usize].push(t);
            areas[chart as usize] += f64::from(self.areas[t as usize]);
        }
        let mut order: Vec<usize> = (0..axes.len()).collect();
        order.sort_by(|&a, &b| areas[a].total_cmp(&areas[b]));
        for chart in order {
            // How many edges each of the charts beside it shares with it.
            let mut beside: BTreeMap<u32, u32> = BTreeMap::new();
            let edges = members[chart]
                .iter()
                .flat_map(|t| self.neighbours[*t as usize]);
            for next in edges.filter(|next| *next != NONE) {
                *beside.entry(charts[next as usize]).or_default() += 1;
            }
            let fits = |other: &u32| {
                let axis = axes[*other as usize];
                let larger = areas[*other as usize] >= areas[chart];
                let mut all = members[chart].iter();
                *other as usize != chart && larger && all.all(|t| self.faces(*t, axis, JOINED))
            };
            let beside = beside.into_iter().filter(|(other, _)| fits(other));
            let Some((other, _)) = beside.max_by_key(|(other, edges)| (*edges, NONE - other))
            else {
                continue;
            };
            let moved = std::mem::take(&mut members[chart]);
            for &t in &moved {
                charts[t as usize] = other;
            }
            members[other as usize].extend(moved);
            areas[other as usize] += std::mem::take(&mut areas[chart]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lightmap::edges::weld;

    /// A bumpy ball of quads cut in two, and every triangle's welded corners.
    fn ball(rings: u32) -> (Mesh, Vec<[u32; 3]>) {
        let mut mesh = Mesh::default();
        let around = 2 * rings;
        for i in 0..=rings {
            for j in 0..=around {
                let (t, p) = (
                    std::f32::consts::PI * i as f32 / rings as f32,
                    std::f32::consts::TAU * (j % around) as f32 / around as f32,
                );
                let direction = Vec3::new(t.sin() * p.cos(), t.cos(), t.sin() * p.sin());
                let radius = 1.0 + 0.05 * (7.0 * t).sin() * (9.0 * p).cos();
                mesh.positions.push(direction * radius);
                mesh.normals.push(direction);
            }
        }
        for i in 0..rings {
            for j in 0..around {
                let [a, b] = [i, i + 1].map(|i| i * (around + 1) + j);
                mesh.triangles.extend([[a, a + 1, b], [a + 1, b + 1, b]]);
            }
        }
        let welded = weld(&mesh.positions);
        let triangles = mesh.triangles.iter();
        let triangles = triangles.map(|t| t.map(|v| welded[v as usize])).collect();
        (mesh, triangles)
    }

    #[test]
    fn charts_are_few_lie_open_and_end_at_seams() {
        let (mesh, triangles) = ball(60);
        let equator = |t: usize| t / 240 == 30;
        // The upper edges of the ring below the equator.
        let mut seams = vec![[false; 3]; triangles.len()];
        for t in (0..triangles.len()).filter(|t| equator(*t) && t % 2 == 0) {
            seams[t][0] = true;
        }
        let layout = project(&mesh, &mesh.positions, &triangles, &seams).expect("open charts");
        assert_eq!(layout.triangles.len(), triangles.len());
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| layout.vertices[v as usize].uv);
            0.5 * (b - a).perp_dot(c - a)
        };
        let mut sums: BTreeMap<u32, [f32; 2]> = BTreeMap::new();
        for ((t, chart), corners) in layout.triangles.iter().zip(&layout.charts).zip(&triangles) {
            let [a, b, c] = corners.map(|v| mesh.positions[v as usize]);
            let own = 0.5 * (b - a).cross(c - a).length();
            let sum = sums.entry(*chart).or_default();
            *sum = [sum[0] + area(t), sum[1] + own];
            // None is turned over, and none is squeezed to less than half (or what rounding leaves of it).
            assert!(
                own == 0.0 || area(t).abs() > 0.49 * own,
                "{} of {own}",
                area(t)
            );
        }
        // Triangles without area belong to nobody.
        sums.retain(|_, [_, curved]| *curved > 0.0);
        for [flat, curved] in sums.values() {
            assert!(
                flat.abs() > 0.49 * curved,
                "{flat} of {curved}: all turned alike"
            );
        }
        assert!((4..60).contains(&sums.len()), "{} charts", sums.len());
        for t in (0..triangles.len()).filter(|t| equator(*t) && t % 2 == 0) {
            // Its neighbour beyond the seam is of another chart.
            assert_ne!(layout.charts[t], layout.charts[t - 239], "{t}");
        }
    }

    #[test]
    fn a_ramp_that_winds_over_itself_is_not_projected() {
        let ramp = |turns: u32| {
            let steps = 200 * turns;
            let mut mesh = Mesh::default();
            for i in 0..=steps {
                let (sine, cosine) = (std::f32::consts::TAU * i as f32 / 200.0).sin_cos();
                let across = (0..=6).map(|j| 1.0 + j as f32 / 6.0);
                let height = 0.8 * i as f32 / 200.0;
                mesh.positions
                    .extend(across.map(|r| Vec3::new(r * cosine, height, -r * sine)));
            }
            for (i, j) in (0..steps).flat_map(|i| (0..6).map(move |j| (i, j))) {
                let [a, b] = [i, i + 1].map(|i| i * 7 + j);
                mesh.triangles.extend([[a, a + 1, b], [a + 1, b + 1, b]]);
            }
            mesh
        };
        let charts = |mesh: &Mesh| {
            let seams = vec![[false; 3]; mesh.triangles.len()];
            let layout = project(mesh, &mesh.positions, &mesh.triangles, &seams);
            layout.map(|l| l.charts.iter().copied().max().unwrap_or(0) + 1)
        };
        // A chart of its own up to the first whole turn.
        let mut open = ramp(1);
        open.triangles.truncate(open.triangles.len() * 9 / 10);
        assert_eq!(charts(&open), Some(1));
        assert_eq!(charts(&ramp(3)), None);
    }
}

//! Simplified occluders for views whose pixels are larger: vertices that share a cell of a grid become one (Rossignac and Borrel
//! 1993), where their triangles' planes meet (Lindstrom 2000), and triangles that lose their area that way are left out.
//!
//! Grids are the world's, so that what lies in two groups of triangles is moved alike and no gap opens between them. What a group
//! becomes is a function of its object alone.

use std::collections::{HashMap, HashSet};

use glam::{DMat3, DVec3, IVec3, Vec3};

use crate::bake::device::shared::CHUNK;

/// Triangles in world space.
pub(super) type Corners = [Vec3; 3];

/// What a group of triangles becomes on a grid.
pub(super) struct Level {
    /// Edge of the grid's cells, metres: no vertex moves further than twice that.
    pub cell: f32,
    pub triangles: Vec<Corners>,
}

/// A level has at most this share of the triangles of the one before, or it is not worth having.
const FEWER: f64 = 0.6;
/// It keeps at least this share of the area: what falls to pieces (leaves, wires) would let light pass.
const AREA: f64 = 0.93;
/// Grids that are tried.
const GRIDS: usize = 10;
/// How much a vertex is drawn to the middle of those that it stands for, against the planes of their triangles.
const MIDDLE: f64 = 1e-3;

/// The sum of the squared distances from planes, and the points of a cell.
#[derive(Clone, Copy, Default)]
struct Cell {
    at: IVec3,
    sum: DVec3,
    count: f64,
    planes: DMat3Sum,
    along: DVec3,
}

#[derive(Clone, Copy)]
struct DMat3Sum(DMat3);

impl Default for DMat3Sum {
    fn default() -> Self {
        Self(DMat3::ZERO)
    }
}

impl Cell {
    fn add(&mut self, other: &Self) {
        self.sum += other.sum;
        self.count += other.count;
        self.planes.0 += other.planes.0;
        self.along += other.along;
    }

    /// Where its planes meet, or nearly, no further than a cell's edge from the middle of its points.
    fn point(&self, edge: f64) -> Vec3 {
        let middle = self.sum / self.count.max(1.0);
        let trace = self.planes.0.x_axis.x + self.planes.0.y_axis.y + self.planes.0.z_axis.z;
        let drawn = self.planes.0 + DMat3::from_diagonal(DVec3::splat(MIDDLE * trace));
        let way = drawn.inverse() * (self.along - self.planes.0 * middle);
        let near = way.is_finite() && trace > 0.0;
        let way = if near {
            way.clamp_length_max(edge)
        } else {
            DVec3::ZERO
        };
        (middle + way).as_vec3()
    }
}

/// The levels of every group of `size` triangles, finest first; at most `most` each.
pub(super) fn levels(triangles: &[Corners], size: usize, most: usize) -> Vec<Vec<Level>> {
    let groups = triangles.len().div_ceil(size);
    let mut out: Vec<Vec<Level>> = (0..groups).map(|_| Vec::new()).collect();
    if triangles.len() <= CHUNK as usize {
        return out;
    }
    let area = |[a, b, c]: &Corners| 0.5 * f64::from((b - a).cross(c - a).length());
    let edges = triangles
        .iter()
        .map(|[a, b, c]| a.distance(*b) + b.distance(*c));
    let mean = edges.sum::<f32>() / (2 * triangles.len()) as f32;
    if !(mean > 1e-6 && mean < 1e6) {
        return out;
    }
    // Nothing leaves the object's box, by which is told what an edit of it can make a difference to.
    let vertices = || triangles.iter().flatten().copied();
    let low = vertices().fold(Vec3::INFINITY, Vec3::min);
    let high = vertices().fold(Vec3::NEG_INFINITY, Vec3::max);
    let mut edge = f64::from(mean).log2().floor().exp2();
    let (mut cells, mut cell_of) = first_cells(triangles, edge);
    let full: Vec<f64> = triangles
        .chunks(size)
        .map(|g| g.iter().map(area).sum())
        .collect();
    // Triangles of the last level of each group, and whether more are to be had.
    let mut last: Vec<usize> = triangles.chunks(size).map(<[Corners]>::len).collect();
    let mut open: Vec<bool> = last.iter().map(|n| *n > CHUNK as usize).collect();
    for grid in 0..GRIDS {
        if grid > 0 {
            edge *= 2.0;
            coarser(&mut cells, &mut cell_of);
        }
        if !open.contains(&true) {
            break;
        }
        let inside = |c: &Cell| c.point(edge).clamp(low, high);
        let points: Vec<Vec3> = cells.iter().map(inside).collect();
        for (group, corners) in cell_of.chunks(3 * size).enumerate() {
            if !open[group] {
                continue;
            }
            let mut met = HashSet::new();
            let whole = |t: &&[u32]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
            let left: Vec<Corners> = corners
                .chunks_exact(3)
                .filter(whole)
                .filter(|t| {
                    let mut key = [t[0], t[1], t[2]];
                    key.sort_unstable();
                    met.insert(key)
                })
                .map(|t| [t[0], t[1], t[2]].map(|c| points[c as usize]))
                .filter(|t| area(t) > 0.0)
                .collect();
            let kept = left.iter().map(area).sum::<f64>();
            if kept < AREA * full[group] {
                open[group] = false;
            } else if left.len() as f64 <= FEWER * last[group] as f64 {
                last[group] = left.len();
                let level = Level {
                    cell: edge as f32,
                    triangles: left,
                };
                out[group].push(level);
                open[group] = out[group].len() < most && last[group] > CHUNK as usize / 4;
            }
        }
    }
    out
}

/// The cells of the finest grid, and that of each corner.
fn first_cells(triangles: &[Corners], edge: f64) -> (Vec<Cell>, Vec<u32>) {
    let mut vertices: HashMap<[u32; 3], u32> = HashMap::new();
    let mut numbers: HashMap<IVec3, u32> = HashMap::new();
    let mut cells: Vec<Cell> = Vec::new();
    let mut cell_of = Vec::with_capacity(3 * triangles.len());
    for triangle in triangles {
        let [a, b, c] = triangle.map(Vec3::as_dvec3);
        let normal = (b - a).cross(c - a);
        let weight = normal.length();
        let unit = normal / weight.max(1e-300);
        for at in triangle {
            let own = at.as_dvec3();
            let cell = *vertices
                .entry(at.to_array().map(f32::to_bits))
                .or_insert_with(|| {
                    let key = (own / edge).floor().as_ivec3();
                    let cell = *numbers.entry(key).or_insert_with(|| {
                        cells.push(Cell {
                            at: key,
                            ..Cell::default()
                        });
                        cells.len() as u32 - 1
                    });
                    cells[cell as usize].sum += own;
                    cells[cell as usize].count += 1.0;
                    cell
                });
            let to = &mut cells[cell as usize];
            to.planes.0 += DMat3::from_cols(unit * unit.x, unit * unit.y, unit * unit.z) * weight;
            to.along += unit * (unit.dot(own) * weight);
            cell_of.push(cell);
        }
    }
    (cells, cell_of)
}

/// Goes to the grid of twice the edge.
fn coarser(cells: &mut Vec<Cell>, cell_of: &mut [u32]) {
    let mut numbers: HashMap<IVec3, u32> = HashMap::new();
    let mut larger: Vec<Cell> = Vec::new();
    let parents: Vec<u32> = cells
        .iter()
        .map(|cell| {
            let at = cell.at >> 1;
            let parent = *numbers.entry(at).or_insert_with(|| {
                larger.push(Cell {
                    at,
                    ..Cell::default()
                });
                larger.len() as u32 - 1
            });
            larger[parent as usize].add(cell);
            parent
        })
        .collect();
    cell_of.iter_mut().for_each(|c| *c = parents[*c as usize]);
    *cells = larger;
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A sphere of radius 1 about a point, of 2 `rings` squared triangles.
    fn sphere(center: Vec3, rings: usize) -> Vec<Corners> {
        let at = |i: usize, j: usize| {
            let (theta, phi) = (
                std::f32::consts::PI * i as f32 / rings as f32,
                std::f32::consts::TAU * (j % rings) as f32 / rings as f32,
            );
            let (sine, cosine) = theta.sin_cos();
            center + Vec3::new(sine * phi.cos(), sine * phi.sin(), cosine)
        };
        let squares = (0..rings).flat_map(|i| (0..rings).map(move |j| (i, j)));
        squares
            .flat_map(|(i, j)| {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        /// What stands for a sphere is smaller from grid to grid, lies where the sphere lies, and has no holes.
        #[test]
        fn fewer_triangles_stand_for_a_sphere(center in prop::array::uniform3(-9f32..9.0)) {
            let center = Vec3::from(center);
            let triangles = sphere(center, 60);
            let levels = levels(&triangles, triangles.len(), 3);
            prop_assert_eq!(levels.len(), 1);
            prop_assert!(levels[0].len() >= 2);
            let mut before = triangles.len();
            for level in &levels[0] {
                prop_assert!(10 * level.triangles.len() <= 6 * before);
                before = level.triangles.len();
                for vertex in level.triangles.iter().flatten() {
                    let off = (vertex.distance(center) - 1.0).abs();
                    prop_assert!(off <= 2.0 * level.cell, "{off} of {}", level.cell);
                }
                // Rays from the middle meet something, at the end of the way out.
                for ray in sphere(Vec3::ZERO, 12).iter().map(|[a, b, c]| (a + b * 1.1 + c * 1.3).normalize_or(Vec3::Z)) {
                    let far = level.triangles.iter().filter_map(|[a, b, c]| {
                        // Where in the triangle, as shares of its corners: no ray along its plane meets it far away.
                        let corners = [a, b, c].map(|v| v - center);
                        let [a, b, c] = corners;
                        let side = |p: Vec3, q: Vec3| p.cross(q).dot(ray);
                        let sides = [side(b, c), side(c, a), side(a, b)];
                        let shares = sides.map(|s| s / sides.iter().sum::<f32>());
                        let along: f32 = (0..3).map(|i| shares[i] * corners[i].dot(ray)).sum();
                        (shares.iter().all(|s| *s >= -1e-3) && along > 0.0).then_some(along)
                    });
                    let far = far.fold(0.0, f32::max);
                    prop_assert!((far - 1.0).abs() <= 2.0 * level.cell, "{far} of {}", level.cell);
                }
            }
        }
    }

    /// A flat sheet keeps its plane and its corners: nothing comes nearer, and little of it is lost.
    #[test]
    fn a_flat_sheet_stays_in_its_plane() {
        let tilt = glam::Quat::from_rotation_x(0.6);
        let at = |i: usize, j: usize| tilt * Vec3::new(i as f32 * 0.05, j as f32 * 0.05, 0.0);
        let squares = (0..40).flat_map(|i| (0..40).map(move |j| (i, j)));
        let triangles: Vec<Corners> = squares
            .flat_map(|(i, j)| {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect();
        let levels = levels(&triangles, 2048, 3);
        let coarser: Vec<&Level> = levels.iter().flatten().collect();
        assert!(!coarser.is_empty());
        for vertex in coarser.iter().flat_map(|l| &l.triangles).flatten() {
            assert!((tilt.inverse() * *vertex).z.abs() < 1e-4, "{vertex}");
        }
    }

    /// Leaves, each by itself and smaller than a cell, would be gone: nothing stands for them.
    #[test]
    fn what_would_fall_to_pieces_is_kept() {
        let leaf = |i: usize| {
            let at = Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0);
            [at, at + Vec3::X * 0.1, at + Vec3::Y * 0.1]
        };
        let leaves: Vec<Corners> = (0..400).map(leaf).collect();
        assert!(levels(&leaves, 2048, 3).iter().all(Vec::is_empty));
    }
}

//! Similarity clustering of a cell's VPLs (IBGI section 4.1): planes become polygon lights, the rest disk lights by direction.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};

use super::border::Border;
use super::cell::Cell;
use super::polygon::{Plane, Region, vertices};
use super::sums::FluxScale;
use super::{Shape, VirtualLight};
use crate::transport::Vpl;
use crate::transport::intersect::offset;

/// How VPLs are grouped into virtual lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimilaritySettings {
    /// Most lights a cell (K).
    pub lights_per_cell: usize,
    /// Fewest VPLs of a polygon (p_min).
    pub min_points: usize,
    /// Tolerance of a plane's normal, radians (sigma_n).
    pub normal_tolerance: f32,
    /// Tolerance of a plane's offset in cell sizes (sigma_d).
    pub offset_tolerance: f32,
}

impl Default for SimilaritySettings {
    fn default() -> Self {
        Self {
            lights_per_cell: 4,
            min_points: 10,
            normal_tolerance: 1f32.to_radians(),
            offset_tolerance: 0.01,
        }
    }
}

/// Planes tried before a VPL that fits none is left to the disks; bounds the time on curved surfaces.
const MAX_PLANES: usize = 128;

/// A cell's VPLs, told apart.
#[derive(Clone, Debug)]
pub struct Groups {
    /// The cell.
    pub cell: Cell,
    /// All its VPLs, in key order.
    pub vpls: Vec<Vpl>,
    /// Planes that become polygons, the one with the most VPLs first.
    pub planes: Vec<PlaneGroup>,
    /// Indices of the VPLs that belong to none.
    pub rest: Vec<u32>,
}

/// VPLs on one plane.
#[derive(Clone, Debug)]
pub struct PlaneGroup {
    /// Through the first VPL, with its normal.
    pub plane: Plane,
    /// Indices into [`Groups::vpls`].
    pub members: Vec<u32>,
}

impl PlaneGroup {
    /// Whether a VPL lies on the plane, within the tolerances of a cell of the given size.
    pub fn fits(&self, vpl: &Vpl, size: f32, settings: &SimilaritySettings) -> bool {
        // Distance in IBGI's 4D space: the normal, and the offset along it scaled to the same tolerance.
        let tolerance = settings.normal_tolerance.sin();
        let offset =
            self.plane.height(vpl.position) * tolerance / (settings.offset_tolerance * size);
        (vpl.normal - self.plane.normal).length_squared() + offset * offset <= tolerance * tolerance
    }
}

impl Groups {
    /// Greedy growth of planes around the first VPL, in key order, that fits no earlier one.
    pub fn new(cell: Cell, vpls: Vec<Vpl>, settings: &SimilaritySettings) -> Self {
        let mut planes: Vec<PlaneGroup> = Vec::new();
        let mut rest: Vec<u32> = Vec::new();
        for (i, vpl) in vpls.iter().enumerate() {
            let known = planes.len();
            match planes
                .iter_mut()
                .find(|p| p.fits(vpl, cell.size(), settings))
            {
                Some(plane) => plane.members.push(i as u32),
                None if known < MAX_PLANES => planes.push(PlaneGroup {
                    plane: Plane::new(vpl.position, vpl.normal),
                    members: vec![i as u32],
                }),
                None => rest.push(i as u32),
            }
        }
        // Stable: planes of equal size stay in the order of their first VPLs.
        planes.sort_by_key(|p| std::cmp::Reverse(p.members.len()));
        let supported = planes
            .iter()
            .take_while(|p| p.members.len() >= settings.min_points)
            .count();
        let all =
            supported == planes.len() && rest.is_empty() && supported <= settings.lights_per_cell;
        let kept = if all {
            supported
        } else {
            supported.min(settings.lights_per_cell.saturating_sub(1))
        };
        rest.extend(planes.drain(kept..).flat_map(|p| p.members));
        rest.sort_unstable();
        Self {
            cell,
            vpls,
            planes,
            rest,
        }
    }

    /// The virtual lights, which carry all of the flux of the VPLs, but for those that crossed the border: exactly so in fixed
    /// point, then rounded to `f32`.
    pub fn lights(
        &self,
        border: &Border,
        scale: &FluxScale,
        settings: &SimilaritySettings,
    ) -> Vec<VirtualLight> {
        let mut lights = Vec::with_capacity(settings.lights_per_cell);
        let left = border.left();
        let mut rest: Vec<&Vpl> = self
            .rest
            .iter()
            .filter(|i| left.binary_search(i).is_err())
            .map(|&i| &self.vpls[i as usize])
            .collect();
        for (plane, group) in self.planes.iter().enumerate() {
            let joined: Vec<&Vpl> = border.joined(plane).collect();
            let members: Vec<&Vpl> = group
                .members
                .iter()
                .map(|&i| &self.vpls[i as usize])
                .chain(joined.iter().copied())
                .collect();
            match self.polygon(group, &members, &joined, scale) {
                Some(light) => lights.push(light),
                None => rest.extend(members),
            }
        }
        // Disks in proportion to what is left: a few stray VPLs do not deserve the lights of a whole cell.
        let all: f32 = self.vpls.iter().map(|v| v.weight).sum();
        let left: f32 = rest.iter().map(|v| v.weight).sum();
        let share = (settings.lights_per_cell as f32 * left / all).ceil() as usize;
        let k = settings
            .lights_per_cell
            .saturating_sub(lights.len())
            .min(share)
            .max(1);
        let directions: Vec<(Vec3, f32)> = rest.iter().map(|v| (v.normal, v.weight)).collect();
        lights.extend(by_direction(&directions, k).iter().map(|group| {
            let group: Vec<&Vpl> = group.iter().map(|&i| rest[i]).collect();
            self.disk(&group, scale)
        }));
        lights
    }

    fn polygon(
        &self,
        group: &PlaneGroup,
        members: &[&Vpl],
        joined: &[&Vpl],
        scale: &FluxScale,
    ) -> Option<VirtualLight> {
        let points: Vec<Vec2> = members
            .iter()
            .map(|v| group.plane.project(v.position))
            .collect();
        let [lo, hi] = self.cell.bounds();
        // VPLs that joined from a neighbour stretch the cell.
        let lo = joined.iter().fold(lo, |b, v| b.min(v.position));
        let hi = joined.iter().fold(hi, |b, v| b.max(v.position));
        let region = Region::of(&points, group.plane.section(lo, hi))?;
        let center = group.plane.lift(region.middle);
        let distance = |v: &Vpl| v.position.distance_squared(center);
        let nearest = members.iter().copied().reduce(|best, v| {
            if distance(v) < distance(best) {
                v
            } else {
                best
            }
        })?;
        let vertices = vertices(&group.plane, region.outline)?;
        Some(VirtualLight {
            shape: Shape::Polygon { vertices },
            position: offset(nearest.position, nearest.normal),
            normal: group.plane.normal,
            surface: nearest.normal,
            flux: flux(members, scale),
            direct: false,
        })
    }

    /// A disk at the VPL nearest to the centre of their weights, so that it lies on a surface.
    fn disk(&self, group: &[&Vpl], scale: &FluxScale) -> VirtualLight {
        let total: f32 = group.iter().map(|v| v.weight).sum();
        let average = |of: &dyn Fn(&Vpl) -> Vec3| {
            group.iter().map(|v| of(v) * v.weight).sum::<Vec3>() / total
        };
        let center = average(&|v| v.position - group[0].position) + group[0].position;
        let distance = |v: &Vpl| v.position.distance_squared(center);
        let nearest = group.iter().fold(group[0], |best, v| {
            if distance(v) < distance(best) {
                v
            } else {
                best
            }
        });
        let normal = average(&|v| v.normal)
            .try_normalize()
            .unwrap_or(nearest.normal);
        let plane = Plane::new(center, normal);
        // A disk of area A has a mean square distance of A / 2 pi; a square cell's section, with the weight of one VPL,
        // stands in where there are few.
        let square: f32 = group
            .iter()
            .map(|v| plane.project(v.position).length_squared())
            .sum();
        let size = self.cell.size();
        let mean_square = (square + size * size / 6.0) / group.len() as f32;
        VirtualLight {
            shape: Shape::Disk {
                area: (TAU * mean_square).min(2.0 * size * size),
            },
            position: offset(nearest.position, nearest.normal),
            normal,
            surface: nearest.normal,
            flux: flux(group, scale),
            direct: false,
        }
    }
}

fn flux(vpls: &[&Vpl], scale: &FluxScale) -> Vec3 {
    let units = vpls.iter().fold([0i64; 3], |sum, v| {
        let u = scale.units(v.flux);
        std::array::from_fn(|c| sum[c] + u[c])
    });
    scale.lumens(units)
}

/// Spherical k-means over unit normals with weights, started from normals far apart: groups of indices, at most `k` of
/// them, none empty, that hold every item once.
pub fn by_direction(items: &[(Vec3, f32)], k: usize) -> Vec<Vec<usize>> {
    let Some(first) = items.first() else {
        return Vec::new();
    };
    let mut centers = vec![first.0];
    while centers.len() < k {
        let closeness = |n: Vec3| centers.iter().map(|c| c.dot(n)).fold(f32::MIN, f32::max);
        let Some(farthest) = items
            .iter()
            .min_by(|a, b| closeness(a.0).total_cmp(&closeness(b.0)))
        else {
            break;
        };
        // Within 8 degrees of a centre, one more would not tell anything apart.
        if closeness(farthest.0) > 0.99 {
            break;
        }
        centers.push(farthest.0);
    }
    let nearest = |centers: &[Vec3], n: Vec3| {
        (0..centers.len())
            .max_by(|&a, &b| {
                centers[a]
                    .dot(n)
                    .total_cmp(&centers[b].dot(n))
                    .then(b.cmp(&a))
            })
            .unwrap_or(0)
    };
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for _ in 0..8 {
        groups = vec![Vec::new(); centers.len()];
        for (i, item) in items.iter().enumerate() {
            groups[nearest(&centers, item.0)].push(i);
        }
        let middle = |g: &[usize]| {
            g.iter()
                .map(|&i| items[i].0 * items[i].1)
                .sum::<Vec3>()
                .try_normalize()
        };
        let moved: Vec<Vec3> = groups
            .iter()
            .zip(&centers)
            .map(|(g, &c)| middle(g).unwrap_or(c))
            .collect();
        if moved == centers {
            break;
        }
        centers = moved;
    }
    groups.retain(|g| !g.is_empty());
    groups
}

#[cfg(test)]
mod tests;

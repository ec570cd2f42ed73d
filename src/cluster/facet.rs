//! Convex planar parts of apertures: merged from emissive triangles, halved, and turned into virtual lights.

use std::collections::BTreeMap;
use std::f32::consts::PI;

use arrayvec::ArrayVec;
use glam::{Vec2, Vec3};

use super::polygon::{MAX_VERTICES, Plane, area, centroid, clip, simplify_outwards, vertices};
use super::similarity::by_direction;
use super::{Shape, VirtualLight};
use crate::transport::emission::{convex_hull, mean};
use crate::transport::intersect::offset;
use crate::transport::surface::Piece;

/// One side of a convex planar part of an aperture, with constant radiance.
#[derive(Clone, Debug, PartialEq)]
pub struct Facet {
    /// World space, counter-clockwise around the normal.
    pub vertices: ArrayVec<Vec3, MAX_VERTICES>,
    /// Unit length.
    pub normal: Vec3,
    /// cd/m².
    pub radiance: Vec3,
}

impl Facet {
    fn plane(&self) -> Plane {
        Plane::new(self.vertices[0], self.normal)
    }

    fn outline(&self) -> Vec<Vec2> {
        let plane = self.plane();
        self.vertices.iter().map(|&v| plane.project(v)).collect()
    }

    fn area(&self) -> f32 {
        area(&self.outline())
    }

    pub(super) fn center(&self) -> Vec3 {
        self.plane().lift(centroid(&self.outline()))
    }

    /// Lumens.
    fn flux(&self) -> Vec3 {
        self.radiance * (PI * self.area())
    }

    /// Halves at the middle of the longer of the extents along and across the longest edge; the plane of the cut is the second
    /// result: points with `p . normal <= offset` are in the first half.
    pub(super) fn halves(&self) -> Option<([Facet; 2], (Vec3, f32))> {
        let n = self.vertices.len();
        let edges = (0..n).map(|i| self.vertices[(i + 1) % n] - self.vertices[i]);
        let along = edges
            .fold(Vec3::ZERO, |a, b| {
                if b.length_squared() > a.length_squared() {
                    b
                } else {
                    a
                }
            })
            .try_normalize()?;
        let (lo, hi, axis) = [along, self.normal.cross(along)]
            .map(|axis| {
                let heights = self.vertices.iter().map(|v| v.dot(axis));
                (
                    heights.clone().fold(f32::MAX, f32::min),
                    heights.fold(f32::MIN, f32::max),
                    axis,
                )
            })
            .into_iter()
            .reduce(|a, b| if b.1 - b.0 > a.1 - a.0 { b } else { a })?;
        let middle = (lo + hi) * 0.5;
        let plane = self.plane();
        let direction = plane.project(plane.origin + axis);
        let level = middle - plane.origin.dot(axis);
        let part = |sign: f32| {
            let outline = clip(&self.outline(), direction * sign, level * sign);
            (outline.len() <= MAX_VERTICES).then_some(())?;
            Some(Facet {
                vertices: vertices(&plane, outline)?,
                ..*self
            })
        };
        Some(([part(1.0)?, part(-1.0)?], (axis, middle)))
    }
}

/// The longest side of the box around points, metres; never 0.
pub(super) fn extent<'a>(points: impl Iterator<Item = &'a Vec3> + Clone) -> f64 {
    let lo = points.clone().fold(Vec3::INFINITY, |a, &b| a.min(b));
    let hi = points.fold(Vec3::NEG_INFINITY, |a, &b| a.max(b));
    f64::from((hi - lo).max_element().max(f32::MIN_POSITIVE))
}

/// Joins coplanar neighbours of equal radiance to convex facets of at most eight vertices; also returns each piece's facet.
pub(super) fn merge(pieces: &[Piece]) -> (Vec<Facet>, Vec<u32>) {
    let mut loops: Vec<Option<Vec<Vec3>>> = pieces
        .iter()
        .map(|p| {
            let [a, b, c] = p.corners;
            Some(if (b - a).cross(c - a).dot(p.normal) > 0.0 {
                vec![a, b, c]
            } else {
                vec![a, c, b]
            })
        })
        .collect();
    let mut owner: Vec<u32> = (0..pieces.len() as u32).collect();
    let id = |v: Vec3| v.to_array().map(f32::to_bits);
    let mut edges = BTreeMap::new();
    for (i, outline) in loops.iter().enumerate() {
        for (a, b) in sides(outline.as_deref().unwrap_or_default()) {
            edges.insert((id(a), id(b)), i);
        }
    }
    for i in 0..pieces.len() {
        while let Some(outline) = loops[i].clone() {
            let joined = sides(&outline).find_map(|(a, b)| {
                let &other = edges.get(&(id(b), id(a)))?;
                let same = other != i
                    && pieces[i].radiance == pieces[other].radiance
                    && pieces[i].double_sided == pieces[other].double_sided
                    && pieces[i].normal.dot(pieces[other].normal) > 0.999_999;
                let merged = same.then(|| {
                    splice(&outline, loops[other].as_deref()?, (a, b), pieces[i].normal)
                })??;
                Some((other, merged))
            });
            let Some((other, merged)) = joined else { break };
            for (a, b) in sides(loops[other].as_deref().unwrap_or_default()) {
                edges.remove(&(id(a), id(b)));
            }
            for (a, b) in sides(&outline) {
                edges.remove(&(id(a), id(b)));
            }
            for (a, b) in sides(&merged) {
                edges.insert((id(a), id(b)), i);
            }
            owner[other] = i as u32;
            loops[i] = Some(merged);
            loops[other] = None;
        }
    }
    let mut facets = Vec::new();
    let mut place = vec![0; pieces.len()];
    for (i, outline) in loops.into_iter().enumerate() {
        if let Some(outline) = outline {
            place[i] = facets.len() as u32;
            facets.push(Facet {
                vertices: outline.into_iter().collect(),
                normal: pieces[i].normal,
                radiance: pieces[i].radiance,
            });
        }
    }
    let owner_of = |mut piece: usize| {
        while owner[piece] as usize != piece {
            piece = owner[piece] as usize;
        }
        place[piece]
    };
    let of_piece = (0..pieces.len()).map(owner_of).collect();
    (facets, of_piece)
}

fn sides(outline: &[Vec3]) -> impl Iterator<Item = (Vec3, Vec3)> {
    (0..outline.len()).map(|i| (outline[i], outline[(i + 1) % outline.len()]))
}

/// Two outlines joined along an edge of the first, if that is convex and small enough.
fn splice(first: &[Vec3], second: &[Vec3], edge: (Vec3, Vec3), normal: Vec3) -> Option<Vec<Vec3>> {
    let (n, m) = (first.len(), second.len());
    let i = (0..n).find(|&i| first[i] == edge.0 && first[(i + 1) % n] == edge.1)?;
    let j = (0..m).find(|&j| second[j] == edge.1 && second[(j + 1) % m] == edge.0)?;
    // From the edge's end around the first outline to its start, then around the second, whose ends are the same two.
    let around = (1..=n).map(|k| first[(i + k) % n]);
    let mut outline: Vec<Vec3> = around.chain((2..m).map(|k| second[(j + k) % m])).collect();
    loop {
        let count = outline.len();
        let turn = |k: usize| {
            let (u, v) = (
                outline[k] - outline[(k + count - 1) % count],
                outline[(k + 1) % count] - outline[k],
            );
            u.cross(v).dot(normal) / (u.length() * v.length()).max(f32::MIN_POSITIVE)
        };
        if (0..count).any(|k| turn(k) < -1e-5)
            || outline
                .iter()
                .any(|p| (*p - first[0]).dot(normal).abs() > 1e-4 * first[0].distance(*p))
        {
            return None;
        }
        match (0..count).find(|&k| turn(k) < 1e-5) {
            Some(straight) if count > 3 => outline.remove(straight),
            _ => break,
        };
    }
    (outline.len() <= MAX_VERTICES).then_some(outline)
}

/// A facet as itself, more facets as one polygon where they fill one, else as up to `k` lights by direction.
pub(super) fn facet_lights(facets: &[Facet], k: usize) -> Vec<VirtualLight> {
    if facets.is_empty() {
        return Vec::new();
    }
    if let Some(light) = one_polygon(facets) {
        return vec![light];
    }
    let items: Vec<(Vec3, f32)> = facets.iter().map(|f| (f.normal, mean(f.flux()))).collect();
    by_direction(&items, k)
        .into_iter()
        .map(|group| {
            let group: Vec<Facet> = group.into_iter().map(|i| facets[i].clone()).collect();
            one_polygon(&group).unwrap_or_else(|| disk(&group))
        })
        .collect()
}

/// The polygon that facets of one plane fill, if they do.
fn one_polygon(facets: &[Facet]) -> Option<VirtualLight> {
    let plane = facets[0].plane();
    let reach = extent(facets.iter().flat_map(|f| &f.vertices)) as f32;
    let coplanar = facets.iter().all(|f| {
        f.normal.dot(plane.normal) > 0.999_99
            && f.vertices
                .iter()
                .all(|&v| plane.height(v).abs() <= 5e-4 * reach)
    });
    if !coplanar {
        return None;
    }
    let outline = if facets.len() == 1 {
        facets[0].outline()
    } else {
        let hull = convex_hull(
            facets
                .iter()
                .flat_map(|f| &f.vertices)
                .map(|&v| plane.project(v))
                .collect(),
        );
        let outline = simplify_outwards(hull, MAX_VERTICES);
        let filled: f32 = facets.iter().map(Facet::area).sum();
        if filled < 0.99 * area(&outline) {
            return None;
        }
        outline
    };
    let center = plane.lift(centroid(&outline));
    Some(VirtualLight {
        shape: Shape::Polygon {
            vertices: vertices(&plane, outline)?,
        },
        position: offset(center, plane.normal),
        normal: plane.normal,
        surface: plane.normal,
        flux: facets.iter().map(Facet::flux).sum(),
        direct: true,
    })
}

/// A disk at the facet nearest to the centre of flux, of the facets' area as its normal sees it.
fn disk(facets: &[Facet]) -> VirtualLight {
    let total: f32 = facets.iter().map(|f| mean(f.flux())).sum();
    let average = |of: &dyn Fn(&Facet) -> Vec3| {
        facets
            .iter()
            .map(|f| of(f) * (mean(f.flux()) / total))
            .sum::<Vec3>()
    };
    let center = average(&Facet::center);
    let distance = |f: &Facet| f.center().distance_squared(center);
    let nearest = facets.iter().fold(&facets[0], |best, f| {
        if distance(f) < distance(best) {
            f
        } else {
            best
        }
    });
    let normal = average(&|f| f.normal)
        .try_normalize()
        .unwrap_or(nearest.normal);
    VirtualLight {
        shape: Shape::Disk {
            area: facets
                .iter()
                .map(|f| f.area() * f.normal.dot(normal).max(0.0))
                .sum(),
        },
        position: offset(nearest.center(), nearest.normal),
        normal,
        surface: normal,
        flux: facets.iter().map(Facet::flux).sum(),
        direct: true,
    }
}

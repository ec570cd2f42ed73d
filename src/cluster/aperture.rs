//! The tree over a light's aperture (IBGI section 4.1, "Direct Virtual Lights"): emissive triangles merged to convex facets,
//! halved along their longest extent as far as the balancing metric may want to go.

use std::collections::BTreeMap;
use std::f32::consts::PI;

use arrayvec::ArrayVec;
use glam::{Vec2, Vec3};

use super::octree::FluxScale;
use super::polygon::{MAX_VERTICES, Plane, area, centroid, clip, simplify_outwards, vertices};
use super::similarity::by_direction;
use super::{Shape, VirtualLight};
use crate::scene::{Aperture, Scene};
use crate::transport::bvh::offset;
use crate::transport::emission::{Emitter, Piece, convex_hull, mean};
use crate::transport::paths::LightPaths;

/// A facet with fewer paths than this is not cut further: its key would be noise.
const MIN_PATHS: usize = 16;
/// A facet is halved at most this often.
const MAX_CUTS: u32 = 10;
/// Direct light is sharper than bounced light, and errors in it are seen first: its keys count this much more.
const DIRECT_WEIGHT: f32 = 4.0;

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

    fn center(&self) -> Vec3 {
        self.plane().lift(centroid(&self.outline()))
    }

    /// Lumens.
    fn flux(&self) -> Vec3 {
        self.radiance * (PI * self.area())
    }

    /// Halves at the middle of the longer of the extents along and across the longest edge; the plane of the cut is the second
    /// result: points with `p . normal <= offset` are in the first half.
    fn halves(&self) -> Option<([Facet; 2], (Vec3, f32))> {
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

/// A node of an aperture's tree.
#[derive(Clone, Debug, PartialEq)]
pub struct ApertureNode {
    key: u64,
    facets: Vec<Facet>,
    children: Vec<ApertureNode>,
}

/// The tree of one light.
#[derive(Clone, Debug, PartialEq)]
pub struct ApertureTree {
    root: ApertureNode,
    /// What stands for a light without extent.
    single: Option<VirtualLight>,
}

/// A path's start on a facet: position, and how its first hit weighs in the metric.
#[derive(Clone, Copy)]
struct Start {
    position: Vec3,
    facet: u32,
    distance: f32,
    albedo: f32,
}

impl ApertureTree {
    /// The tree of light `index`, whose paths feed the metric.
    pub fn new(
        scene: &Scene,
        index: usize,
        emitter: &Emitter,
        paths: &LightPaths,
        scale: &FluxScale,
    ) -> Self {
        let leaf = ApertureNode {
            key: 0,
            facets: Vec::new(),
            children: Vec::new(),
        };
        if let Some(single) = punctual(scene, index) {
            return Self {
                root: leaf,
                single: Some(single),
            };
        }
        let (facets, of_piece) = merge(emitter.pieces());
        let starts = link(emitter.pieces(), &of_piece, facets.len(), paths);
        // The back sides of double-sided facets come after all fronts.
        let mut sides = facets.clone();
        let mut index_of_back = BTreeMap::new();
        for (i, facet) in facets.iter().enumerate() {
            if emitter
                .pieces()
                .iter()
                .zip(&of_piece)
                .any(|(p, &f)| f as usize == i && p.double_sided)
            {
                index_of_back.insert(i as u32, sides.len() as u32);
                let vertices = facet.vertices.iter().rev().copied().collect();
                sides.push(Facet {
                    vertices,
                    normal: -facet.normal,
                    radiance: facet.radiance,
                });
            }
        }
        let starts = starts
            .into_iter()
            .map(|(start, back)| Start {
                facet: if back {
                    index_of_back
                        .get(&start.facet)
                        .copied()
                        .unwrap_or(start.facet)
                } else {
                    start.facet
                },
                ..start
            })
            .collect();
        let energy = paths.emissions.len().max(1) as f32;
        let weight = mean(emitter.flux) / energy * DIRECT_WEIGHT;
        let indices = (0..sides.len() as u32).collect();
        Self {
            root: Builder {
                sides: &sides,
                weight,
                scale,
            }
            .node(indices, starts, f64::INFINITY),
            single: None,
        }
    }

    /// The node at the end of a path from the root: bits after the highest set one, 0 for the first part.
    pub fn node(&self, path: u64) -> Option<&ApertureNode> {
        let steps = 63 - path.leading_zeros();
        (0..steps).rev().try_fold(&self.root, |node, step| {
            node.children.get((path >> step & 1) as usize)
        })
    }

    /// The virtual lights of a node, exact in flux: a facet as itself, more facets as one polygon where they fill one,
    /// else as up to `k` disks by direction.
    pub fn lights(&self, path: u64, k: usize) -> Vec<VirtualLight> {
        match (&self.single, self.node(path)) {
            (Some(single), _) => vec![single.clone()],
            (None, Some(node)) => facet_lights(&node.facets, k),
            (None, None) => Vec::new(),
        }
    }
}

impl ApertureNode {
    /// The balancing metric, in units of [`FluxScale`].
    pub fn key(&self) -> u64 {
        self.key
    }

    /// Number of parts, 0 or 2.
    pub fn parts(&self) -> usize {
        self.children.len()
    }
}

struct Builder<'a> {
    sides: &'a [Facet],
    /// Lumens a path, weighted.
    weight: f32,
    scale: &'a FluxScale,
}

impl Builder<'_> {
    fn key(&self, starts: &[Start], radius: f64) -> u64 {
        starts
            .iter()
            .map(|s| {
                self.scale
                    .key(self.weight, s.albedo, f64::from(s.distance) / radius)
            })
            .sum()
    }

    /// Several facets: halves at the middle of their centres along the major extent.
    fn node(&self, facets: Vec<u32>, starts: Vec<Start>, radius: f64) -> ApertureNode {
        let list = |facets: &[u32]| {
            facets
                .iter()
                .map(|&f| self.sides[f as usize].clone())
                .collect::<Vec<_>>()
        };
        if let [facet] = facets[..] {
            return self.piece(self.sides[facet as usize].clone(), starts, radius, MAX_CUTS);
        }
        let radius = half_extent(
            facets
                .iter()
                .flat_map(|&f| &self.sides[f as usize].vertices),
        )
        .min(radius);
        let key = self.key(&starts, radius);
        let centers: Vec<Vec3> = facets
            .iter()
            .map(|&f| self.sides[f as usize].center())
            .collect();
        let lo = centers.iter().fold(Vec3::INFINITY, |a, &b| a.min(b));
        let hi = centers.iter().fold(Vec3::NEG_INFINITY, |a, &b| a.max(b));
        let axis = (hi - lo).max_position();
        let middle = (lo[axis] + hi[axis]) * 0.5;
        let mut first: Vec<u32> = (0..facets.len())
            .filter(|&i| centers[i][axis] <= middle)
            .map(|i| facets[i])
            .collect();
        if first.len() == facets.len() {
            // All centres in one place, as those of the two sides of a facet.
            first.truncate(facets.len() / 2);
        }
        let second: Vec<u32> = facets
            .iter()
            .copied()
            .filter(|f| first.binary_search(f).is_err())
            .collect();
        let content = list(&facets);
        if facets.is_empty() || starts.len() < MIN_PATHS {
            return ApertureNode {
                key,
                facets: content,
                children: Vec::new(),
            };
        }
        let (a, b): (Vec<Start>, Vec<Start>) = starts
            .into_iter()
            .partition(|s| first.binary_search(&s.facet).is_ok());
        let children = vec![self.node(first, a, radius), self.node(second, b, radius)];
        ApertureNode {
            key,
            facets: content,
            children,
        }
    }

    fn piece(&self, facet: Facet, starts: Vec<Start>, radius: f64, cuts: u32) -> ApertureNode {
        let radius = half_extent(facet.vertices.iter()).min(radius);
        let key = self.key(&starts, radius);
        let mut children = Vec::new();
        if cuts > 0
            && starts.len() >= MIN_PATHS
            && let Some(([first, second], (axis, middle))) = facet.halves()
        {
            let (a, b): (Vec<Start>, Vec<Start>) = starts
                .into_iter()
                .partition(|s| s.position.dot(axis) <= middle);
            children = vec![
                self.piece(first, a, radius, cuts - 1),
                self.piece(second, b, radius, cuts - 1),
            ];
        }
        ApertureNode {
            key,
            facets: vec![facet],
            children,
        }
    }
}

fn half_extent<'a>(points: impl Iterator<Item = &'a Vec3> + Clone) -> f64 {
    let lo = points.clone().fold(Vec3::INFINITY, |a, &b| a.min(b));
    let hi = points.fold(Vec3::NEG_INFINITY, |a, &b| a.max(b));
    f64::from((hi - lo).max_element().max(f32::MIN_POSITIVE)) * 0.5
}

/// Points, spots and suns are one light each.
fn punctual(scene: &Scene, index: usize) -> Option<VirtualLight> {
    let light = &scene.lights[index];
    let shape = match light.aperture {
        Aperture::Point => Shape::Point,
        Aperture::Spot { inner, outer } => Shape::Spot { inner, outer },
        Aperture::Directional => Shape::Directional {
            frame: light.transform,
        },
        Aperture::Surface { .. } => return None,
    };
    Some(VirtualLight {
        shape,
        position: light.transform.translation.into(),
        normal: -Vec3::from(light.transform.matrix3.z_axis).normalize(),
        flux: light.intensity,
        direct: true,
    })
}

/// Which facet each path left, and whether from its back.
fn link(
    pieces: &[Piece],
    of_piece: &[u32],
    facets: usize,
    paths: &LightPaths,
) -> Vec<(Start, bool)> {
    let mut of_triangle: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (i, piece) in pieces.iter().enumerate() {
        of_triangle.entry(piece.triangle).or_default().push(i);
    }
    let center = |i: usize| pieces[i].corners.iter().sum::<Vec3>() / 3.0;
    let starts = paths.emissions.iter().filter_map(|e| {
        let candidates = of_triangle.get(&e.triangle)?;
        let distance = |i: usize| center(i).distance_squared(e.position);
        let &piece = candidates
            .iter()
            .min_by(|&&a, &&b| distance(a).total_cmp(&distance(b)))?;
        let start = Start {
            position: e.position,
            facet: of_piece[piece],
            distance: e.scatter.distance,
            albedo: e.scatter.albedo,
        };
        (start.distance.is_finite() && (start.facet as usize) < facets)
            .then_some((start, e.normal.dot(pieces[piece].normal) < 0.0))
    });
    starts.collect()
}

/// Joins coplanar neighbours of equal radiance to convex facets of at most eight vertices; also returns each piece's facet.
fn merge(pieces: &[Piece]) -> (Vec<Facet>, Vec<u32>) {
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
            owner
                .iter_mut()
                .filter(|o| **o == other as u32)
                .for_each(|o| *o = i as u32);
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
    (facets, owner.iter().map(|&o| place[o as usize]).collect())
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

fn facet_lights(facets: &[Facet], k: usize) -> Vec<VirtualLight> {
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
    let reach = half_extent(facets.iter().flat_map(|f| &f.vertices)) as f32;
    let coplanar = facets.iter().all(|f| {
        f.normal.dot(plane.normal) > 0.999_99
            && f.vertices
                .iter()
                .all(|&v| plane.height(v).abs() <= 1e-3 * reach)
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
        flux: facets.iter().map(Facet::flux).sum(),
        direct: true,
    }
}

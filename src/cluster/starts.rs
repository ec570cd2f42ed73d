//! Where paths leave a light's aperture: the facet side of each, and how its first hit weighs in the balancing metric.

use std::collections::BTreeMap;

use glam::Vec3;

use super::facet::{Facet, merge};
use crate::transport::Emission;
use crate::transport::surface::Piece;

/// A path's start on a facet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Index of the path in its light's sequence.
    pub path: u32,
    /// World space, metres.
    pub position: Vec3,
    /// Into [`Linker::sides`].
    pub facet: u32,
    /// Metres to the first hit.
    pub distance: f32,
    /// Mean albedo there.
    pub albedo: f32,
}

/// Finds the facet side that a path left.
#[derive(Clone, Debug, PartialEq)]
pub struct Linker {
    sides: Vec<Facet>,
    of_triangle: BTreeMap<u32, Vec<Target>>,
}

/// A piece of an emissive triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Target {
    center: Vec3,
    normal: Vec3,
    /// Its facet's front and back; the front twice where the back is dark.
    facets: [u32; 2],
}

impl Linker {
    /// For the pieces of a surface light.
    pub fn new(pieces: &[Piece]) -> Self {
        let (facets, of_piece) = merge(pieces);
        let mut double_sided = vec![false; facets.len()];
        for (piece, &facet) in pieces.iter().zip(&of_piece) {
            if let Some(both) = double_sided.get_mut(facet as usize) {
                *both = piece.double_sided;
            }
        }
        // The back sides of double-sided facets come after all fronts.
        let mut sides = facets.clone();
        let mut backs: Vec<u32> = (0..facets.len() as u32).collect();
        for (i, facet) in facets.iter().enumerate().filter(|f| double_sided[f.0]) {
            backs[i] = sides.len() as u32;
            sides.push(Facet {
                vertices: facet.vertices.iter().rev().copied().collect(),
                normal: -facet.normal,
                radiance: facet.radiance,
            });
        }
        let mut of_triangle: BTreeMap<u32, Vec<Target>> = BTreeMap::new();
        for (piece, &facet) in pieces.iter().zip(&of_piece) {
            // A piece too small for a facet is in none.
            if let Some(&back) = backs.get(facet as usize) {
                of_triangle.entry(piece.triangle).or_default().push(Target {
                    center: piece.corners.iter().sum::<Vec3>() / 3.0,
                    normal: piece.normal,
                    facets: [facet, back],
                });
            }
        }
        Self { sides, of_triangle }
    }

    /// All facets, then the backs of those that shine to both sides.
    pub fn sides(&self) -> &[Facet] {
        &self.sides
    }

    /// The start of a path that met a surface.
    pub fn start(&self, path: u32, emission: &Emission) -> Option<Start> {
        self.locate(path, emission)
            .filter(|s| s.distance.is_finite())
    }

    /// The start of any path.
    pub fn locate(&self, path: u32, emission: &Emission) -> Option<Start> {
        let distance = |t: &Target| t.center.distance_squared(emission.position);
        let targets = self.of_triangle.get(&emission.triangle)?;
        let target = targets
            .iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        let back = emission.normal.dot(target.normal) < 0.0;
        Some(Start {
            path,
            position: emission.position,
            facet: target.facets[usize::from(back)],
            distance: emission.scatter.distance,
            albedo: emission.scatter.albedo,
        })
    }
}

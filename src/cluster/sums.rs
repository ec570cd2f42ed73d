//! What the octree's nodes know of their VPLs: sums in fixed point, so that nothing remembers what came and went.

use glam::{DVec3, Vec3};

use super::cell::ROOT_BITS;
use crate::transport::Vpl;

/// Units that one path's energy has, and its weight.
const PATH: f64 = (1 << 24) as f64;

/// Fixed point for radiant flux: 2^24 units are one path's energy, so that sums of 2^37 VPLs fit 64 bits and keep
/// no trace of what was added and removed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FluxScale {
    units_per_lumen: f64,
}

impl FluxScale {
    /// For paths of this many lumens.
    pub fn new(flux_per_path: f64) -> Self {
        Self {
            units_per_lumen: PATH / flux_per_path,
        }
    }

    /// The lumens of a path.
    pub fn flux_per_path(&self) -> f64 {
        PATH / self.units_per_lumen
    }

    /// Lumens, none negative, to units, rounded.
    pub fn units(&self, flux: Vec3) -> [i64; 3] {
        // A cast cuts off, and is an instruction where `round` is a call on processors of any age.
        flux.to_array()
            .map(|f| (f64::from(f) * self.units_per_lumen + 0.5) as i64)
    }

    /// Units to lumens.
    pub fn lumens(&self, units: [i64; 3]) -> Vec3 {
        DVec3::from_array(units.map(|u| u as f64 / self.units_per_lumen)).as_vec3()
    }
}

/// A term of the balancing metric (see [`Sums::key`]), of a weight in paths ([`Vpl::weight`]).
pub fn key_of(weight: f32, scatter_albedo: f32, relative_distance: f64) -> u64 {
    let near = 1.0 / (1.0 + relative_distance);
    (f64::from(weight) * f64::from(scatter_albedo) * PATH * (near * near)) as u64
}

/// What a node knows of its VPLs: integers, so that removing what was added restores it exactly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sums {
    /// Number of VPLs, which is the number of scattered paths too (N_s).
    pub count: u32,
    /// Scattered paths that met a surface (N_h).
    pub hits: u32,
    /// Units of [`FluxScale`], RGB.
    pub flux: [i64; 3],
    /// What of the light lights a surface up again, weight times albedo met: the key of a cell without end (IBGI equation 4).
    pub contribution: u64,
    /// The balancing metric B (IBGI equations 3 to 6) made additive: the sum over the VPLs of weight times albedo met
    /// times r² / (d + r)², with d the distance to what the scattered path met and r the cell's size. A term shrinks
    /// with r and a child has a part of the terms, each rounded down, so no child's key exceeds its parent's.
    pub key: u64,
}

impl Sums {
    pub(super) fn add(&mut self, term: &Sums) {
        self.count += term.count;
        self.hits += term.hits;
        self.key += term.key;
        self.contribution += term.contribution;
        (0..3).for_each(|c| self.flux[c] += term.flux[c]);
    }

    pub(super) fn remove(&mut self, term: &Sums) {
        self.count -= term.count;
        self.hits -= term.hits;
        self.key -= term.key;
        self.contribution -= term.contribution;
        (0..3).for_each(|c| self.flux[c] -= term.flux[c]);
    }
}

/// A VPL's part of a node's sums. Only the key depends on the level; the cell radius being a power of two keeps it
/// monotone under rounding.
pub(super) fn terms(vpl: &Vpl, scale: &FluxScale, level: u8) -> Sums {
    let radius = (f64::from(ROOT_BITS) - f64::from(level)).exp2();
    let hit = vpl.scatter.distance.is_finite();
    let key = |relative_distance| {
        if hit {
            key_of(vpl.weight, vpl.scatter.albedo, relative_distance)
        } else {
            0
        }
    };
    Sums {
        count: 1,
        hits: u32::from(hit),
        flux: scale.units(vpl.flux),
        contribution: key(0.0),
        key: key(f64::from(vpl.scatter.distance) / radius),
    }
}

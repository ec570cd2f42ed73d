//! What a bake is asked for, and what that resolves to for a scene: recorded in bake.json, and enough to repeat it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Recorded settings that no bake wrote.
#[derive(Debug, thiserror::Error)]
#[error("the recorded setting `{name}` is out of range: it must be {range}")]
pub struct SettingsError {
    name: &'static str,
    range: &'static str,
}

/// A trade of time for error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Quality {
    /// A look in passing.
    Draft,
    /// The default: right to a few per cent.
    Preview,
    /// For shipping.
    Production,
}

/// How many cells stand for the light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Clusters {
    /// This many (Algorithm 1's budget N).
    Count(u32),
    /// Refined until no cell's balancing metric exceeds this share of the light (`cluster::Budget::Auto`).
    Error(f32),
}

/// Everything that decides the map's bytes beside the scene and the device. Resolved: nothing is left to defaults.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// The preset it started from.
    pub quality: Quality,
    /// Scrambles all sequences.
    pub seed: u32,
    /// Lumens per path: a light sends the flux that it is referred to as divided by this many paths.
    pub flux_per_path: f64,
    /// Lumens that lights are referred to as, by [`crate::scene::Light::id`]: what each sent when it was first seen
    /// ([`crate::transport::paths::References`]).
    pub reference_flux: BTreeMap<u32, f64>,
    /// Most bounces of a path.
    pub bounces: u32,
    /// Cells of the octree and the apertures together.
    pub clusters: Clusters,
    /// Pixels along the edge of an indirect light's hemicube.
    pub shadow_size: u32,
    /// The same for direct lights.
    pub direct_shadow_size: u32,
    /// Pixels along the edge of a directional light's map.
    pub sun_shadow_size: u32,
    /// Factor of a disk's area in its form factor's denominator.
    pub disk_area: f32,
    /// Fixed-point units per lux, as a power of two.
    pub fixed_point_bits: i32,
    /// Direct light is left out.
    pub indirect_only: bool,
}

impl Settings {
    /// An error if they were not written by a bake but by hand, and wrongly.
    pub fn check(&self) -> Result<(), SettingsError> {
        let sizes = 8..=16384;
        let checks = [
            (
                self.flux_per_path.is_finite() && self.flux_per_path > 0.0,
                "flux_per_path",
                "above 0",
            ),
            (
                (self.reference_flux.values()).all(|flux| flux.is_finite() && *flux >= 0.0),
                "reference_flux",
                "0 or above",
            ),
            (self.bounces <= 32, "bounces", "at most 32"),
            (
                sizes.contains(&self.shadow_size),
                "shadow_size",
                "between 8 and 16384",
            ),
            (
                sizes.contains(&self.direct_shadow_size),
                "direct_shadow_size",
                "between 8 and 16384",
            ),
            (
                sizes.contains(&self.sun_shadow_size),
                "sun_shadow_size",
                "between 8 and 16384",
            ),
            (
                (0.0..=4.0).contains(&self.disk_area),
                "disk_area",
                "between 0 and 4",
            ),
            (
                (-96..=96).contains(&self.fixed_point_bits),
                "fixed_point_bits",
                "between -96 and 96",
            ),
        ];
        match checks.into_iter().find(|(right, _, _)| !right) {
            Some((_, name, range)) => Err(SettingsError { name, range }),
            None => Ok(()),
        }
    }
}

/// What a bake is asked for; none leaves it to the preset and the scene.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The preset.
    pub quality: Option<Quality>,
    /// Cells.
    pub clusters: Option<u32>,
    /// Paths of all lights together.
    pub paths: Option<u64>,
    /// Most bounces.
    pub bounces: Option<u32>,
    /// Scrambles all sequences.
    pub seed: u32,
    /// Pixels along the edge of an indirect light's hemicube; direct ones get four times as many.
    pub shadow_size: Option<u32>,
    /// Direct light is left out.
    pub indirect_only: bool,
}

impl Options {
    /// The settings for a scene whose lights send so many lumens, by their ids, onto `area` m² of surface.
    pub fn resolve(&self, lights: BTreeMap<u32, f64>, area: f64) -> Settings {
        let flux: f64 = lights.values().sum();
        let quality = self.quality.unwrap_or(Quality::Preview);
        let preset = quality.preset();
        let paths = self.paths.unwrap_or(preset.paths).max(1);
        let shadow_size = self.shadow_size.unwrap_or(preset.shadow_size);
        Settings {
            quality,
            seed: self.seed,
            flux_per_path: if flux > 0.0 { flux / paths as f64 } else { 1.0 },
            reference_flux: lights,
            bounces: self.bounces.unwrap_or(MAX_BOUNCES),
            clusters: self
                .clusters
                .map_or(Clusters::Error(preset.error), Clusters::Count),
            shadow_size,
            direct_shadow_size: self
                .shadow_size
                .map_or(preset.direct_shadow_size, |s| 4 * s),
            sun_shadow_size: preset.sun_shadow_size,
            disk_area: crate::cluster::evaluate::DISK_AREA_TERM,
            fixed_point_bits: fixed_point_bits(flux, area),
            indirect_only: self.indirect_only,
        }
    }
}

/// What the presets decide.
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    /// Paths of all lights together.
    pub paths: u64,
    /// Largest share of the light that a cell's balancing metric may reach (`cluster::Budget::Auto`).
    pub error: f32,
    /// Indirect hemicubes.
    pub shadow_size: u32,
    /// Direct hemicubes.
    pub direct_shadow_size: u32,
    /// Directional maps.
    pub sun_shadow_size: u32,
}

impl Quality {
    /// The preset's numbers.
    pub fn preset(self) -> Preset {
        match self {
            Quality::Draft => Preset {
                paths: 1 << 14,
                error: 3e-3,
                shadow_size: 64,
                direct_shadow_size: 256,
                sun_shadow_size: 2048,
            },
            Quality::Preview => Preset {
                paths: 1 << 17,
                error: 6e-4,
                shadow_size: 128,
                direct_shadow_size: 512,
                sun_shadow_size: 4096,
            },
            Quality::Production => Preset {
                paths: 1 << 19,
                error: 1e-4,
                shadow_size: 256,
                direct_shadow_size: 1024,
                sun_shadow_size: 8192,
            },
        }
    }
}

/// Most bounces unless `--bounces` cuts: Russian roulette leaves less than 0.2 % of the energy long before.
pub const MAX_BOUNCES: u32 = 16;

/// The power of two that puts the scene's mean irradiance (lux) near 2^28 fixed-point units: fine enough that rounding
/// is invisible, with room for 2^34 times the mean.
pub fn fixed_point_bits(total_flux: f64, area: f64) -> i32 {
    let mean = (total_flux / area.max(1e-12)).max(1e-30);
    (28 - mean.log2().ceil() as i32).clamp(-96, 96)
}

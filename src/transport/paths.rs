//! Quasi-Monte Carlo light paths (IBGI section 3.3; Keller 1997): each is a pure function of the scene, its light and its index.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::Vec3;

use super::emission::{EmittedRay, Emitter, mean};
use super::flux::FluxBalance;
use super::intersect::offset;
use super::{Scatter, Vpl};
use crate::scene::Scene;

/// Most surfaces that a path can be let meet.
pub const MAX_BOUNCES: u32 = 32;

/// How paths are sent.
#[derive(Clone, Debug, PartialEq)]
pub struct PathSettings {
    /// Lumens (mean over RGB) that every path starts with, of a light that shines as it is referred to.
    pub flux_per_path: f64,
    /// What the lights are referred to as: how many paths they send.
    pub references: References,
    /// Most VPLs a path leaves, at most [`MAX_BOUNCES`]; 0 leaves direct light alone.
    pub max_bounces: u32,
    /// Chooses the random sequence.
    pub seed: u32,
}

/// Lumens (mean over RGB) by [`crate::scene::Light::id`]: what each light sent when it was first seen. As many paths as that
/// takes stand for it from then on: to dim it changes what its paths carry, and not where they go.
pub type References = Arc<BTreeMap<u32, f64>>;

/// The lights of a scene as they shine now.
pub fn references(scene: &Scene) -> BTreeMap<u32, f64> {
    let flux = |e: Emitter| f64::from(mean(e.flux));
    let ids = scene.lights.iter().map(|l| l.id());
    ids.zip(emitters(scene).into_iter().map(flux)).collect()
}

impl PathSettings {
    /// About `paths` paths over all lights, up to 16 bounces. A scene without light gets a flux of 1 lumen a path.
    pub fn for_paths(scene: &Scene, paths: u32) -> Self {
        let references = references(scene);
        let total: f64 = references.values().sum();
        let flux_per_path = if total > 0.0 {
            total / f64::from(paths.max(1))
        } else {
            1.0
        };
        Self {
            flux_per_path,
            references: Arc::new(references),
            max_bounces: 16,
            seed: 0,
        }
    }

    /// How many paths a light sends: what it is referred to as over the flux per path, rounded, but one at least. Where each
    /// would carry more than twice that flux, twice as many, or four times, and so on. A light that nothing is known about is
    /// referred to as it is.
    pub fn paths_of(&self, light: u32, emitter: &Emitter) -> u32 {
        self.share_out(light, emitter).paths
    }

    /// How a light's flux is shared out among its paths.
    pub(super) fn share_out(&self, light: u32, emitter: &Emitter) -> Shares {
        let lumens = f64::from(mean(emitter.flux));
        let flux = lumens / self.flux_per_path;
        let known = self.references.get(&light);
        let reference = known.map_or(flux, |r| r / self.flux_per_path);
        if !emitter.emits() || reference.max(flux) <= 0.0 {
            return Shares::default();
        }
        let paths = reference.round().max(1.0);
        let doublings = (flux / (2.0 * paths)).log2().ceil().max(0.0);
        let weight = if reference > 0.0 && doublings == 0.0 {
            reference / paths
        } else {
            1.0
        };
        let paths = (paths * doublings.exp2()).min(1e9);
        Shares {
            paths: paths as u32,
            energy: (lumens / paths) as f32,
            weight: weight.max(1e-6) as f32,
        }
    }
}

/// What a light sends, path by path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Shares {
    pub paths: u32,
    /// Lumens (mean over RGB) that each starts with.
    pub energy: f32,
    /// What each counts, in paths of the flux per path: less where a light has one path though it sends less.
    pub weight: f32,
}

/// All paths of a scene, light by light.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PathSet {
    /// One per [`Scene::lights`], by [`crate::scene::Light::id`].
    pub lights: BTreeMap<u32, LightPaths>,
}

/// The paths of one light, a prefix of its sequence.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightPaths {
    /// The light's exact radiant flux in lumens, linear RGB.
    pub flux: Vec3,
    /// What a path counts where paths are weighed against each other ([`Vpl::weight`]).
    pub weight: f32,
    /// Each for itself, so that one can be replaced.
    pub paths: Vec<Path>,
}

/// A path: its rays are the emission's and one from each VPL.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// Its start.
    pub emission: Emission,
    /// What it starts with: lumens, linear RGB.
    pub energy: Vec3,
    /// In the order of their bounces.
    pub vpls: Box<[Vpl]>,
    /// Where its energy went.
    pub balance: FluxBalance,
}

/// The start of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emission {
    /// Where it left the light's aperture, world space.
    pub position: Vec3,
    /// Normal of the emitting side of a surface; zero for other lights.
    pub normal: Vec3,
    /// The emitting triangle of a surface light; `u32::MAX` for other lights.
    pub triangle: u32,
    /// The first ray: feeds the metric of the aperture's tree, as a VPL's scatter feeds the octree's.
    pub scatter: Scatter,
}

impl PathSet {
    /// All VPLs in key order.
    pub fn vpls(&self) -> impl Iterator<Item = &Vpl> {
        self.lights.values().flat_map(|l| l.vpls())
    }

    /// Number of paths.
    pub fn paths(&self) -> usize {
        self.lights.values().map(|l| l.paths.len()).sum()
    }

    /// The balance over all lights.
    pub fn balance(&self) -> FluxBalance {
        let mut total = FluxBalance::default();
        let paths = self.lights.values().flat_map(|l| &l.paths);
        paths.for_each(|p| total.add(&p.balance));
        total
    }
}

impl LightPaths {
    /// All VPLs in key order.
    pub fn vpls(&self) -> impl Iterator<Item = &Vpl> {
        self.paths.iter().flat_map(|p| &p.vpls)
    }
}

impl Path {
    /// Its rays with their exact origins, in order; ray 0 leaves the light, ray `i` VPL `i - 1`.
    pub fn rays(&self) -> impl Iterator<Item = (Vec3, &Scatter)> {
        let first = (self.emission.position, &self.emission.scatter);
        std::iter::once(first).chain(
            self.vpls
                .iter()
                .map(|v| (offset(v.position, v.normal), &v.scatter)),
        )
    }
}

/// The light sources of a scene, one per [`Scene::lights`].
pub fn emitters(scene: &Scene) -> Vec<Emitter> {
    (0..scene.lights.len())
        .map(|l| Emitter::new(scene, l))
        .collect()
}

/// The light sources of a scene by [`crate::scene::Light::id`].
pub type Emitters = BTreeMap<u32, Arc<Emitter>>;

impl EmittedRay {
    /// The start of a path, whose ray is given.
    pub fn emission(&self, scatter: Scatter) -> Emission {
        Emission {
            position: self.origin,
            normal: self.normal,
            triangle: self.triangle,
            scatter,
        }
    }
}

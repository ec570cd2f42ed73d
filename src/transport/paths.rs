//! Quasi-Monte Carlo light paths (IBGI section 3.3; Keller 1997): each is a pure function of the scene, its light and its index.

use std::collections::BTreeMap;
use std::sync::Arc;

use arrayvec::ArrayVec;
use glam::Vec3;
use rayon::prelude::*;

use super::bvh::{Hit, SceneBvh, weights};
use super::emission::{EMISSION_SETS, EmittedRay, Emitter, mean};
use super::flux::{FluxBalance, lumens};
use super::intersect::offset;
use super::sampling::{Sequence, cosine_hemisphere};
use super::{Scatter, Vpl, VplKey};
use crate::scene::Scene;

/// Most surfaces that a path can be let meet.
pub const MAX_BOUNCES: u32 = 32;

/// How paths are sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathSettings {
    /// Lumens (mean over RGB) that every path starts with.
    pub flux_per_path: f64,
    /// Most VPLs a path leaves, at most [`MAX_BOUNCES`]; 0 leaves direct light alone.
    pub max_bounces: u32,
    /// Chooses the random sequence.
    pub seed: u32,
}

impl PathSettings {
    /// About `paths` paths over all lights, up to 16 bounces. A scene without light gets a flux of 1 lumen a path.
    pub fn for_paths(scene: &Scene, paths: u32) -> Self {
        let total: f64 = emitters(scene)
            .iter()
            .map(|e| f64::from(mean(e.flux)))
            .sum();
        let flux_per_path = if total > 0.0 {
            total / f64::from(paths.max(1))
        } else {
            1.0
        };
        Self {
            flux_per_path,
            max_bounces: 16,
            seed: 0,
        }
    }

    /// How many paths a light sends: `round(flux / flux_per_path)`.
    pub fn paths_of(&self, emitter: &Emitter) -> u32 {
        let flux = f64::from(mean(emitter.flux));
        (flux / self.flux_per_path).round().clamp(0.0, 1e9) as u32
    }
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
    /// Each for itself, so that one can be replaced.
    pub paths: Vec<Path>,
}

/// A path: its rays are the emission's and one from each VPL.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// Its start.
    pub emission: Emission,
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
    /// Linear RGB with a mean of 1: times the flux per path, the path's energy.
    pub color: Vec3,
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

/// Traces all paths of all lights: a light sends `round(flux / flux_per_path)`. The result does not depend on threads.
pub fn trace(scene: &Scene, bvh: &SceneBvh, settings: &PathSettings) -> PathSet {
    let tracer = Tracer::new(scene, bvh, settings);
    PathSet {
        lights: tracer
            .emitters
            .keys()
            .map(|&light| (light, tracer.light(light)))
            .collect(),
    }
}

/// The light sources of a scene by [`crate::scene::Light::id`].
pub type Emitters = BTreeMap<u32, Arc<Emitter>>;

/// Traces single paths again and again, as incremental updates need. Lights are named by [`crate::scene::Light::id`], and
/// must be in the scene.
pub struct Tracer<'a> {
    scene: &'a Scene,
    bvh: &'a SceneBvh,
    settings: PathSettings,
    emitters: Emitters,
}

const CHUNK: u32 = 1024;

impl<'a> Tracer<'a> {
    /// Prepares the lights.
    pub fn new(scene: &'a Scene, bvh: &'a SceneBvh, settings: &PathSettings) -> Self {
        let ids = scene.lights.iter().map(|l| l.id());
        let emitters = ids.zip(emitters(scene).into_iter().map(Arc::new)).collect();
        Self::with_emitters(scene, bvh, settings, emitters)
    }

    /// Lights prepared before.
    pub fn with_emitters(
        scene: &'a Scene,
        bvh: &'a SceneBvh,
        settings: &PathSettings,
        emitters: Emitters,
    ) -> Self {
        let settings = PathSettings {
            max_bounces: settings.max_bounces.min(MAX_BOUNCES),
            ..*settings
        };
        Self {
            scene,
            bvh,
            settings,
            emitters,
        }
    }

    /// The light sources.
    pub fn emitters(&self) -> &Emitters {
        &self.emitters
    }

    /// How many paths a light sends.
    pub fn paths_of(&self, light: u32) -> u32 {
        self.settings.paths_of(&self.emitters[&light])
    }

    /// All paths of a light.
    pub fn light(&self, light: u32) -> LightPaths {
        let count = self.paths_of(light);
        let chunks: Vec<Vec<Path>> = (0..count.div_ceil(CHUNK))
            .into_par_iter()
            .map(|chunk| {
                let _span = tracing::debug_span!("trace paths", light, chunk).entered();
                (chunk * CHUNK..count.min((chunk + 1) * CHUNK))
                    .map(|index| self.path(light, index))
                    .collect()
            })
            .collect();
        LightPaths {
            flux: self.emitters[&light].flux,
            paths: chunks.into_iter().flatten().collect(),
        }
    }

    /// Traces one path.
    pub fn path(&self, light: u32, path: u32) -> Path {
        let sequence = Sequence::new(self.settings.seed, light);
        let ray = self.emitters[&light].emit(&sequence, path);
        let first = self.meet(ray.origin, ray.direction);
        let emission = ray.emission(first.scatter);
        self.follow(&sequence, emission, (light, path), &[], first.hit)
    }

    /// Traces a path again whose rays before number `first` have not changed: these and their VPLs are taken over, so the
    /// result is [`Self::path`]'s, but sooner. The path must have that many rays.
    pub fn path_from(&self, light: u32, path: u32, old: &Path, first: usize) -> Path {
        if first == 0 {
            return self.path(light, path);
        }
        let sequence = Sequence::new(self.settings.seed, light);
        self.follow(
            &sequence,
            old.emission,
            (light, path),
            &old.vpls[..first],
            None,
        )
    }

    /// Goes on after `kept` VPLs, the scatter of the last one being traced again, or from what the emission hit.
    fn follow(
        &self,
        sequence: &Sequence,
        emission: Emission,
        (light, path): (u32, u32),
        kept: &[Vpl],
        mut hit: Option<(Hit, Vec3)>,
    ) -> Path {
        let max_bounces = self.settings.max_bounces;
        let full = emission.color * self.settings.flux_per_path as f32;
        let mut energy = full;
        let mut balance = FluxBalance {
            sent: lumens(energy),
            ..Default::default()
        };
        if emission.scatter.object != Scatter::NOTHING {
            balance.first_hit = balance.sent;
        }
        let mut vpls: ArrayVec<Vpl, { MAX_BOUNCES as usize }> = ArrayVec::new();
        for bounce in 0.. {
            let mut vpl = match (kept.get(bounce as usize), hit) {
                (Some(vpl), _) => *vpl,
                (None, None) => {
                    balance.escaped += lumens(energy);
                    break;
                }
                (None, Some(_)) if bounce >= max_bounces => {
                    balance.lost_at_cap += lumens(energy);
                    break;
                }
                (None, Some((hit, albedo))) => Vpl {
                    key: VplKey {
                        light,
                        path,
                        bounce,
                    },
                    position: hit.position,
                    normal: if hit.front { hit.normal } else { -hit.normal },
                    flux: energy * albedo,
                    object: hit.object,
                    scatter: Scatter::default(),
                },
            };
            let flux = vpl.flux;
            balance.absorbed += lumens(energy) - lumens(flux);
            if flux.max_element() <= 0.0 {
                break;
            }
            balance.reflected += lumens(flux);
            let survival = (flux.max_element() / full.max_element()).min(1.0);
            let known = bounce as usize + 1 < kept.len();
            let mut ended = false;
            if !known {
                let [u, v, roulette, _] = sequence.sample(path, EMISSION_SETS + bounce);
                let met = self.meet(
                    offset(vpl.position, vpl.normal),
                    cosine_hemisphere(vpl.normal, [u, v]),
                );
                (vpl.scatter, hit) = (met.scatter, met.hit);
                ended = roulette >= survival;
            }
            vpls.push(vpl);
            energy = flux;
            if (known || hit.is_some()) && bounce + 1 < max_bounces {
                if ended {
                    balance.ended += lumens(energy);
                    break;
                }
                energy /= survival;
                balance.gained += lumens(energy) - lumens(flux);
            }
        }
        Path {
            emission,
            vpls: vpls.as_slice().into(),
            balance,
        }
    }

    fn meet(&self, origin: Vec3, direction: Vec3) -> Met {
        let hit = self
            .bvh
            .closest(self.scene, origin, direction, f32::INFINITY);
        let albedo = match &hit {
            Some(h) if h.front || self.scene.materials[h.material as usize].double_sided => {
                self.scene.albedo(h.object, h.triangle, weights(h.bary))
            }
            _ => Vec3::ZERO,
        };
        Met {
            hit: hit.map(|h| (h, albedo)),
            scatter: Scatter {
                direction,
                distance: hit.map_or(f32::INFINITY, |h| h.t),
                albedo: mean(albedo),
                object: hit.map_or(Scatter::NOTHING, |h| h.object),
            },
        }
    }
}

/// What a ray met: the hit with the albedo of the side it met (0 for the back of a single-sided surface).
struct Met {
    hit: Option<(Hit, Vec3)>,
    scatter: Scatter,
}

impl EmittedRay {
    /// The start of a path, whose ray is given.
    pub fn emission(&self, scatter: Scatter) -> Emission {
        Emission {
            position: self.origin,
            normal: self.normal,
            triangle: self.triangle,
            color: self.color,
            scatter,
        }
    }
}

#[cfg(test)]
mod tests;

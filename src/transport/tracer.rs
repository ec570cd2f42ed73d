//! Follows light paths through a scene, from their start or from where they changed.

use std::sync::Arc;

use arrayvec::ArrayVec;
use glam::Vec3;
use rayon::prelude::*;

use super::bvh::{SceneBvh, weights};
use super::emission::{EMISSION_SETS, EmittedRay, mean};
use super::flux::{FluxBalance, lumens};
use super::intersect::offset;
use super::paths::{
    Emission, Emitters, LightPaths, MAX_BOUNCES, Path, PathSet, PathSettings, Shares, emitters,
};
use super::sampling::{Sequence, cosine_hemisphere};
use super::{Scatter, Vpl, VplKey};
use crate::scene::Scene;

/// Traces all paths of all lights ([`PathSettings::paths_of`]). The result does not depend on threads.
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
            ..settings.clone()
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
        self.settings.paths_of(light, &self.emitters[&light])
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
            weight: self.shares(light).weight,
            paths: chunks.into_iter().flatten().collect(),
        }
    }

    /// Traces one path.
    pub fn path(&self, light: u32, path: u32) -> Path {
        let sequence = Sequence::new(self.settings.seed, light);
        let ray = self.emitters[&light].emit(&sequence, path);
        let (scatter, first) = self.meet(ray.origin, ray.direction);
        let start = self.start(light, &ray, ray.emission(scatter));
        self.follow(&sequence, start, (light, path), Known::NOTHING, first)
    }

    fn shares(&self, light: u32) -> Shares {
        self.settings.share_out(light, &self.emitters[&light])
    }

    fn start(&self, light: u32, ray: &EmittedRay, emission: Emission) -> Start {
        let shares = self.shares(light);
        Start {
            emission,
            energy: ray.color * shares.energy,
            weight: shares.weight,
        }
    }

    /// Traces a path again whose rays before number `first` have not changed: these and their VPLs are taken over, so the
    /// result is [`Self::path`]'s, but sooner. With no ray from `first` on, none is traced: the path only carries what its light
    /// sends now.
    pub fn path_from(&self, light: u32, path: u32, old: &Path, first: usize) -> Path {
        if first == 0 {
            return self.path(light, path);
        }
        let sequence = Sequence::new(self.settings.seed, light);
        let ray = self.emitters[&light].emit(&sequence, path);
        let vpls = &old.vpls[..first.min(old.vpls.len())];
        let known = Known {
            vpls,
            scattered: vpls.len() - usize::from(first <= old.vpls.len()),
        };
        let start = self.start(light, &ray, old.emission);
        let met = Met::left_none(&old.emission.scatter);
        self.follow(&sequence, start, (light, path), known, met)
    }

    /// Goes on after what is known of a path, or from what the emission met.
    fn follow(
        &self,
        sequence: &Sequence,
        start: Start,
        (light, path): (u32, u32),
        known: Known,
        mut met: Option<Met>,
    ) -> Path {
        let max_bounces = self.settings.max_bounces;
        // The share of the start's energy that is left.
        let mut share = Vec3::ONE;
        let carried = |share: Vec3| lumens(start.energy * share);
        let mut balance = FluxBalance {
            sent: carried(share),
            ..Default::default()
        };
        if start.emission.scatter.object != Scatter::NOTHING {
            balance.first_hit = balance.sent;
        }
        let mut vpls: ArrayVec<Vpl, { MAX_BOUNCES as usize }> = ArrayVec::new();
        for bounce in 0.. {
            let mut vpl = match (known.vpls.get(bounce as usize), met) {
                (Some(vpl), _) => start.sends(vpl),
                (None, None) => {
                    balance.escaped += carried(share);
                    break;
                }
                (None, Some(_)) if bounce >= max_bounces => {
                    balance.lost_at_cap += carried(share);
                    break;
                }
                (None, Some(met)) => start.sends(&Vpl {
                    key: VplKey {
                        light,
                        path,
                        bounce,
                    },
                    position: met.position,
                    normal: met.normal,
                    share: share * met.albedo,
                    weight: 0.0,
                    flux: Vec3::ZERO,
                    object: met.object,
                    scatter: Scatter::default(),
                }),
            };
            balance.absorbed += carried(share) - carried(vpl.share);
            share = vpl.share;
            let survival = share.max_element().min(1.0);
            if survival <= 0.0 {
                break;
            }
            balance.reflected += carried(share);
            let number = bounce as usize + 1;
            let mut ended = false;
            if number >= known.vpls.len() {
                let [u, v, roulette, _] = sequence.sample(path, EMISSION_SETS + bounce);
                ended = roulette >= survival;
                if number <= known.scattered {
                    met = Met::left_none(&vpl.scatter);
                } else {
                    let direction = cosine_hemisphere(vpl.normal, [u, v]);
                    (vpl.scatter, met) = self.meet(offset(vpl.position, vpl.normal), direction);
                }
            }
            vpls.push(vpl);
            if vpl.scatter.object != Scatter::NOTHING && bounce + 1 < max_bounces {
                if ended {
                    balance.ended += carried(share);
                    break;
                }
                balance.gained += carried(share / survival) - carried(share);
                share /= survival;
            }
        }
        Path {
            emission: start.emission,
            energy: start.energy,
            vpls: vpls.as_slice().into(),
            balance,
        }
    }

    /// What a ray meets, and how that is kept.
    fn meet(&self, origin: Vec3, direction: Vec3) -> (Scatter, Option<Met>) {
        let hit = self
            .bvh
            .closest(self.scene, origin, direction, f32::INFINITY);
        let met = hit.map(|hit| {
            let both = self.scene.materials[hit.material as usize].double_sided;
            let albedo = if hit.front || both {
                self.scene
                    .albedo(hit.object, hit.triangle, weights(hit.bary))
            } else {
                Vec3::ZERO
            };
            Met {
                position: hit.position,
                normal: if hit.front { hit.normal } else { -hit.normal },
                albedo,
                object: hit.object,
            }
        });
        let scatter = Scatter {
            direction,
            distance: hit.map_or(f32::INFINITY, |h| h.t),
            albedo: met.map_or(0.0, |m| mean(m.albedo)),
            object: met.map_or(Scatter::NOTHING, |m| m.object),
        };
        (scatter, met)
    }
}

/// How a path starts.
struct Start {
    emission: Emission,
    /// Lumens, linear RGB.
    energy: Vec3,
    /// [`Shares::weight`].
    weight: f32,
}

impl Start {
    /// A VPL with what it has of the path.
    fn sends(&self, vpl: &Vpl) -> Vpl {
        Vpl {
            weight: self.weight * mean(vpl.share),
            flux: self.energy * vpl.share,
            ..*vpl
        }
    }
}

/// What is taken over from a path that was traced before.
struct Known<'a> {
    /// Its first ones.
    vpls: &'a [Vpl],
    /// Of how many of them the scatter holds too: of all but the last, or of all.
    scattered: usize,
}

impl Known<'_> {
    const NOTHING: Self = Self {
        vpls: &[],
        scattered: 0,
    };
}

/// The side of a surface that a ray met.
#[derive(Clone, Copy)]
struct Met {
    position: Vec3,
    /// Unit length, towards where the ray came from.
    normal: Vec3,
    /// 0 for the back of a single-sided surface.
    albedo: Vec3,
    object: u32,
}

impl Met {
    /// What a ray met of which its scatter alone is known, and that it left no VPL: nothing, or what swallowed its light.
    fn left_none(scatter: &Scatter) -> Option<Self> {
        (scatter.object != Scatter::NOTHING).then_some(Self {
            position: Vec3::ZERO,
            normal: -scatter.direction,
            albedo: Vec3::ZERO,
            object: scatter.object,
        })
    }
}

#[cfg(test)]
mod tests;

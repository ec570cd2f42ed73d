//! Quasi-Monte Carlo light paths (IBGI section 3.3; Keller 1997): each is a pure function of the scene, its light and its index.

use std::collections::BTreeMap;

use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

use super::bvh::{Hit, SceneBvh, offset, weights};
use super::emission::{EMISSION_SETS, EmittedRay, Emitter, mean};
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
    /// One per path.
    pub emissions: Vec<Emission>,
    /// All VPLs in key order.
    pub vpls: Vec<Vpl>,
    /// Path `i` left `vpls[offsets[i]..offsets[i + 1]]`; one more entry than paths.
    pub offsets: Vec<u32>,
    /// Where the energy went.
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
    /// What the first ray met: feeds the metric of the aperture's tree, as a VPL's scatter feeds the octree's.
    pub scatter: Scatter,
}

/// Where the energy of paths went, lumens (mean over RGB). `sent + gained = absorbed + escaped + lost_at_cap + ended`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FluxBalance {
    /// Left the lights.
    pub sent: f64,
    /// Reached a first surface.
    pub first_hit: f64,
    /// Sent on by VPLs: what the virtual lights of bounces carry.
    pub reflected: f64,
    /// Swallowed by albedo or by back sides.
    pub absorbed: f64,
    /// Left the scene.
    pub escaped: f64,
    /// Reached a surface after the last allowed bounce.
    pub lost_at_cap: f64,
    /// Carried by paths that Russian roulette ended; equals `gained` in expectation.
    pub ended: f64,
    /// Added to paths that Russian roulette let live.
    pub gained: f64,
}

impl FluxBalance {
    /// The sum, entry by entry.
    pub fn add(&mut self, other: &Self) {
        self.sent += other.sent;
        self.first_hit += other.first_hit;
        self.reflected += other.reflected;
        self.absorbed += other.absorbed;
        self.escaped += other.escaped;
        self.lost_at_cap += other.lost_at_cap;
        self.ended += other.ended;
        self.gained += other.gained;
    }

    /// What is unaccounted for, relative to what was sent; rounding alone.
    pub fn error(&self) -> f64 {
        let out = self.absorbed + self.escaped + self.lost_at_cap + self.ended;
        (self.sent + self.gained - out).abs() / self.sent.max(f64::MIN_POSITIVE)
    }
}

impl PathSet {
    /// All VPLs in key order.
    pub fn vpls(&self) -> impl Iterator<Item = &Vpl> {
        self.lights.values().flat_map(|l| &l.vpls)
    }

    /// Number of paths.
    pub fn paths(&self) -> usize {
        self.lights.values().map(|l| l.emissions.len()).sum()
    }

    /// The balance over all lights.
    pub fn balance(&self) -> FluxBalance {
        let mut total = FluxBalance::default();
        self.lights.values().for_each(|l| total.add(&l.balance));
        total
    }
}

impl LightPaths {
    /// The VPLs of one path.
    pub fn path(&self, index: usize) -> &[Vpl] {
        &self.vpls[self.offsets[index] as usize..self.offsets[index + 1] as usize]
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

/// Traces single paths again and again, as incremental updates need. Lights are named by [`crate::scene::Light::id`], and
/// must be in the scene.
pub struct Tracer<'a> {
    scene: &'a Scene,
    bvh: &'a SceneBvh,
    settings: PathSettings,
    emitters: BTreeMap<u32, Emitter>,
}

const CHUNK: u32 = 1024;

impl<'a> Tracer<'a> {
    /// Prepares the lights.
    pub fn new(scene: &'a Scene, bvh: &'a SceneBvh, settings: &PathSettings) -> Self {
        let settings = PathSettings {
            max_bounces: settings.max_bounces.min(MAX_BOUNCES),
            ..*settings
        };
        Self {
            scene,
            bvh,
            settings,
            emitters: scene
                .lights
                .iter()
                .map(|l| l.id())
                .zip(emitters(scene))
                .collect(),
        }
    }

    /// The light sources, by their lights.
    pub fn emitters(&self) -> &BTreeMap<u32, Emitter> {
        &self.emitters
    }

    /// How many paths a light sends.
    pub fn paths_of(&self, light: u32) -> u32 {
        let flux = f64::from(mean(self.emitters[&light].flux));
        (flux / self.settings.flux_per_path).round().clamp(0.0, 1e9) as u32
    }

    /// All paths of a light.
    pub fn light(&self, light: u32) -> LightPaths {
        let count = self.paths_of(light);
        let chunks: Vec<LightPaths> = (0..count.div_ceil(CHUNK))
            .into_par_iter()
            .map(|chunk| {
                let mut paths = LightPaths::default();
                for index in chunk * CHUNK..count.min((chunk + 1) * CHUNK) {
                    let emission = self.path(light, index, &mut paths.vpls, &mut paths.balance);
                    paths.emissions.push(emission);
                    paths.offsets.push(paths.vpls.len() as u32);
                }
                paths
            })
            .collect();
        let mut all = LightPaths {
            flux: self.emitters[&light].flux,
            offsets: vec![0],
            ..Default::default()
        };
        all.vpls
            .reserve_exact(chunks.iter().map(|c| c.vpls.len()).sum());
        for chunk in chunks {
            let base = all.vpls.len() as u32;
            all.offsets.extend(chunk.offsets.iter().map(|o| base + o));
            all.vpls.extend(chunk.vpls);
            all.emissions.extend(chunk.emissions);
            all.balance.add(&chunk.balance);
        }
        all
    }

    /// The ray that starts a path.
    pub fn emit(&self, light: u32, path: u32) -> EmittedRay {
        self.emitters[&light].emit(&Sequence::new(self.settings.seed, light), path)
    }

    /// Traces one path, appends its VPLs and adds to the balance.
    pub fn path(
        &self,
        light: u32,
        path: u32,
        vpls: &mut Vec<Vpl>,
        balance: &mut FluxBalance,
    ) -> Emission {
        let sequence = Sequence::new(self.settings.seed, light);
        let ray = self.emitters[&light].emit(&sequence, path);
        let full = ray.color * self.settings.flux_per_path as f32;
        let mut energy = full;
        let mut next = self.meet(ray.origin, ray.direction);
        let emission = Emission {
            position: ray.origin,
            normal: ray.normal,
            triangle: ray.triangle,
            scatter: next.scatter(),
        };
        balance.sent += lumens(energy);
        if next.hit.is_some() {
            balance.first_hit += lumens(energy);
        }
        for bounce in 0.. {
            let Some(hit) = next.hit else {
                balance.escaped += lumens(energy);
                break;
            };
            if bounce >= self.settings.max_bounces {
                balance.lost_at_cap += lumens(energy);
                break;
            }
            let flux = energy * next.albedo;
            balance.absorbed += lumens(energy) - lumens(flux);
            if flux.max_element() <= 0.0 {
                break;
            }
            balance.reflected += lumens(flux);
            let [u, v, roulette, _] = sequence.sample(path, EMISSION_SETS + bounce);
            let normal = if hit.front { hit.normal } else { -hit.normal };
            next = self.meet(
                offset(hit.position, normal),
                cosine_hemisphere(normal, [u, v]),
            );
            vpls.push(Vpl {
                key: VplKey {
                    light,
                    path,
                    bounce,
                },
                position: hit.position,
                normal,
                flux,
                object: hit.object,
                scatter: next.scatter(),
            });
            energy = flux;
            if next.hit.is_some() && bounce + 1 < self.settings.max_bounces {
                let survival = (flux.max_element() / full.max_element()).min(1.0);
                if roulette >= survival {
                    balance.ended += lumens(energy);
                    break;
                }
                energy /= survival;
                balance.gained += lumens(energy) - lumens(flux);
            }
        }
        emission
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
        Met { hit, albedo }
    }
}

/// What a ray met, and the albedo of the side it met (0 for the back of a single-sided surface).
struct Met {
    hit: Option<Hit>,
    albedo: Vec3,
}

impl Met {
    fn scatter(&self) -> Scatter {
        Scatter {
            distance: self.hit.map_or(f32::INFINITY, |h| h.t),
            albedo: mean(self.albedo),
        }
    }
}

fn lumens(energy: Vec3) -> f64 {
    (f64::from(energy.x) + f64::from(energy.y) + f64::from(energy.z)) / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Aperture;
    use crate::transport::testing::{cornell, light, room};
    use glam::Affine3A;

    fn furnace(albedo: f32, max_bounces: u32, paths: u32) -> PathSet {
        let mut scene = room(albedo);
        scene
            .lights
            .push(light(Aperture::Point, Vec3::ONE, Affine3A::IDENTITY));
        let bvh = SceneBvh::build(&scene);
        trace(
            &scene,
            &bvh,
            &PathSettings {
                max_bounces,
                ..PathSettings::for_paths(&scene, paths)
            },
        )
    }

    #[test]
    fn a_closed_room_keeps_the_geometric_series() {
        let paths = furnace(0.5, 16, 8192);
        let b = paths.balance();
        assert_eq!(b.escaped, 0.0);
        assert!((b.sent - b.first_hit).abs() < 1e-9);
        assert!(b.error() < 1e-9, "{b:?}");
        // albedo / (1 - albedo), the tail after 16 bounces being 2^-16.
        assert!((b.reflected / b.sent - 1.0).abs() < 0.02, "{b:?}");
        assert!((b.gained - b.ended).abs() < 0.02 * b.sent);
        // Equal energy: nothing but the roulette thins the paths out, so every VPL carries the same.
        let flux = paths.vpls().next().expect("a VPL").flux;
        assert!(
            paths
                .vpls()
                .all(|v| (v.flux - flux).abs().max_element() < 1e-4 * flux.x)
        );
    }

    #[test]
    fn a_cap_on_bounces_is_reported() {
        let b = furnace(0.8, 3, 4096).balance();
        assert!(b.error() < 1e-9);
        assert!((b.lost_at_cap / b.sent - 0.512).abs() < 0.02, "{b:?}");
        let direct = furnace(0.8, 0, 128);
        assert_eq!((direct.vpls().count(), direct.paths()), (0, 128));
        assert!((direct.balance().lost_at_cap / direct.balance().sent - 1.0).abs() < 1e-9);
    }

    #[test]
    fn paths_are_a_prefix_and_do_not_depend_on_threads() {
        let scene = cornell();
        let bvh = SceneBvh::build(&scene);
        let settings = PathSettings::for_paths(&scene, 3000);
        let all = trace(&scene, &bvh, &settings);
        let single = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .expect("a pool");
        assert_eq!(single.install(|| trace(&scene, &bvh, &settings)), all);
        let mut dimmed = scene.clone();
        dimmed.materials[5].emission *= 0.5;
        let half = trace(&dimmed, &bvh, &settings);
        let n = half.paths();
        assert_eq!(n, 1500);
        assert_eq!(
            half.lights[&11].vpls,
            all.lights[&11].vpls[..all.lights[&11].offsets[n] as usize]
        );
        assert_eq!(half.lights[&11].emissions, all.lights[&11].emissions[..n]);
        for (i, path) in (0..n).map(|i| (i, half.lights[&11].path(i))) {
            for (b, vpl) in path.iter().enumerate() {
                assert_eq!((vpl.key.path as usize, vpl.key.bounce as usize), (i, b));
            }
        }
        let b = all.balance();
        assert!(b.error() < 1e-9 && b.escaped > 0.0 && b.reflected > 0.0);
        // The back of the lamp is single-sided and swallows: no VPL lies on it, none faces away from the room.
        assert!(
            all.vpls()
                .all(|v| v.position.abs().max_element() < 1.001 && v.object != 5)
        );
    }
}

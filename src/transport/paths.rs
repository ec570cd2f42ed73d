//! Quasi-Monte Carlo light paths (IBGI section 3.3; Keller 1997): each is a pure function of the scene, its light and its index.

use std::collections::BTreeMap;
use std::sync::Arc;

use arrayvec::ArrayVec;
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
        assert_eq!(half.lights[&11].paths, all.lights[&11].paths[..n]);
        for (i, path) in half.lights[&11].paths.iter().enumerate() {
            for (b, vpl) in path.vpls.iter().enumerate() {
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

    #[test]
    fn a_path_goes_on_from_any_of_its_rays() {
        let scene = cornell();
        let bvh = SceneBvh::build(&scene);
        let settings = PathSettings {
            max_bounces: 5,
            ..PathSettings::for_paths(&scene, 500)
        };
        let tracer = Tracer::new(&scene, &bvh, &settings);
        let mut longest = 0;
        for (i, path) in trace(&scene, &bvh, &settings).lights[&11]
            .paths
            .iter()
            .enumerate()
        {
            for first in 0..path.rays().count() {
                assert_eq!(tracer.path_from(11, i as u32, path, first), *path);
            }
            for (ray, (origin, scatter)) in path.rays().enumerate() {
                let end = path.vpls.get(ray).map(|v| v.position);
                let met = origin + scatter.direction * scatter.distance;
                assert!(end.is_none_or(|e| e.distance(met) < 1e-3));
                assert_eq!(
                    scatter.object == Scatter::NOTHING,
                    scatter.distance == f32::INFINITY
                );
            }
            longest = longest.max(path.vpls.len());
        }
        assert_eq!(longest, 5);
    }
}

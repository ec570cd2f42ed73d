//! How much light reaches a point, by rays: direct light from every source, and a guess at what one bounce adds.

use glam::{Vec3, Vec3A};

use super::SceneBvh;
use super::bvh::weights;
use super::emission::{Emitter, SpotFalloff, mean};
use super::intersect::offset;
use super::sampling::{Sequence, cosine_hemisphere};
use crate::scene::{Aperture, Scene};

/// Points that stand for an emissive object.
const SURFACE_POINTS: u32 = 4;
/// Sources below this share of what would arrive without shadows are not asked for theirs.
const NEGLIGIBLE: f32 = 0.01;

/// What light comes from, reduced to points and directions.
#[derive(Clone, Copy, Debug)]
enum Source {
    /// Candela: the intensity along the axis.
    Point {
        position: Vec3,
        intensity: f32,
        spot: Option<(Vec3, SpotFalloff)>,
    },
    /// Lux, and where it comes from.
    Parallel { toward: Vec3, lux: f32 },
    /// A patch of an emissive surface: lumens of its front.
    Patch {
        position: Vec3,
        normal: Vec3,
        flux: f32,
    },
}

/// A scene's light sources with the means to find their shadows. Values are means over RGB.
pub struct DirectLight<'a> {
    scene: &'a Scene,
    bvh: &'a SceneBvh,
    sources: Vec<Source>,
}

impl<'a> DirectLight<'a> {
    /// Of all lights of the scene.
    pub fn new(scene: &'a Scene, bvh: &'a SceneBvh) -> Self {
        let mut sources = Vec::new();
        for (index, light) in scene.lights.iter().enumerate() {
            let position = light.transform.translation.into();
            let aim: Vec3 = (light.transform.matrix3 * Vec3A::NEG_Z).normalize().into();
            let intensity = mean(light.intensity);
            match light.aperture {
                Aperture::Point => sources.push(Source::Point {
                    position,
                    intensity,
                    spot: None,
                }),
                Aperture::Spot { inner, outer } => sources.push(Source::Point {
                    position,
                    intensity,
                    spot: Some((aim, SpotFalloff::new(inner, outer))),
                }),
                Aperture::Directional => sources.push(Source::Parallel {
                    toward: -aim,
                    lux: intensity,
                }),
                Aperture::Surface { .. } => {
                    let emitter = Emitter::new(scene, index);
                    let flux = mean(emitter.flux) / SURFACE_POINTS as f32;
                    let sequence = Sequence::new(0, light.id());
                    let points = (0..SURFACE_POINTS).filter(|_| flux > 0.0).map(|i| {
                        let ray = emitter.emit(&sequence, i);
                        Source::Patch {
                            position: ray.origin,
                            normal: ray.normal,
                            flux,
                        }
                    });
                    sources.extend(points);
                }
            }
        }
        Self {
            scene,
            bvh,
            sources,
        }
    }

    /// Lux that arrive directly at a point that receives on `normal`; `face` is the front of its surface.
    pub fn irradiance(&self, position: Vec3, normal: Vec3, face: Vec3) -> f32 {
        let origin = offset(position, face);
        let arriving: Vec<(f32, Vec3, f32)> = self
            .sources
            .iter()
            .map(|source| {
                let (lux, toward, distance) = source.unshadowed(origin);
                let cosine = toward.dot(normal).max(0.0);
                let above = toward.dot(face) > 0.0;
                (if above { lux * cosine } else { 0.0 }, toward, distance)
            })
            .collect();
        let most: f32 = arriving.iter().map(|a| a.0).sum();
        arriving
            .into_iter()
            .filter(|(lux, toward, distance)| {
                *lux > NEGLIGIBLE * most
                    && !self.bvh.occluded(self.scene, origin, *toward, *distance)
            })
            .map(|a| a.0)
            .sum()
    }

    /// One sample of what a single bounce adds: right in the mean over `u`, two numbers in 0..1.
    pub fn bounced(&self, position: Vec3, normal: Vec3, face: Vec3, u: [f32; 2]) -> f32 {
        let direction = cosine_hemisphere(normal, u);
        let origin = offset(position, face);
        if direction.dot(face) <= 0.0 {
            return 0.0;
        }
        let hit = self
            .bvh
            .closest(self.scene, origin, direction, f32::INFINITY);
        let Some(hit) =
            hit.filter(|h| h.front || self.scene.materials[h.material as usize].double_sided)
        else {
            return 0.0;
        };
        let side = if hit.front { hit.normal } else { -hit.normal };
        let albedo = self
            .scene
            .albedo(hit.object, hit.triangle, weights(hit.bary));
        mean(albedo) * self.irradiance(hit.position, side, side)
    }
}

impl Source {
    /// Lux on a surface that faces the source, the direction to it, and the distance, metres.
    fn unshadowed(&self, from: Vec3) -> (f32, Vec3, f32) {
        let toward = |position: Vec3| {
            let to = position - from;
            let distance = to.length().max(1e-6);
            (to / distance, distance)
        };
        match *self {
            Source::Point {
                position,
                intensity,
                spot,
            } => {
                let (direction, distance) = toward(position);
                let falloff = spot.map_or(1.0, |(aim, falloff)| falloff.at(-direction.dot(aim)));
                (
                    intensity * falloff / (distance * distance),
                    direction,
                    distance,
                )
            }
            Source::Parallel { toward, lux } => (lux, toward, f32::INFINITY),
            Source::Patch {
                position,
                normal,
                flux,
            } => {
                let (direction, distance) = toward(position);
                let cosine = -direction.dot(normal);
                let candela = flux * cosine.max(0.0) / std::f32::consts::PI;
                (candela / (distance * distance), direction, distance)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Affine3A;

    use super::*;
    use crate::transport::testing::{add_quads, light, material};

    /// A floor of 20 m x 20 m in y = 0 and a roof above a part of it: x > 0, y = 1.
    fn scene() -> Scene {
        let quad = |low: f32, y: f32| {
            let corner = |x: f32, z: f32| Vec3::new(x, y, z);
            [
                corner(low, 10.0),
                corner(10.0, 10.0),
                corner(10.0, -10.0),
                corner(low, -10.0),
            ]
        };
        let mut scene = Scene::default();
        let white = material(Vec3::splat(0.5), Vec3::ZERO, false);
        add_quads(&mut scene, &[quad(-10.0, 0.0)], white.clone());
        add_quads(&mut scene, &[quad(0.0, 1.0)], white);
        scene
    }

    fn at(scene: &Scene, x: f32) -> f32 {
        let bvh = SceneBvh::build(scene);
        DirectLight::new(scene, &bvh).irradiance(Vec3::new(x, 0.0, 0.0), Vec3::Y, Vec3::Y)
    }

    #[test]
    fn points_and_suns_are_exact_and_shaded() {
        let mut scene = scene();
        let down = Affine3A::from_rotation_x(-std::f32::consts::FRAC_PI_2);
        scene
            .lights
            .push(light(Aperture::Directional, Vec3::splat(3.0), down));
        let sun = (at(&scene, -2.0), at(&scene, 2.0));
        assert!((sun.0 - 3.0).abs() < 1e-4 && sun.1 == 0.0, "{sun:?}");
        let lamp = Affine3A::from_translation(Vec3::new(-2.0, 4.0, 0.0));
        scene.lights[0] = light(Aperture::Point, Vec3::splat(32.0), lamp);
        assert!((at(&scene, -2.0) - 2.0).abs() < 1e-4);
        assert_eq!(at(&scene, 2.0), 0.0);
    }

    #[test]
    fn a_small_emitter_is_its_flux() {
        let mut scene = scene();
        let lamp = [(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)]
            .map(|(x, z)| Vec3::new(x - 4.0, 5.0, z));
        add_quads(
            &mut scene,
            &[lamp],
            material(Vec3::ZERO, Vec3::splat(1000.0), false),
        );
        // L A cos cos / d² = 1000 * 0.04 / 25
        assert!(
            (at(&scene, -4.0) - 1.6).abs() < 0.01,
            "{}",
            at(&scene, -4.0)
        );
    }

    #[test]
    fn a_bounce_is_right_in_the_mean() {
        let mut scene = scene();
        let down = Affine3A::from_rotation_x(-std::f32::consts::FRAC_PI_2);
        scene
            .lights
            .push(light(Aperture::Directional, Vec3::splat(3.0), down));
        // A ceiling point under the sky sees the lit floor alone, nearly all of it, at an albedo of 0.5.
        let bvh = SceneBvh::build(&scene);
        let direct = DirectLight::new(&scene, &bvh);
        let n = 32;
        let sum: f32 = (0..n * n)
            .map(|i| {
                let u = [i % n, i / n].map(|v| (v as f32 + 0.5) / n as f32);
                direct.bounced(Vec3::new(-5.0, 0.1, 0.0), Vec3::NEG_Y, Vec3::NEG_Y, u)
            })
            .sum();
        let mean = sum / (n * n) as f32;
        assert!((mean - 1.5).abs() < 0.01, "{mean}");
    }
}

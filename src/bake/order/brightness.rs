//! How brightly virtual lights shine on what is near them. A lumen that is wrong is seen by how much irradiance it makes
//! wrong where: the plan goes by the root of its square over all surfaces, or those that a camera sees, which a few rays tell.

use std::collections::BTreeMap;
use std::f32::consts::PI;
use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;

use super::eye::Eye;
use super::schedule::Held;
use super::sight::{Both, Division, missed};
use super::towards::{Towards, towards};
use crate::bake::device::records::Region;
use crate::bake::world::versions::Version;
use crate::cluster::{Selected, Shape, VirtualLight};
use crate::scene::{Camera, Scene};
use crate::transport::bvh::SceneBvh;
use crate::transport::intersect::offset;
use crate::transport::sampling;

/// Rays of a light.
const RAYS: u32 = 12;

/// What is known of lights, by their cells.
#[derive(Debug, Default)]
pub(in crate::bake) struct Brightness {
    /// By address, which stays theirs as long as they are kept here.
    known: BTreeMap<usize, (Arc<Selected>, Vec<Both>)>,
    /// What goes towards what changed between two versions, likewise.
    towards: BTreeMap<(usize, Version, Version), (Arc<Selected>, Towards)>,
    /// Who looks, if anybody does, and who did when that was found out.
    eye: Option<Eye>,
    known_to: Option<Eye>,
}

impl Brightness {
    /// What `camera` sees counts most from now on.
    pub(in crate::bake) fn look_from(&mut self, camera: Option<&Camera>) {
        self.eye = camera.map(Eye::new);
    }

    /// Finds out about cells that are not known yet.
    pub(in crate::bake) fn learn<'a>(
        &mut self,
        scene: &Scene,
        bvh: &SceneBvh,
        division: Option<Division>,
        cells: impl IntoIterator<Item = &'a Arc<Selected>>,
    ) {
        let size = scene.bounds().size();
        self.look(scene, bvh);
        let eye = self.known_to.as_ref();
        let new: Vec<&Arc<Selected>> = cells
            .into_iter()
            .filter(|cell| !self.known.contains_key(&key(cell)))
            .collect();
        let found: Vec<_> = new
            .par_iter()
            .map(|cell| {
                let lights = cell.lights.iter();
                let norms = lights.map(|light| norms(scene, bvh, size, eye, division, light));
                ((*cell).clone(), norms.collect())
            })
            .collect();
        for found in found {
            self.known.insert(key(&found.0), found);
        }
    }

    /// Finds out what of the light of cells, held under earlier versions, goes towards what changed since.
    /// `between`: boxes around that.
    pub(in crate::bake) fn learn_towards<'a>(
        &mut self,
        scene: &Scene,
        bvh: &SceneBvh,
        division: Option<Division>,
        current: Version,
        held: impl IntoIterator<Item = &'a Held>,
        between: impl Fn(Version) -> Vec<Region>,
    ) {
        let size = scene.bounds().size();
        self.look(scene, bvh);
        let eye = self.known_to.as_ref();
        self.towards.retain(|(_, _, to), _| *to == current);
        let mut regions = BTreeMap::new();
        let mut new = Vec::new();
        for held in held {
            if !self
                .towards
                .contains_key(&(key(&held.selected), held.version, current))
            {
                regions
                    .entry(held.version)
                    .or_insert_with(|| between(held.version));
                new.push(held);
            }
        }
        let found: Vec<_> = new
            .par_iter()
            .map(|held| {
                towards(
                    scene,
                    bvh,
                    size.length(),
                    eye,
                    division,
                    &held.selected.lights,
                    &regions[&held.version],
                )
            })
            .collect();
        for (held, found) in new.into_iter().zip(found) {
            let key = (key(&held.selected), held.version, current);
            self.towards.insert(key, (held.selected.clone(), found));
        }
    }

    /// What was found out about a cell; nothing, if that is not known.
    pub(in crate::bake) fn towards(&self, held: &Held, current: Version) -> Towards {
        let key = (key(&held.selected), held.version, current);
        self.towards.get(&key).map_or(Towards::default(), |t| t.1)
    }

    /// What is known is for who looks now.
    fn look(&mut self, scene: &Scene, bvh: &SceneBvh) {
        let size = scene.bounds().size().length();
        let same = match (&self.eye, &self.known_to) {
            (Some(now), Some(then)) => now.is_like(then, size),
            (now, then) => now == then,
        };
        if !same {
            self.known.clear();
            self.towards.clear();
            self.known_to.clone_from(&self.eye);
            if let Some(eye) = &mut self.known_to {
                eye.look(scene, bvh);
            }
        }
    }

    /// By light of a cell: the norm (root of the integral of the square over all surfaces, lux m) of the irradiance that
    /// one unit of its flux or intensity causes in both parts of the map, what is not seen counting less where somebody looks.
    pub(super) fn of(&self, cell: &Selected) -> &[Both] {
        self.known.get(&key(cell)).map_or(&[], |known| &known.1)
    }

    /// All lights are where they should be, or the map was divided anew: what is known is needed no more.
    pub(in crate::bake) fn forget(&mut self) {
        self.known.clear();
        self.towards.clear();
    }
}

fn key(cell: &Selected) -> usize {
    std::ptr::from_ref(cell) as usize
}

/// `size`: of the scene. Monte Carlo: for a diffuse emitter E = cos cos' / (pi d²), and a ray drawn by its cosine stands for d² / cos' of surface.
fn norms(
    scene: &Scene,
    bvh: &SceneBvh,
    size: Vec3,
    eye: Option<&Eye>,
    division: Option<Division>,
    light: &VirtualLight,
) -> Both {
    let area = match &light.shape {
        Shape::Directional { .. } => {
            // A box shows a quarter of its surface.
            let area = 0.5 * (size.x * size.y + size.y * size.z + size.z * size.x);
            let area = f64::from(area);
            return if division.is_some() {
                [(0.5 * area).sqrt(); 2]
            } else {
                [0.0, area.sqrt()]
            };
        }
        Shape::Disk { area } => *area,
        Shape::Polygon { vertices } => {
            let center = vertices.iter().sum::<Vec3>() / vertices.len() as f32;
            let far = vertices.iter().map(|v| v.distance_squared(center));
            PI * far.fold(0.0, f32::max)
        }
        Shape::Point | Shape::Spot { .. } => 0.0,
    };
    let far = size.length().max(1e-6);
    let nearest = 1e-6 * far * far;
    let mut sums = [0.0; 2];
    for i in 0..RAYS {
        // The golden ratio: even in both directions.
        let u = [
            (i as f32 + 0.5) / RAYS as f32,
            (i as f32 * 0.618_034).fract(),
        ];
        let (direction, origin) = match light.shape {
            Shape::Point => (sampling::sphere(u), light.position),
            Shape::Spot { outer, .. } => {
                let cosine = 1.0 - u[0] * (1.0 - outer.cos());
                let local = sampling::around_z(cosine, u[1]);
                let (x, y) = sampling::basis(light.normal);
                let direction = x * local.x + y * local.y + light.normal * local.z;
                (direction, light.position)
            }
            _ => {
                let direction = sampling::cosine_hemisphere(light.normal, u);
                // Its own surface hides that.
                if direction.dot(light.surface) <= 0.0 {
                    continue;
                }
                (direction, offset(light.position, light.surface))
            }
        };
        let Some(hit) = bvh.closest(scene, origin, direction, far) else {
            continue;
        };
        let arriving = hit.normal.dot(direction).abs() / (hit.t * hit.t + area / PI + nearest);
        let weight = eye.map_or(1.0, |eye| {
            eye.weight(scene, bvh, origin + direction * hit.t, hit.normal)
        });
        let part = division.map_or(1, |division| division.part(&hit));
        sums[part] += f64::from(match light.shape {
            Shape::Point => 4.0 * PI * arriving * weight,
            Shape::Spot { outer, .. } => 2.0 * PI * (1.0 - outer.cos()) * arriving * weight,
            _ => light.normal.dot(direction).max(0.0) * arriving * weight / PI,
        });
    }
    missed(sums, RAYS).map(|sum| (sum / f64::from(RAYS)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::CellId;
    use crate::scene::builtin::builtin;

    /// In a sphere that shines on itself all irradiance is the same: flux over area, and its norm flux over the root of it.
    #[test]
    fn in_a_sphere_it_is_that_of_even_light() {
        let scene = Scene::from_document(&builtin("integrating-sphere").unwrap()).unwrap();
        let bvh = SceneBvh::build(&scene);
        let bounds = scene.bounds();
        let radius = 0.5 * bounds.size().x;
        let light = |shape, position, normal| VirtualLight {
            shape,
            position,
            normal,
            surface: normal,
            flux: Vec3::ONE,
            direct: false,
        };
        let center = bounds.center();
        let wall = center + Vec3::X * 0.99 * radius;
        let lights = vec![
            light(Shape::Disk { area: 0.0 }, wall, Vec3::NEG_X),
            light(Shape::Point, center, Vec3::Z),
        ];
        let cell = Arc::new(Selected {
            cell: CellId::Aperture { light: 0, path: 1 },
            lights,
            vpls: Vec::new(),
        });
        let mut brightness = Brightness::default();
        assert!(brightness.of(&cell).is_empty());
        brightness.learn(&scene, &bvh, None, [&cell, &cell]);
        let even = 1.0 / f64::from(radius * (4.0 * PI).sqrt());
        let &[[_, disk], [_, point]] = brightness.of(&cell) else {
            panic!("two lights");
        };
        assert!((0.8 * even..1.3 * even).contains(&disk), "{disk} {even}");
        let even = 4.0 * f64::from(PI) * even;
        assert!(
            (0.98 * even..1.02 * even).contains(&point),
            "{point} {even}"
        );
    }
}

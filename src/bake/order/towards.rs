//! What of a light goes towards what changed, and how much of that shows: on what came, or where its shadow falls. Sampled
//! paths find this only where one of them happened to go; so what comes new into a scene, and the footprint of what left,
//! are not lit last.

use glam::Vec3;

use super::estimate::intercepted;
use super::eye::Eye;
use super::places::{Around, LOOKS, Place, Size, falls, source};
use super::sight::{Both, missed};
use crate::bake::device::records::Region;
use crate::cluster::{Shape, VirtualLight};

/// Rays to a box.
const RAYS: usize = 6;
/// Places that a cell is judged by at most: of more, every so many.
const PLACES: usize = 96;

/// What of a cell's lights goes towards what changed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::bake) struct Towards {
    /// Lumens that get there (mean over RGB).
    pub met: f64,
    /// The norm of the irradiance that they make there and behind, lux m, in both parts of the map; what nobody sees counts less.
    pub shown: Both,
}

/// `regions`: boxes around what changed.
pub(super) fn towards(
    around: &Around,
    eye: Option<&Eye>,
    lights: &[VirtualLight],
    regions: &[Region],
) -> Towards {
    let boxes: Vec<Box> = regions.iter().map(Box::new).collect();
    let sized = lights.iter().map(|l| (l, Size::new(l, around.texel)));
    let lights: Vec<(&VirtualLight, Size)> = sized.collect();
    let far = 2.0 * around.far();
    let (mut met, mut asked, mut places) = (0.0, 0, Vec::new());
    for (i, (light, size)) in lights.iter().enumerate() {
        let mut meets = false;
        for (region, bounds) in regions.iter().zip(&boxes) {
            let part = intercepted(light, region);
            if part > 0.0 {
                met += part * cast(around, eye, far, light, bounds, &mut places);
                meets = true;
            }
        }
        if meets {
            asked += 1;
            let seen = around.looked(eye, i);
            places.extend(seen.filter(|p| reaches(around, far, light, size, p, &boxes)));
        }
    }
    let shown = changed(far, &lights, asked, &boxes, &places);
    Towards { met, shown }
}

/// A box around what changed.
struct Box {
    center: Vec3,
    half: Vec3,
    /// m³.
    volume: f32,
}

/// A part of a ray, metres from its origin.
#[derive(Clone, Copy)]
struct Chord {
    enters: f32,
    leaves: f32,
}

impl Box {
    /// No side is flat.
    fn new(region: &Region) -> Self {
        let half = Vec3::from(region.extent);
        let half = half + 1e-3 * half.length().max(1e-6);
        Self {
            center: region.center.into(),
            half,
            volume: 8.0 * half.element_product(),
        }
    }

    /// What of a ray is inside.
    fn chord(&self, origin: Vec3, direction: Vec3) -> Option<Chord> {
        let (way, inverse) = (self.center - origin, direction.recip());
        let (a, b) = ((way - self.half) * inverse, (way + self.half) * inverse);
        let (enters, leaves) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
        (enters < leaves).then_some(Chord { enters, leaves })
    }
}

/// Where light sets out for a place, and which way.
fn way(light: &VirtualLight, far: f32, to: Vec3) -> (Vec3, Vec3) {
    match light.shape {
        Shape::Directional { .. } => (to - light.normal * 0.5 * far, light.normal),
        _ => (source(light), (to - source(light)).normalize_or_zero()),
    }
}

/// Rays from a light to a box: the share that gets there, and where they meet something there and behind.
fn cast(
    around: &Around,
    eye: Option<&Eye>,
    far: f32,
    light: &VirtualLight,
    bounds: &Box,
    places: &mut Vec<Place>,
) -> f64 {
    let mut arrive = 0;
    for i in 0..RAYS {
        // Powers of the inverse plastic number: even in all three directions.
        let part = |step: f32| 2.0 * ((i as f32 + 0.5) * step).fract() - 1.0;
        let even = Vec3::new(part(0.819_172_5), part(0.671_043_6), part(0.549_700_5));
        let (origin, direction) = way(light, far, bounds.center + bounds.half * even);
        let Some(Chord { enters, leaves }) = bounds.chord(origin, direction) else {
            continue;
        };
        let first = around.closest(origin, direction, far);
        if first.is_some_and(|hit| hit.t < enters) {
            continue;
        }
        arrive += 1;
        let inside = first.filter(|hit| hit.t <= leaves);
        let behind = match inside {
            Some(_) => around.closest(origin + direction * leaves, direction, far),
            None => first,
        };
        let hits = inside.into_iter().chain(behind);
        places.extend(hits.map(|hit| around.place(eye, &hit)));
    }
    f64::from(arrive) / RAYS as f64
}

/// Whether light gets to a place through what changed, and by nothing else.
fn reaches(
    around: &Around,
    far: f32,
    light: &VirtualLight,
    size: &Size,
    place: &Place,
    boxes: &[Box],
) -> bool {
    let (origin, direction) = way(light, far, place.point);
    let distance = origin.distance(place.point);
    let chords = boxes.iter().filter_map(|b| b.chord(origin, direction));
    let before = chords.filter(|chord| chord.enters < distance);
    let Some(Chord { enters, leaves }) = before.reduce(|a, b| Chord {
        enters: a.enters.min(b.enters),
        leaves: a.leaves.max(b.leaves),
    }) else {
        return false;
    };
    let free = |from: f32, to: f32| {
        let (from, length) = (origin + direction * from, (1.0 - 1e-3) * (to - from));
        length <= 0.0 || !(around.bvh).occluded(around.scene, from, direction, length)
    };
    light_at(light, size, place) > 0.0 && free(0.0, enters) && free(leaves, distance)
}

/// Irradiance that a unit of a light's flux or intensity causes at a place.
fn light_at(light: &VirtualLight, size: &Size, place: &Place) -> f32 {
    match light.shape {
        Shape::Directional { .. } => (-place.normal.dot(light.normal)).max(0.0),
        _ => falls(light, size, place)[0],
    }
}

/// The norm over either part of the map of the light that gets to places through what changed. Monte Carlo, as
/// [`super::shown::difference`] is. `asked`: lights that were asked about what is seen.
fn changed(
    far: f32,
    lights: &[(&VirtualLight, Size)],
    asked: usize,
    boxes: &[Box],
    places: &[Place],
) -> Both {
    let step = places.len().div_ceil(PLACES).max(1);
    let mut sums = [0.0; 2];
    for place in places.iter().step_by(step) {
        let mut flux = Vec3::ZERO;
        let mut density = (LOOKS * asked) as f32 * place.looked;
        for (light, size) in lights {
            let (origin, direction) = way(light, far, place.point);
            let squared = origin.distance_squared(place.point);
            let cosine = -place.normal.dot(direction);
            let mut meets = false;
            for bounds in boxes {
                let Some(Chord { enters, leaves }) = bounds.chord(origin, direction) else {
                    continue;
                };
                if cosine <= 0.0 || enters * enters >= squared {
                    continue;
                }
                meets = true;
                // Rays go to points that are even in the box.
                let inside = match light.shape {
                    Shape::Directional { .. } => leaves - enters,
                    _ => (leaves.powi(3) - enters.powi(3)) / (3.0 * squared),
                };
                density += RAYS as f32 * cosine * inside / bounds.volume;
            }
            if meets {
                flux += light.flux * light_at(light, size, place);
            }
        }
        if density > 0.0 {
            let square = flux.length_squared() / 3.0;
            sums[place.part] += f64::from(square * place.weight / density);
        }
    }
    let rays = (RAYS * lights.len() * boxes.len()).max(1) as u32;
    missed(sums, rays).map(|sum| (sum * step as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Camera;
    use crate::scene::Scene;
    use crate::scene::builtin::builtin;
    use crate::transport::bvh::SceneBvh;

    /// In the Cornell box nothing shines through a block, and who looks past a box does not see it lit.
    #[test]
    fn what_is_hidden_counts_nothing_and_what_is_not_seen_little() {
        let scene = Scene::from_document(&builtin("cornell").unwrap()).unwrap();
        let bvh = SceneBvh::build(&scene);
        let bounds = scene.bounds();
        let (center, size) = (bounds.center(), bounds.size());
        let light = VirtualLight {
            shape: Shape::Disk { area: 0.01 },
            position: center + Vec3::Y * 0.45 * size.y,
            normal: Vec3::NEG_Y,
            surface: Vec3::NEG_Y,
            flux: Vec3::ONE,
            direct: false,
        };
        let near = Region {
            center: (center + Vec3::Y * 0.2 * size.y).into(),
            extent: [0.05 * size.x; 3],
        };
        let outside = Region {
            center: (center - Vec3::Y * 0.8 * size.y).into(),
            extent: [0.05 * size.x; 3],
        };
        let all = |eye: Option<&Eye>, region| {
            let around = Around::new(&scene, &bvh, 0.0, None);
            towards(&around, eye, std::slice::from_ref(&light), &[region])
        };
        let met = all(None, near);
        assert!(met.met > 0.0 && met.shown[1] > 0.0, "{met:?}");
        assert_eq!(all(None, outside), Towards::default());
        let camera = |turn: f32| Camera {
            name: String::new(),
            transform: glam::Affine3A::from_rotation_translation(
                glam::Quat::from_rotation_y(turn),
                center + Vec3::Z * 1.5 * size.z,
            ),
            fov_y: 1.0,
        };
        let looking = |turn: f32| {
            let mut eye = Eye::new(&camera(turn));
            eye.look(&scene, &bvh);
            all(Some(&eye), near).shown[1]
        };
        let (facing, away) = (looking(0.0), looking(std::f32::consts::PI));
        let unseen = met.shown[1] * f64::from(super::super::eye::UNSEEN).sqrt();
        assert!(
            (away - unseen).abs() < 1e-6 * met.shown[1],
            "{away} {unseen}"
        );
        assert!(
            facing > 2.0 * away && facing < met.shown[1],
            "{facing} {away} {met:?}"
        );
    }
}

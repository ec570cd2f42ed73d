//! What of a light goes towards what changed, and how much of that shows: on what came, or where its shadow falls. Sampled
//! paths find this only where one of them happened to go; so what comes new into a scene, and the footprint of what left,
//! are not lit last.

use glam::Vec3;

use super::estimate::{intercepted, shown};
use super::eye::Eye;
use super::sight::{Both, Division, missed};
use crate::bake::device::records::Region;
use crate::cluster::{Shape, VirtualLight};
use crate::scene::Scene;
use crate::transport::SceneBvh;
use crate::transport::intersect::offset;

/// Rays to a box.
const RAYS: u32 = 6;

/// What of a cell's lights goes towards what changed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::bake) struct Towards {
    /// Lumens that get there (mean over RGB).
    pub met: f64,
    /// The norm of the irradiance that they make there and behind, lux m, in both parts of the map; what nobody sees counts less.
    pub shown: Both,
}

/// `size`: the length of the scene's diagonal, metres; `regions`: boxes around what changed.
pub(super) fn towards(
    scene: &Scene,
    bvh: &SceneBvh,
    size: f32,
    eye: Option<&Eye>,
    division: Option<Division>,
    lights: &[VirtualLight],
    regions: &[Region],
) -> Towards {
    let (mut met, mut squares) = (0.0, [0.0; 2]);
    let far = 2.0 * size;
    for light in lights {
        for region in regions {
            let part = intercepted(light, region);
            if part > 0.0 {
                let sampled = sample(scene, bvh, far, eye, division, light, region);
                met += part * sampled.arrives;
                for (square, shows) in squares.iter_mut().zip(sampled.shows) {
                    *square += part * part / shown(region) * shows;
                }
            }
        }
    }
    Towards {
        met,
        shown: squares.map(f64::sqrt),
    }
}

/// Means over the rays from a light to a box.
#[derive(Default)]
struct Sampled {
    /// The share that gets there.
    arrives: f64,
    /// What shows there and behind, of the square of the irradiance at the box, in both parts of the map.
    shows: Both,
}

fn sample(
    scene: &Scene,
    bvh: &SceneBvh,
    far: f32,
    eye: Option<&Eye>,
    division: Option<Division>,
    light: &VirtualLight,
    region: &Region,
) -> Sampled {
    let (center, extent) = (Vec3::from(region.center), Vec3::from(region.extent));
    let slack = 1e-3 * extent.length();
    let weight = |point, normal| eye.map_or(1.0, |eye| eye.weight(scene, bvh, point, normal));
    let mut sum = Sampled::default();
    for i in 0..RAYS {
        // Powers of the inverse plastic number: even in all three directions.
        let part = |step: f32| 2.0 * ((i as f32 + 0.5) * step).fract() - 1.0;
        let target =
            center + extent * Vec3::new(part(0.819_172_5), part(0.671_043_6), part(0.549_700_5));
        let origin = match light.shape {
            Shape::Directional { .. } => target - light.normal * 0.5 * far,
            Shape::Point | Shape::Spot { .. } => light.position,
            _ => offset(light.position, light.surface),
        };
        let direction = (target - origin).normalize_or_zero();
        if direction == Vec3::ZERO {
            continue;
        }
        let (a, b) = (
            (center - extent - origin) / direction,
            (center + extent - origin) / direction,
        );
        let (enters, leaves) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
        let cast = |from: f32| {
            let hit = bvh.closest(scene, origin + direction * from, direction, far)?;
            let part = division.map_or(1, |division| division.part(&hit));
            Some((from + hit.t, hit.normal, part))
        };
        let first = cast(0.0);
        if first.is_some_and(|(t, ..)| t < enters - slack) {
            continue;
        }
        sum.arrives += 1.0;
        let inside = first.filter(|(t, ..)| *t <= leaves + slack);
        let behind = if inside.is_some() {
            cast(leaves + slack)
        } else {
            first
        };
        let middle = 0.5 * (enters + leaves);
        for (t, normal, part) in inside.into_iter().chain(behind) {
            // A cone that starts in a point widens.
            let wider = match light.shape {
                Shape::Directional { .. } => 1.0,
                _ => (middle / t).min(1.0).powi(2),
            };
            sum.shows[part] += f64::from(wider * weight(origin + direction * t, normal));
        }
    }
    Sampled {
        arrives: sum.arrives / f64::from(RAYS),
        shows: missed(sum.shows, RAYS).map(|shows| shows / f64::from(RAYS)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Camera;
    use crate::scene::builtin::builtin;

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
            towards(
                &scene,
                &bvh,
                size.length(),
                eye,
                None,
                std::slice::from_ref(&light),
                &[region],
            )
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
        let facing = all(Some(&Eye::new(&camera(0.0))), near).shown[1];
        let away = all(Some(&Eye::new(&camera(std::f32::consts::PI))), near).shown[1];
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

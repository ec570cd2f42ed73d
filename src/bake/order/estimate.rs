//! How much an update matters, estimated from the lights that it is about: what the order of updates goes by.

use glam::Vec3;

use super::shown::Shining;
use crate::bake::device::records::Region;
use crate::cluster::{Shape, VirtualLight};

/// Those that are not among `others`.
pub(super) fn alone<'a>(lights: &[Shining<'a>], others: &[Shining]) -> Vec<Shining<'a>> {
    let one = |l: &&Shining| !others.iter().any(|other| other.0 == l.0);
    lights.iter().filter(one).copied().collect()
}

/// The area that a box shows in the mean, m²: a quarter of its surface (Cauchy).
pub(super) fn shown(region: &Region) -> f64 {
    let [x, y, z] = region.extent.map(f64::from);
    (2.0 * (x * y + y * z + z * x)).max(f64::MIN_POSITIVE)
}

/// Lumens (mean over RGB) of a light that meet a box, unless something stands between: what a change there can have
/// made wrong.
pub(super) fn intercepted(light: &VirtualLight, region: &Region) -> f64 {
    let flux = lumens(light.flux);
    let area = shown(region) as f32;
    let way = Vec3::from(region.center) - light.position;
    let (d2, radius) = (way.length_squared(), Vec3::from(region.extent).length());
    let inside = d2 <= radius * radius;
    let distance = d2.sqrt();
    // A box that is partly behind still shows its front.
    let cosine =
        (way.dot(light.normal) / distance.max(1e-9) + radius / distance.max(1e-9)).clamp(0.0, 1.0);
    let part =
        |solid_angle: f32, all: f32| f64::from(if inside { all } else { solid_angle.min(all) });
    let pi = std::f32::consts::PI;
    match light.shape {
        Shape::Directional { .. } => flux * f64::from(area),
        Shape::Point => flux * part(area / d2, 4.0 * pi),
        Shape::Spot { outer, .. } => {
            let all = 2.0 * pi * (1.0 - outer.cos());
            let aside = way.angle_between(light.normal);
            let seen = inside || aside < outer + (radius / distance).min(1.0).asin();
            if seen {
                flux * part(area / d2, all)
            } else {
                0.0
            }
        }
        _ => flux * part(cosine * area / (pi * d2), 1.0),
    }
}

/// Which part of what a light looks over lies towards a box: how much of its depth map and of what it lights is evaluated again.
pub(super) fn covered(light: &VirtualLight, region: &Region) -> f64 {
    let sine = match light.shape {
        Shape::Directional { .. } => return 0.0,
        _ => {
            Vec3::from(region.extent).length() / Vec3::from(region.center).distance(light.position)
        }
    };
    // A cone's share of the hemisphere.
    if sine < 1.0 {
        1.0 - (1.0 - f64::from(sine * sine)).sqrt()
    } else {
        1.0
    }
}

pub(super) fn lumens(flux: Vec3) -> f64 {
    (f64::from(flux.x) + f64::from(flux.y) + f64::from(flux.z)) / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::sampling;

    /// Rays from a light find a box as often as is estimated, within the factor that a box's outline may differ from its mean.
    #[test]
    fn what_meets_a_box_is_what_rays_find() {
        let region = Region {
            center: [1.0, 2.0, -0.5],
            extent: [0.3, 0.4, 0.2],
        };
        let (center, extent) = (Vec3::from(region.center), Vec3::from(region.extent));
        let light = |shape, position| VirtualLight {
            shape,
            position,
            normal: Vec3::new(0.3, 0.9, -0.1).normalize(),
            surface: Vec3::Y,
            flux: Vec3::splat(5.0),
            direct: true,
        };
        let outer = 0.5;
        let cases = [
            light(Shape::Disk { area: 0.0 }, Vec3::ZERO),
            light(Shape::Point, Vec3::new(0.0, 1.0, 0.0)),
            light(Shape::Spot { inner: 0.2, outer }, Vec3::ZERO),
        ];
        for light in cases {
            let rays = 20_000;
            let sequence = sampling::Sequence::new(1, 0);
            let met = (0..rays)
                .filter(|&i| {
                    let [u, v, ..] = sequence.sample(i, 0);
                    let direction = match light.shape {
                        Shape::Point => sampling::sphere([u, v]),
                        Shape::Spot { .. } => {
                            let local = sampling::around_z(1.0 - u * (1.0 - outer.cos()), v);
                            let (x, y) = sampling::basis(light.normal);
                            x * local.x + y * local.y + light.normal * local.z
                        }
                        _ => sampling::cosine_hemisphere(light.normal, [u, v]),
                    };
                    let a = (center - extent - light.position) / direction;
                    let b = (center + extent - light.position) / direction;
                    let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
                    near <= far && far > 0.0
                })
                .count();
            let all = match light.shape {
                Shape::Point => 4.0 * std::f32::consts::PI,
                Shape::Spot { .. } => 2.0 * std::f32::consts::PI * (1.0 - outer.cos()),
                _ => 1.0,
            };
            let found = 5.0 * f64::from(all) * met as f64 / f64::from(rays);
            let estimated = intercepted(&light, &region);
            let ratio = estimated / found;
            assert!(
                (0.6..1.7).contains(&ratio),
                "{light:?}: {estimated} {found}"
            );
        }
        let mut behind = light(Shape::Disk { area: 0.0 }, Vec3::ZERO);
        behind.normal = -behind.normal;
        assert_eq!(intercepted(&behind, &region), 0.0);
    }
}

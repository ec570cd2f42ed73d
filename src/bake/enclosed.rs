//! Texels that no light can reach: surface inside closed, single-sided geometry, such as the floor below a box.
//!
//! A depth map decides about them with the precision of its pixels, so a little light seeps in along the outline. Rays
//! are exact: where every ray meets the back of a single-sided surface, and no light source stands inside, the texel is
//! dark.

use glam::Vec3;
use rayon::prelude::*;

use crate::lightmap::Texel;
use crate::scene::{Aperture, Scene};
use crate::transport::SceneBvh;
use crate::transport::intersect::offset;

/// Rays of a texel. The first one that meets anything but a back side ends the search.
const RAYS: usize = 24;

/// Whether each texel of the list is enclosed.
pub(super) fn enclosed(scene: &Scene, bvh: &SceneBvh, texels: &[Texel]) -> Vec<bool> {
    let directions = hemisphere();
    let lamps: Vec<Vec3> = scene
        .lights
        .iter()
        .filter(|l| matches!(l.aperture, Aperture::Point | Aperture::Spot { .. }))
        .map(|l| l.transform.translation.into())
        .collect();
    texels
        .par_iter()
        .map(|texel| {
            let transform = &scene.objects[texel.object as usize].transform;
            let normal = (transform.matrix3.inverse().transpose() * Vec3::from_array(texel.normal))
                .normalize_or_zero();
            if normal == Vec3::ZERO {
                return false;
            }
            let position = transform.transform_point3(Vec3::from_array(texel.position));
            let origin = offset(position, normal);
            let (x, y) = normal.any_orthonormal_pair();
            let walled = directions.iter().all(|d| {
                let direction = x * d.x + y * d.y + normal * d.z;
                bvh.closest(scene, origin, direction, f32::INFINITY)
                    .is_some_and(|hit| {
                        !hit.front && !scene.materials[hit.material as usize].double_sided
                    })
            });
            walled
                && lamps.iter().all(|lamp| {
                    let to_lamp = *lamp - origin;
                    let distance = to_lamp.length();
                    bvh.occluded(scene, origin, to_lamp / distance.max(1e-20), distance)
                })
        })
        .collect()
}

/// Directions spread evenly by solid angle over the upper half space (a spherical Fibonacci lattice), the steepest first.
fn hemisphere() -> [Vec3; RAYS] {
    std::array::from_fn(|i| {
        let z = 1.0 - (i as f32 + 0.5) / RAYS as f32;
        let (sin, cos) = (i as f32 * 2.399_963_2).sin_cos();
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * cos, r * sin, z)
    })
}

//! Texels that no light can reach: surface inside closed, single-sided geometry, such as the floor below a box, and in
//! hollows hardly larger than a texel, such as those between a wall and its mouldings.
//!
//! A depth map decides about them with the precision of its pixels, so a little light seeps in along the outline. Rays
//! are exact: where every ray meets the back of a single-sided surface, or anything very near, and no light source stands
//! inside, the texel is dark.

use glam::Vec3;
use rayon::prelude::*;

use crate::lightmap::Texel;
use crate::scene::{Aperture, Bounds, Scene};
use crate::transport::SceneBvh;
use crate::transport::intersect::offset;

/// Rays of a texel. The first one that meets neither a back side nor anything near ends the search.
const RAYS: usize = 24;
/// How large a hollow is at most, in texels of the mean density.
const HOLLOW: f32 = 6.0;

/// Whether each texel of the list is enclosed; `density` is the mean, texels per metre.
pub(super) fn enclosed(scene: &Scene, bvh: &SceneBvh, texels: &[Texel], density: f32) -> Vec<bool> {
    let hollow = HOLLOW / density;
    let directions = hemisphere();
    let (mut lamps, mut suns, mut emitters) = (Vec::new(), Vec::new(), Vec::new());
    for light in &scene.lights {
        match light.aperture {
            Aperture::Point | Aperture::Spot { .. } => {
                lamps.push(Vec3::from(light.transform.translation));
            }
            Aperture::Directional => {
                suns.push(Vec3::from(light.transform.matrix3.z_axis.normalize()));
            }
            Aperture::Surface { object } => emitters.push(scene.object_bounds(object)),
        }
    }
    texels
        .par_iter()
        .map(|texel| {
            let transform = &scene.objects[texel.object as usize].transform;
            let face = (transform.matrix3.inverse().transpose() * Vec3::from_array(texel.face))
                .normalize_or_zero();
            if face == Vec3::ZERO {
                return false;
            }
            let position = transform.transform_point3(Vec3::from_array(texel.position));
            let origin = offset(position, face);
            let (x, y) = face.any_orthonormal_pair();
            let mut in_hollow = false;
            let walled = directions.iter().all(|d| {
                let direction = x * d.x + y * d.y + face * d.z;
                let hit = bvh.closest(scene, origin, direction, f32::INFINITY);
                hit.is_some_and(|hit| {
                    let back = !hit.front && !scene.materials[hit.material as usize].double_sided;
                    in_hollow |= !back;
                    back || hit.t < hollow
                })
            });
            let apart = |b: &Bounds| {
                (b.min - origin)
                    .max(origin - b.max)
                    .max(Vec3::ZERO)
                    .length()
            };
            walled
                && !(in_hollow && emitters.iter().any(|b| apart(b) < hollow))
                && suns
                    .iter()
                    .all(|sun| bvh.occluded(scene, origin, *sun, f32::INFINITY))
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

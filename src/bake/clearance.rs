//! What stands near each texel, by rays: how far, and which way, shadow lookups can keep clear of it.

use glam::Vec3;
use rayon::prelude::*;

use crate::lightmap::{Clearance, Texel};
use crate::scene::Scene;
use crate::transport::SceneBvh;
use crate::transport::intersect::offset;

/// How far is looked, in texels of the mean density: about what a depth map's pixel spans at the far end of a room.
const REACH: f32 = 3.0;
/// Rays along the surface start this share of the reach above it.
const HEIGHT: f32 = 1.0 / 16.0;

/// How far is looked around texels of `density` (per metre), metres.
pub(super) fn reach(density: f32) -> f32 {
    REACH / density
}

/// What stands within `reach` metres of each texel.
pub(super) fn find(
    scene: &Scene,
    bvh: &SceneBvh,
    texels: &[Texel],
    reach: f32,
) -> Vec<Clearance> {
    texels
        .par_iter()
        .with_min_len(256)
        .map(|texel| around(scene, bvh, texel, reach))
        .collect()
}

fn around(scene: &Scene, bvh: &SceneBvh, texel: &Texel, reach: f32) -> Clearance {
    let transform = &scene.objects[texel.object as usize].transform;
    let face = (transform.matrix3.inverse().transpose() * Vec3::from_array(texel.face))
        .normalize_or_zero();
    if texel.pixel == Texel::NONE || face == Vec3::ZERO {
        return Clearance::OPEN;
    }
    let position = transform.transform_point3(Vec3::from_array(texel.position));
    let origin = offset(position, face);
    let free = |from: Vec3, way: Vec3, most: f32| {
        bvh.closest(scene, from, way, most).map_or(most, |hit| hit.t)
    };
    let above = free(origin, face, reach);
    let room = |distance: f32| if distance < reach { distance } else { Clearance::OPEN.room };
    let start = origin + face * (reach * HEIGHT).min(0.5 * above);
    let (u, v) = face.any_orthonormal_pair();
    let (mut push, mut near) = (Vec3::ZERO, reach);
    for axis in [u, v] {
        let [ahead, behind] = [axis, -axis].map(|way| free(start, way, reach));
        near = near.min(ahead).min(behind);
        // Between two walls to the middle, else a whole reach away from the one there is.
        push += axis
            * match (ahead < reach, behind < reach) {
                (true, true) => 0.5 * (ahead - behind),
                (true, false) => ahead - reach,
                (false, true) => reach - behind,
                (false, false) => 0.0,
            };
    }
    let length = push.length();
    if near >= reach || length <= 0.0 {
        return Clearance {
            room: room(above),
            ..Clearance::OPEN
        };
    }
    let way = push / length;
    let length = length.min(0.5 * free(start, way, 2.0 * length));
    let push = way * length;
    let above = above.min(free(start + push, face, reach));
    Clearance {
        push: push.to_array(),
        near,
        rate: 1.0 / length,
        room: room(above),
    }
}

//! What a camera sees of the map: how much every texel counts in a picture of the scene.

use rayon::prelude::*;

use crate::bake::order::eye::{ASPECT, PICTURE};
use crate::lightmap::texels::Texels;
use crate::lightmap::{Atlas, Texel, sample, viewpoint};
use crate::scene::{Camera, Scene};
use crate::transport::SceneBvh;
use crate::transport::bvh::weights as corner_weights;

/// By texel of the list, the sum of its weights in the bilinear lookups of a picture's pixels. `camera`, or else the
/// file's first, or else a place from which much is seen.
pub(super) fn weights(
    scene: &Scene,
    bvh: &SceneBvh,
    atlas: &Atlas,
    texels: &Texels,
    camera: Option<&Camera>,
) -> Vec<f32> {
    let camera = match camera.or(scene.cameras.first()) {
        Some(camera) => camera.clone(),
        None => viewpoint::choose(scene),
    };
    let side = atlas.page_size as usize;
    // Which texel of the list a pixel of the pages is, of the objects that are there.
    let mut at = vec![Texel::NONE; side * side * atlas.pages as usize];
    for (object, tiles) in (0..).zip(&texels.tiles) {
        if object as usize >= scene.objects.len() || scene.is_gone(object) {
            continue;
        }
        let range = tiles.start as usize * Texel::TILE..tiles.end as usize * Texel::TILE;
        for (slot, texel) in (range.start as u32..).zip(&texels.list[range]) {
            if let Some(at) = at.get_mut(texel.pixel as usize) {
                *at = slot;
            }
        }
    }
    let far = 4.0 * scene.bounds().size().length();
    let scale = (0.5 * camera.fov_y).tan();
    let seen: Vec<[(usize, f32); 4]> = (0..PICTURE[0] * PICTURE[1])
        .into_par_iter()
        .filter_map(|pixel| {
            let part = |i: u32, n: u32| 2.0 * (i as f32 + 0.5) / n as f32 - 1.0;
            let (x, y) = (
                part(pixel % PICTURE[0], PICTURE[0]) * ASPECT,
                -part(pixel / PICTURE[0], PICTURE[1]),
            );
            let local = glam::Vec3::new(x * scale, y * scale, -1.0);
            let direction = camera.transform.transform_vector3(local).normalize();
            let eye = camera.transform.translation.into();
            let hit = bvh.closest(scene, eye, direction, far)?;
            let place = &atlas.objects[hit.object as usize];
            let corners = place.layout.triangles[hit.triangle as usize];
            let [a, b, c] = corners.map(|v| place.layout.vertices[v as usize].uv);
            let w = corner_weights(hit.bary);
            let uv = a * w.x + b * w.y + c * w.z + place.origin.as_vec2();
            let page = place.page as usize * side * side;
            Some(sample::taps(uv, atlas.page_size).map(|(i, w)| (page + i, w)))
        })
        .collect();
    let mut weights = vec![0.0; texels.list.len()];
    for (pixel, weight) in seen.into_iter().flatten() {
        if let Some(sum) = weights.get_mut(at[pixel] as usize) {
            *sum += weight;
        }
    }
    weights
}

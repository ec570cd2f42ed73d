//! What a camera sees of the map: how much every texel counts in a picture of the scene.

use crate::bake::order::sight::Sight;
use crate::lightmap::texels::Texels;
use crate::lightmap::{Atlas, viewpoint};
use crate::scene::{Camera, Scene};
use crate::transport::SceneBvh;

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
    let sight = Sight::new(scene, bvh, atlas, texels, &camera);
    let mut weights = vec![0.0; texels.list.len()];
    for (pixel, weight) in sight.pixels().flat_map(|p| p.taps) {
        if let Some(slot) = sight.slots().get(pixel) {
            weights[slot] += weight;
        }
    }
    weights
}

//! Texels into tiles that lie together and face alike: the smaller a tile's box and cone, the more lights it can be told apart
//! from at once.

use glam::Vec3;

use super::Texel;

/// How many texels' width a difference of 1 between two normals counts for.
const NORMAL_WEIGHT: f32 = 64.0;
/// Fewer texels are not worth another thread.
const ALONE: usize = 4096;

/// Orders an object's texels so that every run of [`Texel::TILE`] is a tile: halves the set across the direction of its
/// largest spread, of positions or of normals, until a tile is left (Bentley 1975). The order is the same at every time.
pub(super) fn arrange(texels: &mut [Texel]) {
    let spread = |of: fn(&Texel) -> [f32; 3]| {
        let (low, high) = bounds(texels, of);
        high - low
    };
    // What is known of a texel's width: the square root of a texel's share of a flat surface of this size.
    let width = spread(|t| t.position).length() / (texels.len().max(1) as f32).sqrt();
    split(texels, NORMAL_WEIGHT * width);
}

fn split(texels: &mut [Texel], weight: f32) {
    let tiles = texels.len().div_ceil(Texel::TILE);
    if tiles < 2 {
        return;
    }
    let spreads = [
        (1.0, (|t| t.position) as fn(&Texel) -> [f32; 3]),
        (weight, |t| t.face),
    ]
    .map(|(factor, of)| {
        let (low, high) = bounds(texels, of);
        (high - low) * factor
    });
    let [position, face] = spreads;
    let (of, spread): (fn(&Texel) -> [f32; 3], Vec3) =
        if position.max_element() >= face.max_element() {
            (|t| t.position, position)
        } else {
            (|t| t.face, face)
        };
    let axis = spread.max_position();
    let middle = tiles / 2 * Texel::TILE;
    // No two texels of an object have the same pixel: the two halves are two certain sets.
    texels.select_nth_unstable_by(middle, |a, b| {
        of(a)[axis]
            .total_cmp(&of(b)[axis])
            .then(a.pixel.cmp(&b.pixel))
    });
    let alone = texels.len() < ALONE;
    let (one, other) = texels.split_at_mut(middle);
    if alone {
        split(one, weight);
        split(other, weight);
    } else {
        rayon::join(|| split(one, weight), || split(other, weight));
    }
}

fn bounds(texels: &[Texel], of: impl Fn(&Texel) -> [f32; 3]) -> (Vec3, Vec3) {
    let none = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    texels.iter().fold(none, |(low, high), texel| {
        let at = Vec3::from(of(texel));
        (low.min(at), high.max(at))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two parallel floors, facing each other, their texels dealt out in turn.
    fn floors() -> Vec<Texel> {
        (0..64u32 * 64 * 2)
            .map(|i| {
                let (side, x, y) = (i % 2, i / 2 % 64, i / 128);
                let up = if side == 0 { 1.0 } else { -1.0 };
                Texel {
                    position: [x as f32, side as f32 * 0.5, y as f32],
                    object: 0,
                    normal: [0.0, up, 0.0],
                    face: [0.0, up, 0.0],
                    pixel: i,
                }
            })
            .collect()
    }

    #[test]
    fn tiles_are_compact_and_face_one_way() {
        let mut texels = floors();
        arrange(&mut texels);
        for tile in texels.chunks(Texel::TILE) {
            assert!(tile.iter().all(|t| t.face == tile[0].face));
            let (low, high) = bounds(tile, |t| t.position);
            assert!((high - low).max_element() <= 8.0, "{low} {high}");
        }
        let mut pixels: Vec<u32> = texels.iter().map(|t| t.pixel).collect();
        pixels.sort_unstable();
        assert!(
            pixels.into_iter().eq(0..64 * 64 * 2),
            "every texel is there once"
        );
    }

    #[test]
    fn threads_do_not_matter() {
        let mut many = floors();
        let mut one = floors();
        arrange(&mut many);
        let single = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        single.expect("a thread").install(|| arrange(&mut one));
        assert!(many.iter().map(|t| t.pixel).eq(one.iter().map(|t| t.pixel)));
    }
}

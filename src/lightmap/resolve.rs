//! The last step from lit texels to a lightmap: into pages, seams matched, and the gutters between charts filled.

use rayon::prelude::*;

use super::seams::Seams;
use super::texels::Texels;
use super::{Atlas, Lightmap, PADDING, Texel};
use crate::scene::Scene;

/// How far the charts are grown into the empty texels around them: all the way to the next chart's, for mip levels and for renderers
/// whose filters reach farther than bilinear ones.
const GUTTER: u32 = 2 * PADDING;

/// Makes the lightmap from the irradiance of the listed texels, in lux, one entry per entry of `texels.list` (fillers are skipped).
/// The result depends on the arguments alone, not on the number of threads.
pub fn resolve(scene: &Scene, atlas: &Atlas, texels: &Texels, irradiance: &[[f32; 3]]) -> Lightmap {
    resolve_texels(scene, atlas, &texels.list, irradiance)
}

/// [`resolve`] for a bare list.
pub(crate) fn resolve_texels(
    scene: &Scene,
    atlas: &Atlas,
    texels: &[Texel],
    irradiance: &[[f32; 3]],
) -> Lightmap {
    let size = atlas.page_size as usize;
    let mut pages = vec![vec![[0.0; 3]; size * size]; atlas.pages as usize];
    let mut owned = vec![vec![0u8; size * size]; atlas.pages as usize];
    for (texel, value) in texels
        .iter()
        .zip(irradiance)
        .filter(|(t, _)| t.pixel != Texel::NONE)
    {
        let (page, at) = (
            texel.pixel as usize / (size * size),
            texel.pixel as usize % (size * size),
        );
        pages[page][at] = *value;
        owned[page][at] = 1;
    }
    Seams::new(scene, atlas).apply(atlas, &mut pages, &owned);
    for (page, owned) in pages.iter_mut().zip(&mut owned) {
        for _ in 0..GUTTER {
            grow(page, owned, size);
        }
    }
    Lightmap {
        page_size: atlas.page_size,
        pages,
    }
}

/// Gives every empty texel next to filled ones their mean.
fn grow(page: &mut [[f32; 3]], filled: &mut [u8], size: usize) {
    let grown: Vec<Vec<(usize, [f32; 3])>> = {
        let (page, filled) = (&*page, &*filled);
        (0..size)
            .into_par_iter()
            .map(|y| grow_row(page, filled, size, y))
            .collect()
    };
    for (at, value) in grown.into_iter().flatten() {
        page[at] = value;
        filled[at] = 1;
    }
}

fn grow_row(page: &[[f32; 3]], filled: &[u8], size: usize, y: usize) -> Vec<(usize, [f32; 3])> {
    let rows = y.saturating_sub(1)..(y + 2).min(size);
    // Which columns have anything in the three rows: most have not, or are full.
    let mut near = vec![0u8; size + 2];
    for row in rows.clone() {
        for (near, filled) in near[1..].iter_mut().zip(&filled[row * size..][..size]) {
            *near |= filled;
        }
    }
    let mut grown = Vec::new();
    for x in 0..size {
        if filled[y * size + x] != 0 || near[x] | near[x + 1] | near[x + 2] == 0 {
            continue;
        }
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for row in rows.clone() {
            for column in x.saturating_sub(1)..(x + 2).min(size) {
                let at = row * size + column;
                if filled[at] != 0 {
                    count += 1.0;
                    for k in 0..3 {
                        sum[k] += page[at][k];
                    }
                }
            }
        }
        grown.push((y * size + x, sum.map(|s: f32| s / count)));
    }
    grown
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{Affine3A, UVec2, Vec2, Vec3};

    use super::*;
    use crate::lightmap::coverage::fetched;
    use crate::lightmap::{ObjectAtlas, UvLayout, UvSource, UvVertex};
    use crate::scene::{Mesh, Object};

    /// A strip of two squares along x, folded by `angle` at x = 1, its halves laid out as two charts: one upright, one on its side.
    fn strip(angle: f32) -> (Scene, Atlas) {
        let end = Vec3::X + Vec3::new(angle.cos(), 0.0, angle.sin());
        let p = [
            Vec3::ZERO,
            Vec3::X,
            Vec3::X + Vec3::Y,
            Vec3::Y,
            Vec3::X,
            end,
            end + Vec3::Y,
            Vec3::X + Vec3::Y,
        ];
        let second = Vec3::new(-angle.sin(), 0.0, angle.cos());
        let mesh = Mesh {
            name: "strip".into(),
            positions: p.to_vec(),
            normals: [[Vec3::Z; 4], [second; 4]].concat(),
            triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
            ..Mesh::default()
        };
        let uv = [
            (2., 2.),
            (10., 2.),
            (10., 10.),
            (2., 10.),
            (14., 10.),
            (14., 2.),
            (22.3, 2.),
            (22.3, 10.),
        ];
        let vertices = uv.iter().enumerate().map(|(i, &(x, y))| UvVertex {
            source: i as u32,
            uv: Vec2::new(x, y),
        });
        let layout = UvLayout {
            vertices: vertices.collect(),
            triangles: mesh.triangles.clone(),
            charts: vec![0, 0, 1, 1],
        };
        let object = Object {
            name: "strip".into(),
            node: 0,
            mesh: 0,
            transform: Affine3A::IDENTITY,
        };
        let scene = Scene {
            meshes: vec![Arc::new(mesh)],
            objects: vec![object],
            ..Scene::default()
        };
        let place = ObjectAtlas {
            page: 0,
            origin: UVec2::new(3, 1),
            size: UVec2::new(25, 12),
            source: UvSource::Authored,
            layout: Arc::new(layout),
        };
        let atlas = Atlas {
            page_size: 32,
            pages: 1,
            density: 8.0,
            objects: vec![place],
        };
        (scene, atlas)
    }

    /// Resolves with `value` at each fetched texel's centre.
    fn lit(scene: &Scene, atlas: &Atlas, value: impl Fn(Vec2) -> f32) -> Lightmap {
        let place = &atlas.objects[0];
        let (mut texels, mut irradiance) = (Vec::new(), Vec::new());
        for (i, _) in fetched(&place.layout, place.size)
            .iter()
            .enumerate()
            .filter(|(_, f)| **f)
        {
            let at = UVec2::new(i as u32 % place.size.x, i as u32 / place.size.x);
            let pixel = (at.y + place.origin.y) * atlas.page_size + at.x + place.origin.x;
            texels.push(Texel {
                position: [0.0; 3],
                object: 0,
                normal: [0.0; 3],
                face: [0.0; 3],
                pixel,
            });
            let v = value(at.as_vec2() + 0.5);
            irradiance.push([v, 2.0 * v, 0.0]);
        }
        texels.push(Texel {
            pixel: Texel::NONE,
            ..texels[0]
        });
        irradiance.push([9e9; 3]);
        resolve_texels(scene, atlas, &texels, &irradiance)
    }

    /// The largest step across the fold.
    fn step(map: &Lightmap) -> f32 {
        let at = |x: f32, y: f32| {
            map.sample_bilinear(0, (Vec2::new(x, y) + Vec2::new(3.0, 1.0)) / 32.0)
                .x
        };
        // Along the fold: x = 10 upwards in the first chart; y = 10 along x in the second, as wide as 8.3 texels.
        (1..20)
            .map(|k| k as f32 / 20.0)
            .map(|s| (at(10.0, 2.0 + 8.0 * s) - at(14.0 + 8.3 * s, 10.0)).abs())
            .fold(0.0, f32::max)
    }

    #[test]
    fn a_smooth_fold_shows_no_seam_and_a_hard_one_stays() {
        let value = |at: Vec2| {
            if at.x < 12.0 {
                100.0 + at.y
            } else {
                80.0 + at.x
            }
        };
        let (scene, atlas) = strip(0.1);
        let before = {
            let (scene, atlas) = strip(1.0);
            lit(&scene, &atlas, value)
        };
        let after = lit(&scene, &atlas, value);
        assert!(step(&before) > 7.0, "hard: {}", step(&before));
        assert!(
            step(&after) < 0.05 * step(&before),
            "smooth: {}",
            step(&after)
        );
        // Of the texels that the surface fetches, only the columns and rows next to the fold.
        let place = &atlas.objects[0];
        let fetched = fetched(&place.layout, place.size);
        for (i, _) in fetched.iter().enumerate().filter(|(_, f)| **f) {
            let at = UVec2::new(i as u32 % place.size.x, i as u32 / place.size.x);
            let pixel = ((at.y + place.origin.y) * 32 + at.x + place.origin.x) as usize;
            let near = (9..=10).contains(&at.x) || at.x > 12 && (9..=10).contains(&at.y);
            let [before, after] = [&before, &after].map(|map| map.pages[0][pixel]);
            assert!(near || before == after, "{at}");
            assert!((after[1] - 2.0 * after[0]).abs() < 1e-3 && after[2] == 0.0);
        }
    }

    #[test]
    fn seams_that_agree_change_nothing_and_nothing_turns_negative() {
        let (scene, atlas) = strip(0.0);
        let even = lit(&scene, &atlas, |_| 7.0);
        assert!(
            even.pages[0]
                .iter()
                .all(|t| t[0] == 0.0 || (t[0] - 7.0).abs() < 1e-5)
        );
        let steep = lit(&scene, &atlas, |at| {
            if at.x < 12.0 {
                0.0
            } else {
                1000.0 * (at.y - 2.0).max(0.0)
            }
        });
        assert!(steep.pages[0].iter().flatten().all(|v| *v >= 0.0));
    }

    #[test]
    fn gutters_are_filled_four_texels_far_and_no_farther() {
        let size = 16;
        let mut page = vec![[0.0; 3]; size * size];
        let mut filled = vec![0u8; size * size];
        page[8 * size + 7] = [3.0, 2.0, 1.0];
        filled[8 * size + 7] = 1;
        for _ in 0..GUTTER {
            grow(&mut page, &mut filled, size);
        }
        for y in 0..size {
            for x in 0..size {
                let inside = y.abs_diff(8) <= 4 && x.abs_diff(7) <= 4;
                assert_eq!(
                    page[y * size + x],
                    if inside { [3.0, 2.0, 1.0] } else { [0.0; 3] }
                );
            }
        }
    }

    #[test]
    fn one_thread_and_many_give_the_same_bits() {
        let (scene, atlas) = strip(0.05);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| lit(&scene, &atlas, |at| (at.x * 1.7).sin() + 2.0).pages)
        };
        assert_eq!(with(1), with(3));
    }
}

//! A picture of the lit scene: what a renderer shows that loads the written files.

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::compare::png;
use super::raster::{Seen, View, draw};
use super::{Atlas, Lightmap, sample, viewpoint};
use crate::scene::{Camera, Scene};

/// Samples of a pixel along each side.
const SAMPLES: usize = 2;
/// What the geometric mean of the metered part of the picture becomes: middle grey.
const KEY: f32 = 0.18;
/// The share of the picture that is metered, from the brightest down.
const METERED: f32 = 0.75;
/// All but this share of it is nowhere brighter than [`WHITE`]: lamps and the brightest highlights may be.
const BRIGHT: f32 = 0.97;
/// Tone mapping shows this as nearly white.
const WHITE: f32 = 1.5;
/// The emptiness around a scene, as displayed.
const BACKGROUND: [u8; 3] = [24, 26, 29];

/// Draws the scene with its lightmap as a PNG file of `width` x `height` pixels: `albedo / pi * irradiance + emission`, exposed by
/// what is lit in it and tone-mapped (AgX). `camera`, or else the file's first, or else a place that sees much of the scene.
pub fn preview(
    scene: &Scene,
    atlas: &Atlas,
    lightmap: &Lightmap,
    camera: Option<&Camera>,
    width: u32,
    height: u32,
) -> Result<Vec<u8>, image::ImageError> {
    let radiance = render(
        scene,
        atlas,
        lightmap,
        camera,
        width as usize,
        height as usize,
    );
    let rgb: Vec<u8> = expose(&radiance);
    png(&rgb, width, height)
}

/// Radiance in cd/m² per pixel, and the share of the pixel that shows anything.
fn render(
    scene: &Scene,
    atlas: &Atlas,
    lightmap: &Lightmap,
    camera: Option<&Camera>,
    width: usize,
    height: usize,
) -> Vec<(Vec3, f32)> {
    let camera = match camera.or(scene.cameras.first()) {
        Some(camera) => camera.clone(),
        None => viewpoint::choose(scene),
    };
    let near = (scene.bounds().size().length() * 1e-4).max(1e-4);
    let view = View::new(&camera, width * SAMPLES, height * SAMPLES, near);
    let mut first = vec![0u32];
    for object in &scene.objects {
        let count = scene.meshes[object.mesh as usize].triangles.len() as u32;
        first.push(first[first.len() - 1] + count);
    }
    let list = |i: u32| {
        let object = first.partition_point(|f| *f <= i) as u32 - 1;
        (object, i - first[object as usize])
    };
    let seen = draw(scene, &view, &list, first[scene.objects.len()]);
    (0..width * height)
        .into_par_iter()
        .map(|pixel| {
            let (x, y) = (pixel % width * SAMPLES, pixel / width * SAMPLES);
            let samples = (0..SAMPLES * SAMPLES).map(|k| (x + k % SAMPLES, y + k / SAMPLES));
            let mut sum = Vec3::ZERO;
            let mut count = 0.0;
            for (x, y) in samples {
                if let Some(seen) = seen[y * view.width + x] {
                    let weights = seen.weights(scene, &view, x as f32 + 0.5, y as f32 + 0.5);
                    sum += radiance(scene, atlas, lightmap, &seen, weights);
                    count += 1.0;
                }
            }
            (
                sum / f32::max(count, 1.0),
                count / (SAMPLES * SAMPLES) as f32,
            )
        })
        .collect()
}

/// What a point of a triangle sends to the camera.
fn radiance(scene: &Scene, atlas: &Atlas, lightmap: &Lightmap, seen: &Seen, weights: Vec3) -> Vec3 {
    let place = &atlas.objects[seen.object as usize];
    let corners = place.layout.triangles[seen.triangle as usize];
    let [a, b, c] = corners.map(|v| place.layout.vertices[v as usize].uv);
    let at = a * weights.x + b * weights.y + c * weights.z + place.origin.as_vec2();
    let page = &lightmap.pages[place.page as usize];
    let taps = sample::taps(at, lightmap.page_size);
    let irradiance: Vec3 = taps.into_iter().map(|(i, w)| Vec3::from(page[i]) * w).sum();
    let albedo = scene.albedo(seen.object, seen.triangle, weights);
    albedo / std::f32::consts::PI * irradiance + scene.emission(seen.object, seen.triangle, weights)
}

/// The factor that exposes a picture: the geometric mean of its better lit part becomes middle grey, but what is brightest
/// stays below white.
///
/// What no light reaches says nothing about how bright the rest should be, however much of the picture it fills.
fn exposure(pixels: &[(Vec3, f32)]) -> f32 {
    const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);
    let mut lit: Vec<f32> = pixels
        .iter()
        .filter(|(_, share)| *share > 0.0)
        .map(|(radiance, _)| radiance.dot(LUMINANCE))
        .filter(|l| l.is_finite() && *l > 0.0)
        .collect();
    lit.par_sort_unstable_by(f32::total_cmp);
    let at = |share: f32| (lit.len() as f32 * share) as usize;
    let Some(&bright) = lit.get(at(BRIGHT)) else {
        return 1.0;
    };
    let seen = &lit[at(1.0 - METERED).min(at(BRIGHT))..=at(BRIGHT)];
    let sum: f64 = seen
        .iter()
        .map(|l| f64::from(l.max(bright * 1e-4)).ln())
        .sum();
    let mean = (sum / seen.len() as f64).exp() as f32;
    (KEY / mean).min(WHITE / bright)
}

/// Exposure and tone mapping to 8-bit sRGB.
fn expose(pixels: &[(Vec3, f32)]) -> Vec<u8> {
    let exposure = exposure(pixels);
    pixels
        .par_iter()
        .flat_map_iter(|&(radiance, share)| {
            let scaled = radiance * exposure;
            let shown = agx(if scaled.is_finite() {
                scaled
            } else {
                Vec3::ZERO
            }) * 255.0;
            let background = Vec3::from(BACKGROUND.map(f32::from));
            (background.lerp(shown, share) + 0.5)
                .to_array()
                .map(|v| v as u8)
        })
        .collect()
}

/// Linear Rec. 709 to display values: AgX (Troy Sobotka) with the polynomial fit of its default contrast by Benjamin Wrensch.
fn agx(color: Vec3) -> Vec3 {
    const INSET: Mat3 = Mat3::from_cols_array(&[
        0.842_479,
        0.042_328_2,
        0.042_375_7,
        0.078_433_6,
        0.878_469,
        0.078_433_6,
        0.079_223_7,
        0.079_166_1,
        0.879_143,
    ]);
    const OUTSET: Mat3 = Mat3::from_cols_array(&[
        1.196_88,
        -0.052_896_9,
        -0.052_971_6,
        -0.098_020_9,
        1.151_9,
        -0.098_043_5,
        -0.099_029_7,
        -0.098_961_2,
        1.151_07,
    ]);
    const STOPS: [f32; 2] = [-12.473_9, 4.026_07];
    let inset = INSET * color.max(Vec3::ZERO);
    let log = inset
        .max(Vec3::splat(1e-10))
        .map(f32::log2)
        .clamp(Vec3::splat(STOPS[0]), Vec3::splat(STOPS[1]));
    let x = (log - STOPS[0]) / (STOPS[1] - STOPS[0]);
    let curve = |x: f32| {
        let x2 = x * x;
        let x4 = x2 * x2;
        15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x
            - 0.00232
    };
    (OUTSET * x.map(curve)).clamp(Vec3::ZERO, Vec3::ONE)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Affine3A;

    use super::super::viewpoint::looking;
    use super::*;
    use crate::lightmap::AtlasOptions;
    use crate::scene::{Material, Mesh, Object, Primitive};

    /// A white square of 2 m in the xy plane that faces +z, and what else `more` adds of it.
    fn scene(more: &[Affine3A]) -> Scene {
        let mesh = Mesh {
            name: "square".into(),
            positions: [(-1., -1.), (1., -1.), (1., 1.), (-1., 1.)]
                .map(|(x, y)| Vec3::new(x, y, 0.0))
                .to_vec(),
            normals: vec![Vec3::Z; 4],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            primitives: vec![Primitive {
                triangles: 0..2,
                vertices: 0..4,
                material: 0,
                source: 0,
            }],
            ..Mesh::default()
        };
        let white = Material::default();
        let object = |transform: &Affine3A| Object {
            name: "square".into(),
            node: 0,
            mesh: 0,
            transform: *transform,
        };
        Scene {
            meshes: vec![Arc::new(mesh)],
            materials: vec![white],
            objects: [Affine3A::IDENTITY]
                .iter()
                .chain(more)
                .map(object)
                .collect(),
            ..Scene::default()
        }
    }

    /// Lights each object's rectangle with its own irradiance and renders 32 x 32 pixels.
    fn show(scene: &Scene, camera: Option<&Camera>) -> Vec<(Vec3, f32)> {
        let options = AtlasOptions {
            density: Some(8.0),
            ..AtlasOptions::default()
        };
        let atlas = Atlas::build(scene, &options).unwrap();
        let size = atlas.page_size;
        let mut page = vec![[0.0; 3]; (size * size) as usize];
        for (i, place) in atlas.objects.iter().enumerate() {
            for y in place.origin.y..place.origin.y + place.size.y {
                for x in place.origin.x..place.origin.x + place.size.x {
                    page[(y * size + x) as usize] = [std::f32::consts::PI * (i + 1) as f32; 3];
                }
            }
        }
        let map = Lightmap {
            page_size: size,
            pages: vec![page],
        };
        render(scene, &atlas, &map, camera, 32, 32)
    }

    fn at(picture: &[(Vec3, f32)], x: usize, y: usize) -> f32 {
        let (radiance, share) = picture[y * 32 + x];
        if share == 0.0 { -1.0 } else { radiance.x }
    }

    #[test]
    fn the_nearer_surface_covers_the_farther_and_backs_are_not_seen() {
        let half = Affine3A::from_scale(Vec3::splat(0.5));
        let nearer = Affine3A::from_translation(Vec3::Z) * half;
        let turned = Affine3A::from_translation(2.0 * Vec3::Z)
            * Affine3A::from_rotation_y(std::f32::consts::PI)
            * half;
        // The mirrored one faces the camera: its triangles are wound the other way round.
        let mirrored = Affine3A::from_translation(Vec3::new(0.75, 0.75, 1.5))
            * Affine3A::from_scale(Vec3::new(-0.2, 0.2, 0.2));
        let scene = scene(&[nearer, turned, mirrored]);
        let picture = show(&scene, Some(&looking(Vec3::Z * 4.0, Vec3::ZERO)));
        let near = |a: f32, b: f32| assert!((a - b).abs() < 1e-3, "{a} {b}");
        near(at(&picture, 16, 16), 2.0);
        near(at(&picture, 8, 22), 1.0);
        near(at(&picture, 0, 0), -1.0);
        near(at(&picture, 24, 7), 4.0);
    }

    #[test]
    fn a_surface_through_the_camera_is_clipped() {
        let scene = scene(&[]);
        let above = Camera {
            transform: Affine3A::from_rotation_x(1.4),
            ..looking(Vec3::ZERO, Vec3::NEG_Z)
        };
        let floor = Camera {
            transform: Affine3A::from_translation(Vec3::new(0.0, 0.0, 0.05)) * above.transform,
            ..above
        };
        let picture = show(&scene, Some(&floor));
        assert_eq!(at(&picture, 16, 31), 1.0, "what lies ahead");
        assert_eq!(at(&picture, 16, 0), -1.0, "the horizon is lower");
    }

    #[test]
    fn a_camera_is_found_that_sees_the_front() {
        let picture = show(&scene(&[]), None);
        let seen = picture.iter().filter(|p| p.1 > 0.0).count();
        assert!(seen > 32 * 32 / 2, "{seen} of 1024 pixels");
    }

    #[test]
    fn tone_mapping_rises_and_keeps_grey_grey() {
        let shown: Vec<f32> = (-20..12)
            .map(|stop| agx(Vec3::splat(0.18 * 2f32.powi(stop))).x)
            .collect();
        assert!(
            shown.is_sorted() && shown[0] < 0.01 && shown[31] > 0.95,
            "{shown:?}"
        );
        let grey = agx(Vec3::splat(0.18));
        assert!(
            (grey.x - grey.y).abs() < 0.01
                && (grey.x - grey.z).abs() < 0.01
                && (0.4..0.6).contains(&grey.x)
        );
        // Nothing lit, nothing finite: still a picture.
        let odd = [
            (Vec3::ZERO, 1.0),
            (Vec3::splat(f32::NAN), 1.0),
            (Vec3::splat(1e38), 0.0),
        ];
        assert_eq!(expose(&odd).len(), 9);
    }
}

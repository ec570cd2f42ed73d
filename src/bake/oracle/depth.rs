//! The depth maps' slow twin: every pixel's ray against every triangle, in double precision.

use glam::{Affine2, DVec3, Vec2, Vec3};

use super::{Numbers, SIZES, around, bounds, gpu, maps, random_light};
use crate::bake::device::records::{self, ShadowSizes, View};
use crate::bake::device::shared::VIEW_HEMICUBE;
use crate::bake::passes::shadow::ShadowPass;
use crate::bake::world::occluders::Occluders;
use crate::bake::world::versions::Versions;
use crate::cluster::VirtualLight;
use crate::gpu::Gpu;
use crate::scene::{AlphaMode, Material, Scene, Texture, TextureRef, Wrap};

/// Where a triangle stops light: (triangle, weights of its corners, how far to ask around). Positive distances: anywhere
/// there; negative: everywhere.
type Stops<'a> = &'a dyn Fn(usize, DVec3, f64) -> bool;

/// Inverse depth of the nearest triangle along `d` (whose component along the face's axis is 1), in double precision;
/// also the same with all triangles grown and shrunk a little, between which any rounding must end.
fn nearest(triangles: &[[Vec3; 3]], stops: Stops, origin: Vec3, d: DVec3, grow: f64) -> f64 {
    triangles
        .iter()
        .enumerate()
        .filter_map(|(index, t)| {
            let [a, b, c] = t.map(|v| (v - origin).as_dvec3());
            let normal = (b - a).cross(c - a);
            let along = normal.dot(a) / normal.dot(d);
            let hit = d * along;
            let weight =
                |p: DVec3, q: DVec3| (q - p).cross(hit - p).dot(normal) / normal.length_squared();
            let weights = DVec3::new(weight(b, c), weight(c, a), weight(a, b));
            let inside = weights.min_element() >= -grow && stops(index, weights, grow);
            (along > 0.0 && inside).then(|| 1.0 / along)
        })
        .fold(0.0, f64::max)
}

/// Small and large triangles, some through the planes of the view's faces, some behind it.
fn triangles(numbers: &mut Numbers, count: usize) -> Vec<[Vec3; 3]> {
    (0..count)
        .map(|i| {
            let center = numbers.vector() * 3.0;
            let size = if i % 10 == 0 { 2.5 } else { 0.15 };
            [0; 3].map(|_| center + numbers.vector() * size)
        })
        .collect()
}

/// Of a view, without the blocks behind them.
fn pixels(view: &View) -> usize {
    let faces = if view.kind == VIEW_HEMICUBE { 3 } else { 1 };
    (faces * view.size * view.size) as usize
}

/// Draws `scene` from two random lights and compares every pixel.
fn compare(gpu: &Gpu, numbers: &mut Numbers, scene: &Scene, triangles: &[[Vec3; 3]], stops: Stops) {
    let occluders = Occluders::new(gpu, scene).expect("upload");
    let mut shadow = ShadowPass::new(gpu, 4 << 20).expect("buffers");
    let versions = Versions::new(gpu, &[true], bounds()).expect("buffers");
    for kind in [1, 4] {
        let light = random_light(numbers, kind);
        let sizes = ShadowSizes { sun: 96, ..SIZES };
        let mut views = Vec::new();
        records::record(&light, 1, &sizes, &around(), &mut views);
        let mut cmd = gpu.commands().expect("recording");
        shadow
            .record(gpu, &mut cmd, &occluders, versions.address(), &maps(&views))
            .expect("recording");
        cmd.submit()
            .expect("submission")
            .wait()
            .expect("no validation message");
        let depth = shadow.read_depth(pixels(&views[0])).expect("read-back");
        let wrong: Vec<_> = (0..)
            .zip(&depth)
            .filter_map(|(index, got)| {
                let (low, high) = pixel_truth(&views[0], index, triangles, stops);
                let got = f64::from(*got);
                // Parallel depths reach 0, where only what is a rounding error of 1 can be asked for.
                let wrong = got < low * (1.0 - 1e-4) - 2e-6 || got > high * (1.0 + 1e-4) + 2e-6;
                wrong.then_some((index, low, got, high))
            })
            .collect();
        assert_eq!(wrong, [], "kind {kind}: of {} pixels", depth.len());
        assert!(depth.iter().any(|d| *d > 0.0), "something was drawn");
    }
}

#[test]
fn depth_maps_hold_the_nearest_triangle_of_every_pixel() {
    let mut numbers = Numbers(11);
    let triangles = triangles(&mut numbers, 300);
    let scene = Scene::of_triangles(&triangles);
    compare(&gpu(), &mut numbers, &scene, &triangles, &|_, _, _| true);
}

/// The plane of a sliver is as good as the digits of its area; what is behind others by its vertices must not come before
/// them, or what is left out as hidden would make a difference.
#[test]
fn slivers_are_no_nearer_than_their_vertices() {
    let (gpu, mut numbers) = (gpu(), Numbers(3));
    let light = VirtualLight {
        position: Vec3::ZERO,
        normal: Vec3::Z,
        surface: Vec3::Z,
        ..random_light(&mut numbers, 1)
    };
    let slivers: Vec<[Vec3; 3]> = (0..40_000)
        .map(|_| {
            // Across the view's axis, so that all of them are as far away.
            let [a, b] = [(); 2].map(|()| (numbers.vector() * 4.0).with_z(6.0));
            [a, b, a.lerp(b, numbers.next()) + numbers.vector() * 1e-5]
        })
        .collect();
    let scene = Scene::of_triangles(&slivers);
    let occluders = Occluders::new(&gpu, &scene).expect("upload");
    let mut shadow = ShadowPass::new(&gpu, 4 << 20).expect("buffers");
    let versions = Versions::new(&gpu, &[true], bounds()).expect("buffers");
    let mut views = Vec::new();
    records::record(&light, 1, &SIZES, &around(), &mut views);
    let mut cmd = gpu.commands().expect("recording");
    shadow
        .record(
            &gpu,
            &mut cmd,
            &occluders,
            versions.address(),
            &maps(&views),
        )
        .expect("recording");
    let wait = cmd.submit().expect("submission").wait();
    wait.expect("no validation message");
    // The face that looks along the normal.
    let top = (views[0].size * views[0].size) as usize;
    let depth = shadow.read_depth(top).expect("read-back");
    let nearest = slivers.iter().flatten().map(|v| v.z).fold(9.0, f32::min);
    let wrong = depth.iter().filter(|d| **d > 1.00001 / nearest).count();
    assert_eq!(wrong, 0, "of {top} pixels");
    assert!(depth.iter().any(|d| *d > 0.0), "something was drawn");
}

/// What stands for fine triangles where pixels are larger hides what they hide, but for a pixel at outlines and a share of a
/// pixel in depth.
#[test]
fn coarser_occluders_hide_what_their_triangles_do() {
    let (gpu, mut numbers) = (gpu(), Numbers(7));
    let light = VirtualLight {
        position: Vec3::ZERO,
        normal: Vec3::Z,
        surface: Vec3::Z,
        ..random_light(&mut numbers, 1)
    };
    // Hilly ground all around, and nothing between its hills and the light.
    let at = |i: i32, j: i32| {
        let (x, y) = (i as f32 * 0.035, j as f32 * 0.035);
        Vec3::new(x, y, 6.0 + (0.7 * x).sin() * (0.9 * y).cos())
    };
    let squares = (-110..110).flat_map(|i| (-110..110).map(move |j| (i, j)));
    let ground: Vec<[Vec3; 3]> = squares
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    let scene = Scene::of_triangles(&ground);
    let occluders = Occluders::new(&gpu, &scene).expect("upload");
    let mut shadow = ShadowPass::new(&gpu, 4 << 20).expect("buffers");
    let versions = Versions::new(&gpu, &[true], bounds()).expect("buffers");
    let mut views = Vec::new();
    records::record(&light, 1, &SIZES, &around(), &mut views);
    let mut draw = |views: &[View]| {
        let before = shadow.counts().expect("read-back").triangles;
        let mut cmd = gpu.commands().expect("recording");
        shadow
            .record(&gpu, &mut cmd, &occluders, versions.address(), &maps(views))
            .expect("recording");
        let wait = cmd.submit().expect("submission").wait();
        wait.expect("no validation message");
        let depth = shadow.read_depth(pixels(&views[0])).expect("read-back");
        let after = shadow.counts().expect("read-back").triangles;
        (depth, after - before)
    };
    let coarse = views[0].coarse;
    let (fewer, drawn) = draw(&views);
    views[0].coarse = 0.0;
    let (all, every) = draw(&views);
    assert!(2 * drawn < every, "{drawn} of {every} triangles");
    let lit = all.iter().filter(|d| **d > 0.0).count();
    let pairs = || all.iter().zip(&fewer).filter(|(a, _)| **a > 0.0);
    let off = |(a, b): &(&f32, &f32)| (1.0 / **a - 1.0 / **b).abs() > 4.0 * coarse / **a;
    let wrong = pairs().filter(off).count();
    assert!(lit > 1000 && 50 * wrong < lit, "{wrong} of {lit} pixels");
}

#[test]
fn masked_texels_let_light_pass() {
    const SIZE: usize = 37;
    const WRAPS: [Wrap; 3] = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];
    let mut numbers = Numbers(5);
    let triangles = triangles(&mut numbers, 240);
    let mut scene = Scene::of_triangles(&triangles);
    // Blocks of texels, so that some triangles lie within one.
    let alpha = |x: usize, y: usize| {
        if (x / 5 * 7 + y / 6 * 3) % 4 < 2 {
            153
        } else {
            152
        }
    };
    scene.textures.push(
        Texture {
            width: SIZE as u32,
            height: SIZE as u32,
            texels: (0..SIZE * SIZE)
                .map(|i| [9, 9, 9, alpha(i % SIZE, i / SIZE)])
                .collect(),
        }
        .into(),
    );
    let transform = Affine2::from_scale_angle_translation(Vec2::new(0.7, 1.2), 0.4, Vec2::X);
    scene.materials = WRAPS
        .iter()
        .map(|wrap| Material {
            base_color_texture: Some(TextureRef {
                texture: 0,
                texcoord: 1,
                transform,
                wrap: [*wrap, WRAPS[0]],
            }),
            alpha: AlphaMode::Mask { cutoff: 0.599 },
            ..scene.materials[0].clone()
        })
        .collect();
    let mut mesh = (*scene.meshes[0]).clone();
    let uvs: Vec<Vec2> = (0..triangles.len())
        .flat_map(|i| {
            let spread = if i % 3 == 0 { 0.05 } else { 1.5 };
            let center = numbers.vector() * 2.0;
            [0; 3].map(|_| (center + numbers.vector() * spread).truncate())
        })
        .collect();
    mesh.texcoords[1] = uvs.clone();
    let whole = mesh.primitives[0].clone();
    mesh.primitives = (0..3)
        .map(|material| crate::scene::Primitive {
            triangles: material * 80..(material + 1) * 80,
            vertices: material * 240..(material + 1) * 240,
            material,
            ..whole.clone()
        })
        .collect();
    scene.meshes[0] = mesh.into();

    let stops = |triangle: usize, weights: DVec3, grow: f64| {
        let wrap = WRAPS[triangle / 80];
        let uv = [0, 1, 2].map(|k| transform.transform_point2(uvs[3 * triangle + k]).as_dvec2());
        let uv = uv[0] * weights.x + uv[1] * weights.y + uv[2] * weights.z;
        let texel = |at: f64, wrap: Wrap| {
            let at = match wrap {
                Wrap::Repeat => at.rem_euclid(1.0),
                Wrap::Mirror if at.rem_euclid(2.0) > 1.0 => 2.0 - at.rem_euclid(2.0),
                Wrap::Mirror => at.rem_euclid(2.0),
                Wrap::Clamp => at.clamp(0.0, 1.0),
            };
            ((at * SIZE as f64) as usize).min(SIZE - 1)
        };
        // Slivers lose digits: asked for within three quarters of a texel.
        let mut near = (0..25).map(|i| {
            let around = glam::DVec2::new(f64::from(i % 5), f64::from(i / 5)) - 2.0;
            let at = uv + around * 5.0 * grow.abs();
            alpha(texel(at.x, wrap), texel(at.y, WRAPS[0])) == 153
        });
        if grow < 0.0 {
            near.all(|stops| stops)
        } else {
            near.any(|stops| stops)
        }
    };
    compare(&gpu(), &mut numbers, &scene, &triangles, &stops);
}

/// Bounds of what pixel `index` of `view` may hold.
fn pixel_truth(view: &View, index: u32, triangles: &[[Vec3; 3]], stops: Stops) -> (f64, f64) {
    let size = view.size;
    let axes = [view.x, view.y, view.z].map(|a| Vec3::from_array(a).as_dvec3());
    let center = |i: u32| (f64::from(i) + 0.5) * 2.0 / f64::from(size) - 1.0;
    if view.kind == crate::bake::device::shared::VIEW_ORTHOGRAPHIC {
        // A ray from the light's side; the stored value is z . (hit - origin).
        let [x, y, z] = axes;
        let (s, t) = (center(index % size), center(index / size));
        let base = x * (s / x.length_squared())
            + y * (t / y.length_squared())
            + Vec3::from_array(view.origin).as_dvec3();
        let start = base + z / z.length_squared() * 2.0;
        let d = -z / z.length_squared();
        let value = |grow| {
            let inverse = nearest(triangles, stops, start.as_vec3(), d, grow);
            if inverse > 0.0 {
                (2.0 - 1.0 / inverse).max(0.0)
            } else {
                0.0
            }
        };
        return (value(-2e-3), value(2e-3));
    }
    let (face, column, row) = if index < size * size {
        (0, index % size, index / size)
    } else {
        let rest = index - size * size;
        let half = size * size / 2;
        (1 + rest / half, rest % half % size, rest % half / size)
    };
    let [x, y, z] = axes;
    let (u, v, w) = [(x, y, z), (y, z, x), (y, z, -x), (x, z, y), (x, z, -y)][face as usize];
    let t = if face == 0 {
        center(row)
    } else {
        center(row) + 1.0
    };
    let d = u * center(column) + v * t + w;
    let value = |grow| nearest(triangles, stops, Vec3::from_array(view.origin), d, grow);
    (value(-2e-3), value(2e-3))
}

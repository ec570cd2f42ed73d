//! Paths, held to closed forms and to each other.

use super::*;
use crate::scene::Aperture;
use crate::transport::testing::{cornell, light, room};
use glam::Affine3A;

fn furnace(albedo: f32, max_bounces: u32, paths: u32) -> PathSet {
    let mut scene = room(albedo);
    scene
        .lights
        .push(light(Aperture::Point, Vec3::ONE, Affine3A::IDENTITY));
    let bvh = SceneBvh::build(&scene);
    trace(
        &scene,
        &bvh,
        &PathSettings {
            max_bounces,
            ..PathSettings::for_paths(&scene, paths)
        },
    )
}

#[test]
fn a_closed_room_keeps_the_geometric_series() {
    let paths = furnace(0.5, 16, 8192);
    let b = paths.balance();
    assert_eq!(b.escaped, 0.0);
    assert!((b.sent - b.first_hit).abs() < 1e-9);
    assert!(b.error() < 1e-9, "{b:?}");
    // albedo / (1 - albedo), the tail after 16 bounces being 2^-16.
    assert!((b.reflected / b.sent - 1.0).abs() < 0.02, "{b:?}");
    assert!((b.gained - b.ended).abs() < 0.02 * b.sent);
    // Equal energy: nothing but the roulette thins the paths out, so every VPL carries the same.
    let flux = paths.vpls().next().expect("a VPL").flux;
    assert!(
        paths
            .vpls()
            .all(|v| (v.flux - flux).abs().max_element() < 1e-4 * flux.x)
    );
}

#[test]
fn a_cap_on_bounces_is_reported() {
    let b = furnace(0.8, 3, 4096).balance();
    assert!(b.error() < 1e-9);
    assert!((b.lost_at_cap / b.sent - 0.512).abs() < 0.02, "{b:?}");
    let direct = furnace(0.8, 0, 128);
    assert_eq!((direct.vpls().count(), direct.paths()), (0, 128));
    assert!((direct.balance().lost_at_cap / direct.balance().sent - 1.0).abs() < 1e-9);
}

#[test]
fn paths_are_a_prefix_and_do_not_depend_on_threads() {
    let scene = cornell();
    let bvh = SceneBvh::build(&scene);
    let settings = PathSettings::for_paths(&scene, 3000);
    let all = trace(&scene, &bvh, &settings);
    let single = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a pool");
    assert_eq!(single.install(|| trace(&scene, &bvh, &settings)), all);
    let mut dimmed = scene.clone();
    dimmed.materials[5].emission *= 0.5;
    let half = trace(&dimmed, &bvh, &settings);
    let n = half.paths();
    assert_eq!(n, 1500);
    assert_eq!(half.lights[&11].paths, all.lights[&11].paths[..n]);
    for (i, path) in half.lights[&11].paths.iter().enumerate() {
        for (b, vpl) in path.vpls.iter().enumerate() {
            assert_eq!((vpl.key.path as usize, vpl.key.bounce as usize), (i, b));
        }
    }
    let b = all.balance();
    assert!(b.error() < 1e-9 && b.escaped > 0.0 && b.reflected > 0.0);
    // The back of the lamp is single-sided and swallows: no VPL lies on it, none faces away from the room.
    assert!(
        all.vpls()
            .all(|v| v.position.abs().max_element() < 1.001 && v.object != 5)
    );
}

#[test]
fn a_path_goes_on_from_any_of_its_rays() {
    let scene = cornell();
    let bvh = SceneBvh::build(&scene);
    let settings = PathSettings {
        max_bounces: 5,
        ..PathSettings::for_paths(&scene, 500)
    };
    let tracer = Tracer::new(&scene, &bvh, &settings);
    let mut longest = 0;
    for (i, path) in trace(&scene, &bvh, &settings).lights[&11]
        .paths
        .iter()
        .enumerate()
    {
        for first in 0..path.rays().count() {
            assert_eq!(tracer.path_from(11, i as u32, path, first), *path);
        }
        for (ray, (origin, scatter)) in path.rays().enumerate() {
            let end = path.vpls.get(ray).map(|v| v.position);
            let met = origin + scatter.direction * scatter.distance;
            assert!(end.is_none_or(|e| e.distance(met) < 1e-3));
            assert_eq!(
                scatter.object == Scatter::NOTHING,
                scatter.distance == f32::INFINITY
            );
        }
        longest = longest.max(path.vpls.len());
    }
    assert_eq!(longest, 5);
}

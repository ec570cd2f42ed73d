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
fn paths_do_not_depend_on_threads_or_on_how_bright_their_light_is() {
    let scene = cornell();
    let bvh = SceneBvh::build(&scene);
    let settings = PathSettings::for_paths(&scene, 3000);
    let all = trace(&scene, &bvh, &settings);
    let single = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a pool");
    assert_eq!(single.install(|| trace(&scene, &bvh, &settings)), all);
    let relit = |factor: Vec3| {
        let mut scene = scene.clone();
        scene.materials[5].emission *= factor;
        trace(&scene, &bvh, &settings)
    };
    let flux = |paths: &PathSet| paths.vpls().map(|v| v.flux.as_dvec3()).sum::<glam::DVec3>();
    for factor in [
        Vec3::splat(0.01),
        Vec3::splat(0.7),
        Vec3::splat(1.9),
        Vec3::new(0.2, 1.0, 0.0),
    ] {
        let other = relit(factor);
        assert_eq!(other.paths(), all.paths());
        for (a, b) in all.vpls().zip(other.vpls()) {
            let flux = (a.flux * factor - b.flux).abs().max_element();
            assert!(flux <= 1e-3 * a.flux.max_element());
            assert_eq!(Vpl { flux: a.flux, ..*b }, *a);
        }
        let error = flux(&all) * factor.as_dvec3() - flux(&other);
        assert!(error.abs().max_element() < 1e-5 * flux(&all).max_element());
    }
    // A path never carries more than twice what it did.
    for (factor, paths) in [(2.1, 6000), (4.1, 12_000), (32.0, 48_000)] {
        let brighter = relit(Vec3::splat(factor));
        assert_eq!(brighter.paths(), paths);
        for (a, b) in all.vpls().zip(
            brighter.lights[&11].paths[..3000]
                .iter()
                .flat_map(|p| &p.vpls),
        ) {
            assert_eq!((a.key, a.position), (b.key, b.position));
        }
        let sent = [&brighter, &all].map(|p| p.balance().sent);
        assert!((sent[0] / sent[1] / f64::from(factor) - 1.0).abs() < 1e-5);
    }
    for (i, path) in all.lights[&11].paths.iter().enumerate() {
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
        // Without a ray, from what the path was when its light shone otherwise.
        let brighter = Path {
            energy: path.energy * 2.0,
            vpls: path
                .vpls
                .iter()
                .map(|v| Vpl {
                    flux: v.flux * 2.0,
                    ..*v
                })
                .collect(),
            balance: FluxBalance::default(),
            ..path.clone()
        };
        assert_eq!(tracer.path_from(11, i as u32, &brighter, usize::MAX), *path);
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

#[test]
fn a_light_that_sends_less_than_a_path_carries_has_one_that_counts_less() {
    let mut scene = room(0.5);
    for intensity in [1.0, 1e-4, 0.0] {
        let mut lamp = light(Aperture::Point, Vec3::splat(intensity), Affine3A::IDENTITY);
        lamp.node = scene.lights.len() as u32;
        scene.lights.push(lamp);
    }
    let bvh = SceneBvh::build(&scene);
    let paths = trace(&scene, &bvh, &PathSettings::for_paths(&scene, 100));
    let [strong, weak, off] = [0, 2, 4].map(|id| &paths.lights[&id]);
    assert_eq!([strong, weak, off].map(|l| l.paths.len()), [100, 1, 0]);
    assert!((weak.weight - 0.01).abs() < 1e-4 && (strong.weight - 1.0).abs() < 1e-3);
    let first = |light: &LightPaths| light.paths[0].vpls[0];
    let (strong, weak) = (first(strong), first(weak));
    assert!((weak.flux / strong.flux - 0.01).abs().max_element() < 1e-4);
    assert!((weak.weight / strong.weight - 0.01).abs() < 1e-4);
}

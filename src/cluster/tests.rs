//! From paths to virtual lights: flux, order and threads.

use super::*;
use crate::transport::bvh::SceneBvh;
use crate::transport::testing::cornell;
use crate::transport::trace;

fn clusters(paths: u32) -> (Scene, SceneBvh, PathSet, Clusters) {
    let scene = cornell();
    let bvh = SceneBvh::build(&scene);
    let settings = PathSettings::for_paths(&scene, paths);
    let set = trace(&scene, &bvh, &settings);
    let clusters = Clusters::new(&scene, &set, &settings, SimilaritySettings::default());
    (scene, bvh, set, clusters)
}

#[test]
fn every_cut_carries_all_flux() {
    let (_, _, set, clusters) = clusters(8192);
    let direct: f64 = set.lights.values().map(|l| f64::from(l.flux.x)).sum();
    let bounced: f64 = set.vpls().map(|v| f64::from(v.flux.x)).sum();
    for budget in [
        Budget::Cells(1),
        Budget::Cells(40),
        Budget::Cells(5000),
        Budget::Auto { error: 0.01 },
    ] {
        let cut = clusters.select(budget);
        let lights: Vec<VirtualLight> = clusters
            .virtual_lights(&cut)
            .into_iter()
            .flat_map(|s| s.lights)
            .collect();
        let sum = |direct: bool| {
            lights
                .iter()
                .filter(|l| l.direct == direct)
                .map(|l| f64::from(l.flux.x))
                .sum::<f64>()
        };
        assert!(
            (sum(true) / direct - 1.0).abs() < 1e-5 && (sum(false) / bounced - 1.0).abs() < 1e-5,
            "{budget:?}"
        );
        let finite = |l: &VirtualLight| {
            l.position.is_finite() && l.flux.is_finite() && l.normal.is_normalized()
        };
        assert!(lights.iter().all(finite));
    }
}

#[test]
fn lights_do_not_depend_on_threads() {
    let lights = || {
        let (_, _, _, clusters) = clusters(4096);
        clusters.virtual_lights(&clusters.select(Budget::Cells(150)))
    };
    let single = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a pool");
    assert_eq!(single.install(lights), lights());
}

#[test]
fn a_few_hundred_lights_stand_for_all_vpls() {
    let (scene, bvh, set, clusters) = clusters(16_384);
    let selected = clusters.virtual_lights(&clusters.select(Budget::Cells(250)));
    let sum = |lights: &mut dyn Iterator<Item = VirtualLight>, p: Vec3, n: Vec3| {
        lights
            .map(|l| evaluate::irradiance(&scene, &bvh, &l, p, n))
            .sum::<Vec3>()
            .y
    };
    let point = |v: &crate::transport::Vpl| VirtualLight {
        shape: Shape::Disk { area: 1e-3 },
        position: crate::transport::intersect::offset(v.position, v.normal),
        normal: v.normal,
        surface: v.normal,
        flux: v.flux,
        direct: false,
    };
    let mut errors = Vec::new();
    let (mut total, mut exact_total) = (0.0, 0.0);
    for i in 0..960 {
        // In the air, away from what a point light makes bright.
        let p = Vec3::new(
            i as f32 / 960.0 - 0.5,
            0.3 + 0.2 * (i % 3) as f32,
            0.3 - 0.25 * (i % 4) as f32,
        );
        let n = [Vec3::Y, Vec3::NEG_Y, Vec3::X, Vec3::NEG_X, Vec3::Z][i % 5];
        let exact = sum(&mut set.vpls().map(point), p, n);
        let found = sum(
            &mut selected
                .iter()
                .flat_map(|s| s.lights.clone())
                .filter(|l| !l.direct),
            p,
            n,
        );
        errors.push((found / exact - 1.0).abs());
        (total, exact_total) = (total + found, exact_total + exact);
    }
    errors.sort_by(f32::total_cmp);
    assert!(errors[480] < 0.035 && errors[880] < 0.1, "{errors:?}");
    assert!(
        (total / exact_total - 1.0).abs() < 0.03,
        "{total} {exact_total}"
    );
}

//! How well virtual lights stand for the light: against path-traced truth at random surface points, by count and settings.
//!
//! `cargo bench --bench accuracy -- SCENE.gltf [POINTS [PATHS_PER_POINT]]`; without a scene, the built-in Cornell box.

use std::time::Instant;

use glam::Vec3;
use rayon::prelude::*;
use rebake::cluster::evaluate::irradiance;
use rebake::cluster::{Budget, Clusters, Shape, SimilaritySettings, VirtualLight};
use rebake::scene::{Aperture, Scene};
use rebake::transport::bvh::{SceneBvh, weights};
use rebake::transport::emission::{Emitter, SpotFalloff, mean};
use rebake::transport::intersect::offset;
use rebake::transport::paths::{PathSettings, emitters};
use rebake::transport::sampling::{Distribution, Sequence, cosine_hemisphere, triangle};
use rebake::transport::trace;

struct Point {
    position: Vec3,
    normal: Vec3,
    direct: f32,
    bounced: f32,
}

/// From a point and its direct and bounced light found: the value, the truth, and what the error is relative to.
type Measure = dyn Fn(&Point, (f32, f32)) -> Option<(f32, f32, f32)>;

fn main() {
    let args: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let scene = match args.first() {
        Some(path) => Scene::load(path.as_ref()).expect("a readable scene").0,
        None => {
            Scene::from_document(&rebake::scene::builtin::builtin("cornell").expect("built in"))
                .expect("a scene")
        }
    };
    let number =
        |i: usize, default: usize| args.get(i).and_then(|a| a.parse().ok()).unwrap_or(default);
    let (count, samples) = (number(1, 500), number(2, 4096));
    let start = Instant::now();
    let bvh = SceneBvh::build(&scene);
    println!(
        "{} triangles, BVH {:.0} ms",
        bvh.triangles(),
        start.elapsed().as_secs_f64() * 1e3
    );
    let points = cached_truth(
        &scene,
        &bvh,
        args.first().map_or("cornell", |a| a),
        count,
        samples as u32,
    );

    for paths in [1 << 17] {
        let start = Instant::now();
        let path_settings = PathSettings::for_paths(&scene, paths);
        let set = trace(&scene, &bvh, &path_settings);
        let balance = set.balance();
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "{} paths, {} VPLs in {:.0} ms, {balance:?}",
            set.paths(),
            set.vpls().count(),
            seconds * 1e3
        );
        for settings in [SimilaritySettings::default()] {
            let start = Instant::now();
            let clusters = Clusters::new(&scene, &set, &path_settings, settings);
            println!(
                "clusters {:.0} ms, {settings:?}",
                start.elapsed().as_secs_f64() * 1e3
            );
            for error in [3e-3, 1e-3, 5e-4, 2e-4, 1e-4] {
                let start = Instant::now();
                let cut = clusters.select(Budget::Auto { error });
                let selected = clusters.virtual_lights(&cut);
                let lights: Vec<VirtualLight> =
                    selected.into_iter().flat_map(|s| s.lights).collect();
                let (direct, bounced): (Vec<_>, Vec<_>) =
                    lights.into_iter().partition(|l| l.direct);
                let polygons = bounced
                    .iter()
                    .filter(|l| matches!(l.shape, Shape::Polygon { .. }))
                    .count();
                let carried: f64 = bounced.iter().map(|l| f64::from(mean(l.flux))).sum();
                let by_polygons: f64 = bounced
                    .iter()
                    .filter(|l| matches!(l.shape, Shape::Polygon { .. }))
                    .map(|l| f64::from(mean(l.flux)))
                    .sum();
                println!(
                    "error {error:e}: {} cells -> {} direct, {polygons} polygons ({:.0} % of the flux), {} disks; {:.0} ms; flux {:.6}",
                    cut.cells.len(),
                    direct.len(),
                    100.0 * by_polygons / carried,
                    bounced.len() - polygons,
                    start.elapsed().as_secs_f64() * 1e3,
                    carried / balance.reflected
                );
                compare(&scene, &bvh, &points, &direct, &bounced);
            }
        }
    }
}

fn compare(
    scene: &Scene,
    bvh: &SceneBvh,
    points: &[Point],
    direct: &[VirtualLight],
    bounced: &[VirtualLight],
) {
    let sum = |lights: &[VirtualLight], p: &Point| {
        lights
            .iter()
            .map(|l| mean(irradiance(scene, bvh, l, p.position, p.normal)))
            .sum::<f32>()
    };
    let found: Vec<(f32, f32)> = points
        .par_iter()
        .map(|p| (sum(direct, p), sum(bounced, p)))
        .collect();
    let average = points.iter().map(|p| p.direct + p.bounced).sum::<f32>() / points.len() as f32;
    let report = |name: &str, of: &Measure| {
        let pairs: Vec<(f32, f32, f32)> = points
            .iter()
            .zip(&found)
            .filter(|(p, _)| p.direct + p.bounced > 0.02 * average)
            .filter_map(|(p, &f)| of(p, f))
            .collect();
        let mut errors: Vec<f32> = pairs.iter().map(|(v, t, r)| (v - t).abs() / r).collect();
        errors.sort_by(f32::total_cmp);
        let at = |q: f32| 100.0 * errors[((errors.len() - 1) as f32 * q) as usize];
        let bias = 100.0
            * (pairs.iter().map(|p| p.0).sum::<f32>() / pairs.iter().map(|p| p.1).sum::<f32>()
                - 1.0);
        println!(
            "    {name:28} bias {bias:6.2} %  median {:5.2} %  p95 {:5.1} %  ({} points)",
            at(0.5),
            at(0.95),
            pairs.len()
        );
    };
    report("all", &|p, f| {
        Some((f.0 + f.1, p.direct + p.bounced, p.direct + p.bounced))
    });
    report("direct exact", &|p, f| {
        Some((p.direct + f.1, p.direct + p.bounced, p.direct + p.bounced))
    });
    report("bounced part", &|p, f| {
        (p.bounced > 0.0).then_some((f.1, p.bounced, p.bounced))
    });
    report("all, lit mainly by bounces", &|p, f| {
        (p.bounced > p.direct).then_some((f.0 + f.1, p.direct + p.bounced, p.direct + p.bounced))
    });
}

fn cached_truth(
    scene: &Scene,
    bvh: &SceneBvh,
    name: &str,
    count: usize,
    samples: u32,
) -> Vec<Point> {
    let file = std::env::temp_dir().join(format!(
        "rebake-truth-{}-{count}-{samples}.txt",
        name.replace('/', "_")
    ));
    let mut points = surface_points(scene, count);
    if let Ok(text) = std::fs::read_to_string(&file) {
        for (p, line) in points.iter_mut().zip(text.lines()) {
            let mut values = line.split(' ').map(|v| v.parse().expect("a number"));
            (p.direct, p.bounced) = (
                values.next().expect("direct"),
                values.next().expect("bounced"),
            );
        }
        return points;
    }
    let start = Instant::now();
    let emitters = emitters(scene);
    points.par_iter_mut().enumerate().for_each(|(i, p)| {
        (p.direct, p.bounced) = truth(scene, bvh, &emitters, p, i as u32, samples)
    });
    println!("truth in {:.1} s", start.elapsed().as_secs_f64());
    let text: String = points
        .iter()
        .map(|p| format!("{} {}\n", p.direct, p.bounced))
        .collect();
    std::fs::write(file, text).expect("a temporary file");
    points
}

fn surface_points(scene: &Scene, count: usize) -> Vec<Point> {
    let triangles: Vec<(u32, u32)> = (0..scene.objects.len() as u32)
        .flat_map(|o| (0..scene.mesh(o).triangles.len() as u32).map(move |t| (o, t)))
        .collect();
    let areas = triangles.iter().map(|&(o, t)| {
        let [a, b, c] = scene.world_triangle(o, t);
        f64::from((b - a).cross(c - a).length())
    });
    let by_area = Distribution::new(areas);
    let sequence = Sequence::new(4711, 0);
    (0..count as u32)
        .map(|i| {
            let [choice, u, v, _] = sequence.sample(i, 0);
            let (o, t) = triangles[by_area.choose(choice)];
            let [a, b, c] = scene.world_triangle(o, t);
            let [s, t] = triangle([u, v]);
            Point {
                position: a + (b - a) * s + (c - a) * t,
                normal: (b - a).cross(c - a).normalize(),
                direct: 0.0,
                bounced: 0.0,
            }
        })
        .collect()
}

/// Mean over RGB of direct and bounced irradiance, by path tracing with next-event estimation.
fn truth(
    scene: &Scene,
    bvh: &SceneBvh,
    emitters: &[Emitter],
    point: &Point,
    index: u32,
    samples: u32,
) -> (f32, f32) {
    let sequence = Sequence::new(99, index);
    let (mut direct, mut bounced) = (0.0f64, 0.0f64);
    for i in 0..samples {
        direct += f64::from(mean(direct_light(
            scene,
            bvh,
            emitters,
            point.position,
            point.normal,
            sequence.sample(i, 0),
        )));
        let (mut position, mut normal, mut through) = (point.position, point.normal, Vec3::ONE);
        for bounce in 0..32 {
            let [u, v, roulette, _] = sequence.sample(i, 2 + 2 * bounce);
            let Some(hit) = bvh.closest(
                scene,
                offset(position, normal),
                cosine_hemisphere(normal, [u, v]),
                f32::INFINITY,
            ) else {
                break;
            };
            if !hit.front && !scene.materials[hit.material as usize].double_sided {
                break;
            }
            through *= scene.albedo(hit.object, hit.triangle, weights(hit.bary));
            position = hit.position;
            normal = if hit.front { hit.normal } else { -hit.normal };
            bounced += f64::from(mean(
                through
                    * direct_light(
                        scene,
                        bvh,
                        emitters,
                        position,
                        normal,
                        sequence.sample(i, 3 + 2 * bounce),
                    ),
            ));
            let survival = through.max_element().min(1.0);
            if bounce > 2 {
                if roulette >= survival {
                    break;
                }
                through /= survival;
            }
        }
    }
    (
        (direct / f64::from(samples)) as f32,
        (bounced / f64::from(samples)) as f32,
    )
}

fn direct_light(
    scene: &Scene,
    bvh: &SceneBvh,
    emitters: &[Emitter],
    position: Vec3,
    normal: Vec3,
    u: [f32; 4],
) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for (l, light) in scene.lights.iter().enumerate() {
        let origin = Vec3::from(light.transform.translation);
        let to = origin - position;
        let aim = -Vec3::from(light.transform.matrix3.z_axis).normalize();
        let cos = normal.dot(to.normalize_or_zero()).max(0.0);
        let (e, target) = match light.aperture {
            Aperture::Point => (light.intensity * (cos / to.length_squared()), origin),
            Aperture::Spot { inner, outer } => {
                let falloff = SpotFalloff::new(inner, outer).at(-aim.dot(to.normalize_or_zero()));
                (
                    light.intensity * (falloff * cos / to.length_squared()),
                    origin,
                )
            }
            Aperture::Directional => (
                light.intensity * (-aim.dot(normal)).max(0.0),
                position - aim * 1e4,
            ),
            Aperture::Surface { .. } => {
                let pieces = emitters[l].pieces();
                let total: f32 = pieces.iter().map(|p| mean(p.flux())).sum();
                let mut left = u[0] * total;
                let piece = pieces.iter().find(|p| {
                    left -= mean(p.flux());
                    left < 0.0
                });
                let piece = piece.unwrap_or(&pieces[pieces.len() - 1]);
                let [a, b, c] = piece.corners;
                let [s, t] = triangle([u[1], u[2]]);
                let q = a + (b - a) * s + (c - a) * t;
                let to = q - position;
                let d2 = to.length_squared();
                let cos = normal.dot(to).max(0.0) / d2.sqrt();
                let along = -piece.normal.dot(to) / d2.sqrt();
                let cos_light = if piece.double_sided {
                    along.abs()
                } else {
                    along.max(0.0)
                };
                let density = mean(piece.flux()) / total / piece.area();
                (
                    piece.radiance * (cos * cos_light / d2 / density),
                    offset(q, piece.normal * along.signum()),
                )
            }
        };
        if e == Vec3::ZERO || !e.is_finite() {
            continue;
        }
        let from = offset(position, normal);
        if !bvh.occluded(
            scene,
            from,
            (target - from).normalize(),
            from.distance(target),
        ) {
            sum += e;
        }
    }
    sum
}

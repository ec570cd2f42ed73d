//! Rates of the CPU side of a bake: rays, paths and VPLs a second on a real scene.
//!
//! `cargo bench --bench transport -- SCENE.gltf`; without a scene, the built-in Cornell box. Rates and times are
//! those of one core: processor time, whatever the number of threads.

use std::hint::black_box;
use std::time::Instant;

use glam::{Affine3A, Vec3};
use rebake::cluster::{Budget, Clusters, FluxScale, Octree, SimilaritySettings, Wanted};
use rebake::scene::Scene;
use rebake::scene::edit::Change;
use rebake::transport::Validator;
use rebake::transport::bvh::SceneBvh;
use rebake::transport::intersect::offset;
use rebake::transport::paths::{PathSettings, trace};
use rebake::transport::sampling::{Sequence, cosine_hemisphere};

fn main() {
    let args: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let name = args.first().map_or("cornell", |a| a);
    let scene = match args.first() {
        Some(path) => Scene::load(path.as_ref()).expect("a readable scene").0,
        None => {
            Scene::from_document(&rebake::scene::builtin::builtin("cornell").expect("built in"))
                .expect("a scene")
        }
    };
    let build = || SceneBvh::build(&scene);
    let (bvh, seconds) = best(build);
    println!(
        "{name}: {} triangles, {} objects, {} lights, {} threads, seed 0",
        bvh.triangles(),
        scene.objects.len(),
        scene.lights.len(),
        rayon::current_num_threads()
    );
    println!("BVH built in {:.0} ms of one core", seconds * 1e3);
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");

    let settings = PathSettings {
        max_bounces: 3,
        ..PathSettings::for_paths(&scene, 1 << 16)
    };
    let (set, seconds) = best(|| one.install(|| trace(&scene, &bvh, &settings)));
    let paths = set.paths() as f64;
    println!(
        "{paths} paths of up to 3 bounces: {:.2} M/s a core, {:.2} VPLs a path",
        paths / seconds / 1e6,
        set.vpls().count() as f64 / paths
    );

    // From every VPL once more, in an order that no cache likes.
    let sequence = Sequence::new(1, 0);
    let vpls: Vec<_> = set.vpls().copied().collect();
    let count = 200_000.min(vpls.len() * 4) as u32;
    let (hits, seconds) = best(|| {
        let ray = |i: u32| {
            let vpl = &vpls[i as usize * 7919 % vpls.len()];
            let [u, v, ..] = sequence.sample(i % (1 << 16), 2);
            (
                offset(vpl.position, vpl.normal),
                cosine_hemisphere(vpl.normal, [u, v]),
            )
        };
        (0..count)
            .filter(|&i| {
                bvh.closest(&scene, ray(i).0, ray(i).1, f32::INFINITY)
                    .is_some()
            })
            .count()
    });
    println!(
        "incoherent closest hits: {:.2} M/s a core ({hits} of {count} hit)",
        f64::from(count) / seconds / 1e6
    );

    let settings = PathSettings::for_paths(&scene, 1 << 17);
    let (set, seconds) = best(|| trace(&scene, &bvh, &settings));
    println!(
        "{} paths, up to 16 bounces, {} VPLs: {:.0} ms",
        set.paths(),
        set.vpls().count(),
        seconds * 1e3
    );
    let scale = FluxScale::new(settings.flux_per_path);
    let (tree, seconds) = best(|| Octree::build(scale, set.vpls()));
    println!("octree at once: {:.0} ms of one core", seconds * 1e3);
    let (added, seconds) = best(|| {
        let mut tree = Octree::new(scale);
        set.vpls().for_each(|v| tree.add(v));
        tree
    });
    assert_eq!(added, tree);
    println!(
        "octree one by one: {:.2} M VPLs/s",
        set.vpls().count() as f64 / seconds / 1e6
    );
    let clusters = Clusters::new(&scene, &set, &settings, SimilaritySettings::default());
    let (lights, seconds) =
        best(|| clusters.virtual_lights(&clusters.select(Budget::Auto { error: 5e-4 })));
    let count: usize = lights.iter().map(|s| s.lights.len()).sum();
    println!(
        "{} cells selected, {count} virtual lights made: {:.0} ms of one core",
        lights.len(),
        seconds * 1e3
    );
    one.install(|| local_edit(&scene, &bvh, &settings));
}

/// An object moved that about 1 % of the paths come near: what it costs to follow it, on one core.
fn local_edit(scene: &Scene, bvh: &SceneBvh, settings: &PathSettings) {
    let before = Validator::new(scene, bvh, settings);
    let paths = before.paths().paths();
    let size = scene.bounds().size().max_element();
    let moved = |object: usize| {
        let mut edited = scene.clone();
        let to = Affine3A::from_translation(Vec3::new(0.01, 0.0, 0.01) * size);
        edited.objects[object].transform = to * edited.objects[object].transform;
        let change = Change::between(scene, &edited);
        (edited, change)
    };
    let share = |object: usize| {
        let (edited, change) = moved(object);
        let mut validator = before.clone();
        validator.invalidate(&edited, &change);
        (validator.invalid_paths() as f64 / paths as f64 / 0.01)
            .ln()
            .abs()
    };
    let step = scene.objects.len().div_ceil(60);
    let object = (0..scene.objects.len())
        .step_by(step)
        .filter(|&o| scene.lights.iter().all(|l| l.node != scene.objects[o].node))
        .min_by(|&a, &b| share(a).total_cmp(&share(b)))
        .unwrap_or(0);
    let (edited, change) = moved(object);
    let (bvh, seconds) = best_of(|| (), |()| bvh.moved(&edited, &change.objects));
    println!(
        "object {object} moved by 1 % of the scene: tree in {:.1} ms",
        seconds * 1e3
    );
    let (invalid, marking) = best_of(
        || before.clone(),
        |mut v| {
            v.invalidate(&edited, &change);
            v
        },
    );
    let ((after, differences), tracing) = best_of(
        || invalid.clone(),
        |mut v| {
            let differences = v.step(&edited, &bvh, usize::MAX);
            (v, differences)
        },
    );
    println!(
        "validated {:.1} M paths/s: {} of {paths} marked in {:.1} ms, traced in {:.1} ms; {} VPLs removed, {} added, {} rescattered",
        paths as f64 / (marking + tracing) / 1e6,
        invalid.invalid_paths(),
        marking * 1e3,
        tracing * 1e3,
        differences.removed.len(),
        differences.added.len(),
        differences.rescattered.len()
    );
    let clusters = Clusters::new(
        scene,
        before.paths(),
        settings,
        SimilaritySettings::default(),
    );
    let (applied, seconds) = best_of(
        || clusters.clone(),
        |mut c| {
            c.apply(&edited, after.paths(), &differences);
            c
        },
    );
    println!("clusters follow in {:.1} ms", seconds * 1e3);
    for error in [6e-4, 1e-4] {
        let budget = Budget::Auto { error };
        let (wanted, first) = best_of(Wanted::new, |mut w| {
            w.update(&clusters, budget);
            w
        });
        let ((_, changed), seconds) = best_of(
            || wanted.clone(),
            |mut w| {
                let changed = w.update(&applied, budget);
                (w, changed)
            },
        );
        let (_, selecting) = best_of(|| (), |()| applied.select(budget));
        println!(
            "{} cells wanted: from nothing in {:.1} ms, after the edit in {:.1} ms ({} changed; {:.1} ms for the cut alone)",
            wanted.cells().len(),
            first * 1e3,
            seconds * 1e3,
            changed.len(),
            selecting * 1e3
        );
    }
}

/// The result, and the least of five times in seconds of the clock; what prepares the work is not timed.
fn best_of<P, T>(prepare: impl Fn() -> P, work: impl Fn(P) -> T) -> (T, f64) {
    let mut least = f64::INFINITY;
    let mut result = None;
    for _ in 0..5 {
        let prepared = prepare();
        let start = Instant::now();
        result = Some(black_box(work(prepared)));
        least = least.min(start.elapsed().as_secs_f64());
    }
    (result.expect("ran"), least)
}

/// The result, and the least of three times in seconds that this process kept processors busy: what others run beside it
/// does not count. On several threads, it is their sum.
fn best<T>(work: impl Fn() -> T) -> (T, f64) {
    let mut least = f64::INFINITY;
    let mut result = None;
    for _ in 0..3 {
        let start = busy_seconds();
        result = Some(black_box(work()));
        least = least.min(busy_seconds() - start);
    }
    (result.expect("ran"), least.max(0.01))
}

/// Processor time from Linux's process table, in its steps of 10 ms; elsewhere the clock's.
fn busy_seconds() -> f64 {
    let clock = || {
        static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
        START.get_or_init(Instant::now).elapsed().as_secs_f64()
    };
    let ticks = || {
        let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
        let fields: Vec<&str> = stat.rsplit(')').next()?.split_whitespace().collect();
        Some(fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?)
    };
    ticks().map_or_else(clock, |t| t / 100.0)
}

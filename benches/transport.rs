//! Rates of the CPU side of a bake: rays, paths and VPLs a second on a real scene.
//!
//! `cargo bench --bench transport -- SCENE.gltf`; without a scene, the built-in Cornell box. Rates and times are
//! those of one core: processor time, whatever the number of threads.

use std::hint::black_box;
use std::time::Instant;

use rebake::cluster::{Budget, Clusters, FluxScale, Octree, SimilaritySettings};
use rebake::scene::Scene;
use rebake::transport::bvh::{SceneBvh, offset};
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

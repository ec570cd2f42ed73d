//! The device's passes: depth maps by size, and a whole map's accumulation pass by pass; device time, by timestamps.
//!
//! `cargo bench --bench passes [-- PART_OF_A_NAME]`: on the built-in Cornell box, or on `REBAKE_SCENE`, a built-in name or a file;
//! `REBAKE_DEVICE` as `rebake --device`. Rates (`thrpt`) are depth maps and virtual lights; "depth maps, processor" is what
//! all threads of the process took, which on a CPU driver other work beside it disturbs least.

use std::time::Duration;

use criterion::{Criterion, Throughput};
use rebake::bake::{Baker, Job, Limit, Options, Quality, ShadowBench, Silent};
use rebake::gpu::{Gpu, GpuOptions};
use rebake::lightmap::AtlasOptions;
use rebake::scene::builtin;

/// Depth maps a measurement.
const MAPS: u32 = 64;

fn main() {
    let name = std::env::var("REBAKE_SCENE").unwrap_or_else(|_| "cornell".into());
    let (scene, document) = builtin::open(&name).unwrap_or_else(|e| panic!("REBAKE_SCENE: {e}"));
    let gpu = Gpu::new(&GpuOptions {
        device: std::env::var("REBAKE_DEVICE").ok(),
        validate: false,
    })
    .expect("a Vulkan device");
    let maps = ShadowBench::new(&gpu, &scene).expect("buffers");
    println!(
        "{name}: {} triangles, {} lights; {} ({}); seed 0",
        maps.triangles(),
        scene.lights.len(),
        gpu.info().name,
        gpu.info().driver
    );
    // Its plots want a font that the plots of `rebake` bring along themselves.
    let mut criterion = Criterion::default()
        .without_plots()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(1))
        .configure_from_args();

    let mut group = criterion.benchmark_group("depth maps");
    group.throughput(Throughput::Elements(MAPS.into()));
    for size in [64, 128, 256, 512] {
        let sum = std::cell::Cell::new(None);
        group.bench_function(size.to_string(), |b| {
            b.iter_custom(|runs| {
                let cost = |_| {
                    let cost = maps.run(size, MAPS).expect("drawing");
                    sum.set(Some(cost.checksum));
                    Duration::from_secs_f64(cost.passes.iter().map(|p| p.1).sum())
                };
                (0..runs).map(cost).sum()
            });
        });
        group.bench_function(format!("processor, {size}"), |b| {
            b.iter_custom(|runs| {
                let cost = |_| {
                    let cost = maps.run(size, MAPS).expect("drawing");
                    sum.set(Some(cost.checksum));
                    Duration::from_secs_f64(cost.cpu.max(1e-9))
                };
                (0..runs).map(cost).sum()
            });
        });
        if let Some(sum) = sum.get() {
            println!("{size} pixels: the maps' sum is {sum:016x}");
        }
    }
    group.finish();

    let job = Job {
        atlas: AtlasOptions::with_texels(Some(1 << 16)),
        options: Options {
            quality: Some(Quality::Draft),
            paths: Some(1 << 14),
            clusters: Some(64),
            ..Options::default()
        },
        ..Job::default()
    };
    let mut baker = Baker::new(&gpu, scene, document, &job, &Silent).expect("a bake");
    // Compiles what it needs, and says which passes there are.
    let passes = fill(&gpu, &mut baker);
    let mut group = criterion.benchmark_group("passes");
    group.throughput(Throughput::Elements(lights(&baker)));
    for (pass, _) in passes {
        group.bench_function(pass, |b| {
            b.iter_custom(|runs| {
                let cost = |_| {
                    let found = fill(&gpu, &mut baker);
                    let found = found.iter().find(|p| p.0 == pass);
                    found.map_or(Duration::ZERO, |p| p.1)
                };
                (0..runs).map(cost).sum()
            });
        });
    }
    group.finish();
    criterion.final_summary();
}

fn lights(baker: &Baker) -> u64 {
    baker.report().counts.virtual_lights.values().sum()
}

/// Device time by pass of filling an empty map.
fn fill(gpu: &Gpu, baker: &mut Baker) -> Vec<(&'static str, Duration)> {
    baker.start_over().expect("memory");
    let before = gpu.timings();
    baker.step(Limit::Converged).expect("a bake");
    baker.finish().expect("a bake");
    let earlier = |name| before.iter().find(|t| t.name == name).map_or(0.0, |t| t.ms);
    gpu.timings()
        .iter()
        .map(|t| (t.name, (t.ms - earlier(t.name)) * 1e-3))
        .filter(|(_, seconds)| *seconds > 0.0)
        .map(|(name, seconds)| (name, Duration::from_secs_f64(seconds)))
        .collect()
}

//! What is measured while pictures are taken.

use std::path::Path;

use super::*;
use crate::bake::{Job, Options, Quality, Silent};
use crate::gpu::GpuOptions;
use crate::lightmap::AtlasOptions;
use crate::scene::{Scene, builtin::builtin};

/// Milliseconds of the device that the map's passes have taken so far.
fn accumulated(gpu: &Gpu) -> f64 {
    let timings = gpu.timings();
    let ours = timings
        .iter()
        .filter(|t| t.name.starts_with("accumulate") || t.name.starts_with("shadow"));
    ours.map(|t| t.ms).sum()
}

#[test]
fn passes_take_as_long_once_something_was_drawn_as_before() {
    let gpu = Gpu::new(&GpuOptions::default()).expect("a device");
    let document = builtin("cornell").expect("built in");
    let scene = Scene::from_document(&document).expect("its scene");
    let job = Job {
        atlas: AtlasOptions {
            texels: 8000,
            ..AtlasOptions::default()
        },
        options: Options {
            quality: Some(Quality::Draft),
            paths: Some(2000),
            clusters: Some(20),
            ..Options::default()
        },
        ..Job::default()
    };
    let mut baker = Baker::new(&gpu, scene, document, &job, &Silent).expect("a baker");
    // Drivers compile a pass when it runs for the first time.
    baker.step(Limit::Converged).expect("a map");
    let again = |baker: &mut Baker| {
        let before = accumulated(&gpu);
        baker.start_over().expect("an empty map");
        baker.step(Limit::Converged).expect("a map");
        accumulated(&gpu) - before
    };
    let before = again(&mut baker);
    let folder = tempfile::tempdir().expect("a folder");
    let options = HeadlessOptions {
        size: [160, 90],
        frame: Duration::ZERO,
        folder: folder.path().to_owned(),
        reference: None,
        jpeg: false,
    };
    let script = Line::parse_all(r#"{"do": "frame", "count": 2, "updates": 0}"#);
    Headless::new(&gpu, &mut baker, options)
        .expect("pictures")
        .play(&script.expect("a script"), Path::new("."))
        .expect("two frames");
    let after = again(&mut baker);
    println!("{before:.1} ms before, {after:.1} ms after");
    assert!(after > 0.3 * before, "{before} ms before, {after} ms after");
}

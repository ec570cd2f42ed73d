//! Holds edited bakes to their promise: once converged, the map is that of a fresh bake of the edited scene, bit for bit.

#[path = "scene_edits/fixtures.rs"]
mod fixtures;

use std::sync::OnceLock;
use std::time::Duration;

use fixtures::{Step, edit, steps, write_chair};
use proptest::prelude::*;
use rebake::bake::{Baked, Baker, Job, Limit, Options, Quality, Silent, bake};
use rebake::gpu::{Gpu, GpuOptions};
use rebake::lightmap::AtlasOptions;
use rebake::lightmap::export::{Content, write_outputs};
use rebake::scene::edit::Editor;
use rebake::scene::{Document, Scene, builtin::builtin};

use tempfile::tempdir;

fn gpu() -> &'static Gpu {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    GPU.get_or_init(|| {
        Gpu::new(&GpuOptions::default())
            .expect("a Vulkan device (tools/setup.sh installs lavapipe)")
    })
}

/// A built-in scene with a sun, which shines through all bounds.
fn scene(name: &str) -> (Scene, Document) {
    let mut document = builtin(name).unwrap();
    let mut scene = Scene::from_document(&document).unwrap();
    scene
        .add_sun(&mut document, 60.0, 30.0, 40.0, glam::Vec3::ONE)
        .unwrap();
    (scene, document)
}

/// The cheapest bake that has lights of all kinds.
fn job(texels: u64, paths: u64, clusters: u32) -> Job {
    Job {
        atlas: AtlasOptions {
            texels,
            page_size: Some(256),
            ..AtlasOptions::default()
        },
        options: Options {
            quality: Some(Quality::Draft),
            paths: Some(paths),
            clusters: Some(clusters),
            shadow_size: Some(16),
            ..Options::default()
        },
        ..Job::default()
    }
}

/// The bits of every page.
fn bits(baker: &mut Baker) -> Vec<Vec<[u32; 3]>> {
    let map = baker.lightmap().unwrap();
    let page = |page: &Vec<[f32; 3]>| page.iter().map(|t| t.map(f32::to_bits)).collect();
    map.pages.iter().map(page).collect()
}

/// Writes what a baker made, and bakes the written scene with the recorded settings.
fn bake_written(baker: &mut Baker) -> Baker {
    let folder = tempdir().unwrap();
    let map = baker.lightmap().unwrap();
    let report = baker.report();
    let scene = baker.scene();
    let atlas = baker.atlas().shown(scene);
    let content = Content::DirectAndIndirect;
    write_outputs(
        folder.path(),
        baker.document(),
        scene,
        &atlas,
        &map,
        content,
        Vec::new(),
    )
    .unwrap();
    let (scene, document) = Scene::load(&folder.path().join("scene.glb")).unwrap();
    let job = Job {
        repeat: Some((report.settings, report.atlas)),
        ..Job::default()
    };
    let Baked { baker, .. } = bake(gpu(), scene, document, &job, &Silent).unwrap();
    baker
}

/// Lets a baker follow a script, with a few updates between the edits as they come, then to the end.
fn follow(name: &str, job: &Job, steps: &[Step]) -> Result<(), TestCaseError> {
    let folder = tempdir().unwrap();
    write_chair(folder.path());
    let (scene, document) = self::scene(name);
    // Tells which edits make sense, and what they would do.
    let mut shadow = Editor::new(scene.clone(), document.clone()).unwrap();
    let t = std::time::Instant::now();
    let Baked { mut baker, .. } = bake(gpu(), scene, document, job, &Silent).unwrap();
    let first = bits(&mut baker);
    eprintln!("baked {:?}", t.elapsed());
    let mut depth = 0;
    for (i, step) in steps.iter().enumerate() {
        match edit(&shadow, step) {
            Some(edit) => {
                if shadow.apply(&edit, folder.path()).is_err() {
                    prop_assert!(baker.apply(&edit, folder.path()).is_err());
                    continue;
                }
                // A bake of the dark would be refused.
                let dark = shadow.scene().validate().is_err();
                if dark || baker.apply(&edit, folder.path()).is_err() {
                    shadow.take_back().unwrap();
                    continue;
                }
                depth += 1;
            }
            None if depth == 0 => continue,
            None => {
                shadow.undo().unwrap();
                baker.undo().unwrap();
                depth -= 1;
            }
        }
        let limit = match i % 4 {
            0 => Limit::Updates(3),
            1 => Limit::Updates(40),
            2 => Limit::Time(Duration::from_millis(2)),
            _ => continue,
        };
        baker.step(limit).unwrap();
    }
    baker.step(Limit::Converged).unwrap();
    prop_assert!(baker.is_converged());
    eprintln!("converged {:?}, {depth} edits", t.elapsed());
    baker.verify().unwrap();
    eprintln!("verified {:?}", t.elapsed());
    let mut fresh = bake_written(&mut baker);
    eprintln!("fresh {:?}", t.elapsed());
    prop_assert!(bits(&mut fresh) == bits(&mut baker), "a fresh bake differs");
    for _ in 0..depth {
        baker.undo().unwrap();
    }
    baker.step(Limit::Converged).unwrap();
    baker.verify().unwrap();
    prop_assert!(
        bits(&mut baker) == first,
        "undoing all does not restore the map"
    );
    Ok(())
}

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        max_shrink_iters: 60,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(cases(6))]
    #[test]
    fn short_scripts_over_cornell(steps in steps(1..12)) {
        follow("cornell", &job(2000, 500, 12), &steps)?;
    }
}

proptest! {
    #![proptest_config(cases(1))]
    #[test]
    fn two_hundred_edits_over_cornell(steps in steps(200)) {
        follow("cornell", &job(2000, 500, 12), &steps)?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 0, ..cases(1) })]
    #[test]
    fn edits_over_the_museum(steps in steps(6)) {
        follow("museum", &job(6000, 500, 12), &steps)?;
    }
}

//! Holds edited bakes to their promise: once converged, the map is that of a fresh bake of the edited scene, bit for bit.

#[path = "scene_edits/fixtures.rs"]
mod fixtures;
#[path = "common/run.rs"]
mod run;

use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant, SystemTime};

use fixtures::{Step, edit, steps, write_chair};
use glam::Vec3;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use rebake::bake::{Baked, Baker, Job, Limit, Options, Quality, Silent, bake};
use rebake::gpu::{Gpu, GpuOptions};
use rebake::lightmap::AtlasOptions;
use rebake::lightmap::export::{Content, write_outputs};
use rebake::scene::edit::{Command as Line, Editor};
use rebake::scene::{Camera, Document, Scene, builtin::builtin};

use run::{bake as bake_file, builtin as write_builtin, rebake, said};
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
        // Of some lights' depth maps, or of all.
        kept_maps: if texels < 1000 {
            30 * 3 * 16 * 16 * 4
        } else {
            1 << 28
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
    let Baked { mut baker, .. } = bake(gpu(), scene, document, job, &Silent).unwrap();
    let first = bits(&mut baker);
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
        // Somebody looks, moves on in the middle of that, and goes.
        let eye = baker.scene().bounds().center();
        let camera = |x, z| Camera::looking(eye, eye + Vec3::new(x, -0.3, z));
        match i % 7 {
            1 => baker.look_from(Some(&camera(1.0, 0.1))),
            3 => baker.look_from(Some(&camera(-0.3, 1.0))),
            6 => baker.look_from(None),
            _ => {}
        }
        let limit = match i % 5 {
            0 => Limit::Updates(3),
            1 => Limit::Updates(40),
            2 => Limit::Time(Duration::from_millis(2)),
            // The next edit may come in the middle of an update.
            3 => Limit::Slice {
                time: Duration::from_millis(2),
                whole: false,
            },
            _ => continue,
        };
        baker.step(limit).unwrap();
    }
    baker.step(Limit::Converged).unwrap();
    prop_assert!(baker.is_converged());
    // Slower, and no more than what follows, which does not say where the difference is.
    if name != "museum" {
        baker.verify().unwrap();
    }
    let mut fresh = bake_written(&mut baker);
    prop_assert!(bits(&mut fresh) == bits(&mut baker), "a fresh bake differs");
    for _ in 0..depth {
        baker.undo().unwrap();
    }
    baker.step(Limit::Converged).unwrap();
    prop_assert!(
        bits(&mut baker) == first,
        "undoing all does not restore the map"
    );
    Ok(())
}

/// The seed is printed, so that a run can be repeated: `PROPTEST_RNG_SEED=N`.
fn cases(cases: u32) -> ProptestConfig {
    let default = ProptestConfig::default();
    let rng_seed = match default.rng_seed {
        RngSeed::Random => {
            let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
            RngSeed::Fixed(now.map_or(0, |t| t.subsec_nanos().into()))
        }
        given => given,
    };
    println!("PROPTEST_RNG_SEED={rng_seed}");
    ProptestConfig {
        cases,
        rng_seed,
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

    /// Texels as large as what is edited: receivers are moved far out of emitters' planes.
    #[test]
    fn short_scripts_over_cornell_in_few_texels(steps in steps(1..12)) {
        follow("cornell", &job(150, 500, 12), &steps)?;
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
    #![proptest_config(cases(1))]
    /// A million triangles and 164 lights.
    #[test]
    fn twenty_edits_over_the_museum(steps in steps(20)) {
        follow("museum", &job(6000, 300, 4), &steps)?;
    }
}

/// The size of a lamp is its node's: four times smaller, it shines a quarter as much, wherever the edit came from.
#[test]
fn the_aperture_of_a_lamp_is_scaled_with_its_node() {
    let document = builtin("cornell").unwrap();
    let scene = Scene::from_document(&document).unwrap();
    let job = job(2000, 500, 12);
    let Baked { mut baker, .. } = bake(gpu(), scene, document, &job, &Silent).unwrap();
    let mean = |baker: &mut Baker| {
        let map = baker.lightmap().unwrap();
        let lit = map.pages.iter().flatten().flatten().filter(|v| **v > 0.0);
        let lit: Vec<f64> = lit.map(|v| f64::from(*v)).collect();
        lit.iter().sum::<f64>() / lit.len() as f64
    };
    let before = mean(&mut baker);
    let line = r#"{"do": "transform", "node": "lamp", "scale": [0.5, 1, 0.5]}"#;
    let Ok(Line::Edit(edit)) = Line::parse(line) else {
        panic!("{line} is no edit");
    };
    baker.apply(&edit, Path::new(".")).unwrap();
    baker.step(Limit::Converged).unwrap();
    let share = mean(&mut baker) / before;
    assert!((0.2..0.3).contains(&share), "{share}");
    baker.verify().unwrap();
    let mut fresh = bake_written(&mut baker);
    assert!(bits(&mut fresh) == bits(&mut baker));
}

/// Small, yet with direct lights, polygons, disks and several batches.
const SMALL: &str = "--texels 6k --paths 4k --clusters 40 --shadow-size 32 --quality draft";

fn read(folder: &Path, file: &str) -> Vec<u8> {
    std::fs::read(folder.join(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
}

#[test]
fn a_replay_is_the_bake_of_the_scene_it_wrote() {
    let folder = tempdir().unwrap();
    write_chair(folder.path());
    let scene = write_builtin("cornell", folder.path());
    let script = folder.path().join("script.jsonl");
    let lines = [
        r#"{"do": "transform", "node": "small.box", "translation": [0.2, 0.3, 0.3], "rotation": [0.1, 0.3, 0, 0.9]}"#,
        r#"{"do": "add", "file": "chair.gltf", "name": "chair"}"#,
        r#"{"do": "wait", "until": {"updates": 20}}"#,
        "",
        r#"{"do": "transform", "node": "chair", "translation": [-0.2, 0.1, 0.5]}"#,
        r#"{"do": "copy", "node": "tall.box", "name": "tower"}"#,
        r#"{"do": "transform", "node": "tower", "translation": [0.6, 0, -0.6], "scale": [0.5, 1.2, 0.5]}"#,
        r#"{"do": "wait", "until": {"seconds": 0.05}}"#,
        r#"{"do": "light", "node": "left", "intensity": 60, "color": [0.3, 0.5, 1]}"#,
        r#"{"do": "remove", "node": "tall.box"}"#,
        r#"{"do": "material", "material": "red", "baseColorFactor": [0.1, 0.1, 0.8, 1]}"#,
        r#"{"do": "undo"}"#,
        r#"{"do": "wait", "until": "converged"}"#,
        r#"{"do": "redo"}"#,
        r#"{"do": "material", "material": "lamp", "emissiveStrength": 2000}"#,
    ];
    std::fs::write(&script, lines.join("\n")).unwrap();
    let replayed = folder.path().join("replayed");
    let output = rebake(
        &format!("replay {SMALL} --verify --snapshots 3 -o"),
        &[&replayed, &scene, &script],
    );
    assert!(output.status.success(), "{}", said(&output));
    for file in [
        "replay.json",
        "convergence.csv",
        "convergence.png",
        "preview.png",
        "snapshot_000_0.exr",
        "snapshot_002_0.exr",
    ] {
        assert!(!read(&replayed, file).is_empty());
    }
    let csv = String::from_utf8(read(&replayed, "convergence.csv")).unwrap();
    assert!(csv.lines().count() > 20);
    let settings = replayed.join("bake.json");
    let options = format!("--settings {}", settings.display());
    let written = replayed.join("scene.glb");
    let (again, _) = bake_file(&written, "again", &options);
    assert!(read(&replayed, "lightmap_0.exr") == read(&again, "lightmap_0.exr"));

    // All undone: the bake of the first scene.
    let undo = "{\"do\": \"undo\"}\n".repeat(9);
    std::fs::write(&script, format!("{}\n{undo}", lines.join("\n"))).unwrap();
    let output = rebake(&format!("replay {SMALL} -o"), &[&replayed, &scene, &script]);
    assert!(output.status.success(), "{}", said(&output));
    let (first, _) = bake_file(&scene, "first", SMALL);
    assert!(read(&first, "lightmap_0.exr") == read(&replayed, "lightmap_0.exr"));
}

#[test]
fn a_wrong_line_is_named_and_nothing_is_written_unless_told_to_go_on() {
    let folder = tempdir().unwrap();
    let scene = write_builtin("cornell", folder.path());
    let script = folder.path().join("script.jsonl");
    let out = folder.path().join("out");
    for (line, words) in [
        (
            r#"{"do": "transform", "node": "smal.box", "translation": [0, 0, 0]}"#,
            "did you mean \"small.box\"",
        ),
        (
            r#"{"do": "transform", "node": "small.box", "scale": [0, 1, 1]}"#,
            "node 5 (small.box), \"scale\"",
        ),
        (
            r#"{"do": "transform", "node": "small.box", "translation": [NaN, 0, 0]}"#,
            "expected",
        ),
        (r#"{"do": "undo"}"#, ""),
    ] {
        let good = r#"{"do": "transform", "node": "tall.box", "translation": [0, 0, 0]}"#;
        let text = if words.is_empty() {
            format!("\n{line}\n{good}\n")
        } else {
            format!("{good}\n{line}\n")
        };
        std::fs::write(&script, text).unwrap();
        let output = rebake(&format!("replay -q {SMALL} -o"), &[&out, &scene, &script]);
        let line = said(&output);
        assert_eq!(output.status.code(), Some(1), "{line}");
        assert!(line.contains("line 2") && line.contains(words), "{line}");
        assert_eq!(line.trim_end().lines().count(), 1, "{line}");
        assert!(!out.exists(), "{line}");
    }
    let options = format!("replay -q {SMALL} --keep-going -o");
    let output = rebake(&options, &[&out, &scene, &script]);
    assert!(output.status.success(), "{}", said(&output));
    let report: serde_json::Value = serde_json::from_slice(&read(&out, "replay.json")).unwrap();
    let replay = &report["replay"];
    assert!(replay.to_string().contains("nothing to undo"), "{replay}");
}

#[test]
fn a_killed_replay_leaves_earlier_outputs_whole() {
    let folder = tempdir().unwrap();
    let scene = write_builtin("cornell", folder.path());
    let (out, _) = bake_file(&scene, "out", SMALL);
    let files = ["scene.glb", "lightmap_0.exr", "bake.json", "preview.png"];
    let before = files.map(|file| read(&out, file));
    let script = folder.path().join("script.jsonl");
    let lines: String = (0..400)
        .map(|i| {
            let x = 0.001 * f64::from(i);
            format!("{{\"do\": \"transform\", \"node\": \"small.box\", \"translation\": [{x}, 0, 0]}}\n{{\"do\": \"wait\", \"until\": \"converged\"}}\n")
        })
        .collect();
    std::fs::write(&script, lines).unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_rebake"))
        .args(["replay", "-q"])
        .args(SMALL.split_whitespace())
        .arg("-o")
        .args([&out, &scene, &script])
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    std::thread::sleep(Duration::from_millis(700));
    // SIGKILL.
    child.kill().unwrap();
    let status = child.wait().unwrap();
    assert!(!status.success(), "it was done after {:?}", start.elapsed());
    assert!(files.map(|file| read(&out, file)) == before);
}

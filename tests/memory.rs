//! Holds a session to its memory: what an edit brought is given back when it has been undone, on the host and on the device.

#[path = "scene_edits/fixtures.rs"]
mod fixtures;

use std::path::Path;
use std::sync::Mutex;

use fixtures::{edit, steps, write_chair};
use peak_alloc::PeakAlloc;
use proptest::prelude::*;
use rebake::bake::{Baker, Job, Limit, Options, Quality, Silent};
use rebake::gpu::{Gpu, GpuOptions};
use rebake::lightmap::AtlasOptions;
use rebake::scene::{
    Scene,
    builtin::builtin,
    edit::{Command, Editor},
};

#[global_allocator]
static HOST: PeakAlloc = PeakAlloc;

/// Only one test counts at a time.
static COUNTING: Mutex<()> = Mutex::new(());

/// Rounds after which as much may be kept for later as will ever be.
const SETTLED: usize = 5;

/// A small Cornell box, converged.
fn baker() -> Baker {
    let gpu = Gpu::new(&GpuOptions::default())
        .expect("a Vulkan device (tools/setup.sh installs lavapipe)");
    let document = builtin("cornell").unwrap();
    let scene = Scene::from_document(&document).unwrap();
    let job = Job {
        atlas: AtlasOptions {
            texels: 4000,
            ..AtlasOptions::default()
        },
        options: Options {
            quality: Some(Quality::Draft),
            paths: Some(1000),
            clusters: Some(16),
            shadow_size: Some(16),
            ..Options::default()
        },
        ..Job::default()
    };
    let mut baker = Baker::new(&gpu, scene, document, &job, &Silent).unwrap();
    baker.step(Limit::Converged).unwrap();
    baker
}

/// Buffers of what is there for each object. Others grow with what happens to be sent at once.
const OF_OBJECTS: [&str; 11] = [
    "alpha masks",
    "clearances",
    "instances",
    "lightmap sums",
    "occluder chunks",
    "occluder cutouts",
    "occluder triangles",
    "placements",
    "receivers",
    "texels",
    "tiles",
];

/// Bytes on the host, and the most that the objects' buffers on the device ever held.
fn held(baker: &Baker) -> [usize; 2] {
    let all = baker.gpu().allocations();
    let device: u64 = OF_OBJECTS.iter().map(|name| all[*name]).sum();
    [HOST.current_usage(), device as usize]
}

/// Plays rounds, each of which leaves the scene as it found it: what they hold on the host and on the device must not grow after the
/// first ones, but in so many of them as `peaks` says, by how many versions of the scene a round happens to need at once. What leaks
/// grows in every one.
fn holds(what: &str, count: usize, peaks: usize, mut round: impl FnMut(&mut Baker)) {
    let alone = COUNTING.lock().unwrap_or_else(|e| e.into_inner());
    let mut baker = baker();
    let mut bytes = Vec::with_capacity(count);
    for _ in 0..count {
        round(&mut baker);
        baker.step(Limit::Converged).unwrap();
        bytes.push(held(&baker));
    }
    drop((baker, alone));
    println!("{what}: {bytes:?}");
    // The libraries' queues grow by a block now and then; a single tile of texels a round is more than all of that.
    for (place, slack) in [("host", 20_000), ("device", 0)] {
        let held = bytes.iter().map(|b| b[usize::from(place == "device")]);
        let mut most = held.clone().take(SETTLED).max().unwrap();
        let mut grown = 0;
        for held in held.skip(SETTLED) {
            if held > most + slack {
                (most, grown) = (held, grown + 1);
            }
        }
        assert!(grown <= peaks, "{what}: the {place}'s memory: {bytes:?}");
    }
}

#[test]
fn what_an_undone_edit_brought_is_given_back() {
    let folder = tempfile::tempdir().unwrap();
    write_chair(folder.path());
    for line in [
        r#"{"do": "copy", "node": "small.box", "name": "box 2"}"#,
        r#"{"do": "add", "file": "chair.gltf", "name": "chair"}"#,
        r#"{"do": "remove", "node": "tall.box"}"#,
        r#"{"do": "transform", "node": "small.box", "translation": [0.4, 0.0, 0.6]}"#,
        r#"{"do": "material", "material": "lamp", "emissiveStrength": 9000.0}"#,
    ] {
        let Command::Edit(edit) = Command::parse(line).unwrap() else {
            panic!("{line} is no edit");
        };
        holds(line, 8, 0, |baker| {
            baker.apply(&edit, folder.path()).unwrap();
            baker.step(Limit::Converged).unwrap();
            baker.undo().unwrap();
        });
    }
}

/// What is removed for good leaves its place to what comes; only the history of edits grows.
#[test]
fn what_is_removed_leaves_its_place_to_others() {
    let alone = COUNTING.lock().unwrap_or_else(|e| e.into_inner());
    let mut baker = baker();
    let mut bytes = Vec::new();
    for round in 0..8 {
        let name = format!("box {}", round + 2);
        for line in [
            format!(r#"{{"do": "copy", "node": "small.box", "name": "{name}"}}"#),
            format!(r#"{{"do": "remove", "node": "{name}"}}"#),
        ] {
            let Command::Edit(edit) = Command::parse(&line).unwrap() else {
                panic!("{line} is no edit");
            };
            baker.apply(&edit, Path::new(".")).unwrap();
            baker.step(Limit::Converged).unwrap();
        }
        let [host, device] = held(&baker);
        bytes.push([host, device, baker.page_layout()[1] as usize]);
    }
    println!("{bytes:?}");
    let [early, last] = [bytes[SETTLED - 1], bytes[bytes.len() - 1]];
    assert_eq!(early[1..], last[1..], "{bytes:?}");
    let rounds = bytes.len() - SETTLED;
    assert!(last[0] <= early[0] + 10_000 * rounds, "{bytes:?}");
    baker.verify().unwrap();
    drop((baker, alone));
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 2,
        failure_persistence: None,
        max_shrink_iters: 30,
        ..ProptestConfig::default()
    })]
    #[test]
    fn what_undone_edits_brought_is_given_back(steps in steps(1..12)) {
        let folder = tempfile::tempdir().unwrap();
        write_chair(folder.path());
        holds(&format!("{} steps", steps.len()), 30, 1, |baker| {
            let mut depth = 0;
            for (i, step) in steps.iter().enumerate() {
                let document = baker.document().clone();
                let editor = Editor::new(Scene::clone(baker.scene()), document);
                let Some(edit) = editor.ok().and_then(|editor| edit(&editor, step)) else { continue };
                depth += u32::from(baker.apply(&edit, folder.path()).is_ok());
                if i % 3 == 1 {
                    baker.step(Limit::Updates(5)).unwrap();
                }
            }
            for _ in 0..depth {
                baker.undo().unwrap();
            }
        });
    }
}

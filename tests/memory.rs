//! Holds a session to its memory: what an edit brought is given back when it has been undone, on the host and on the device.

#[path = "scene_edits/fixtures.rs"]
mod fixtures;

use std::path::Path;

use fixtures::write_chair;
use peak_alloc::PeakAlloc;
use rebake::bake::{Baker, Job, Limit, Options, Quality, Silent};
use rebake::gpu::{Gpu, GpuOptions};
use rebake::lightmap::AtlasOptions;
use rebake::scene::{Scene, builtin::builtin, edit::Command};

#[global_allocator]
static HOST: PeakAlloc = PeakAlloc;

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

fn play(baker: &mut Baker, line: &str, folder: &Path) {
    match Command::parse(line).unwrap() {
        Command::Edit(edit) => baker.apply(&edit, folder).unwrap(),
        Command::Undo => baker.undo().unwrap(),
        Command::Redo => baker.redo().unwrap(),
        Command::Wait(_) => {
            baker.step(Limit::Converged).unwrap();
        }
    }
}

/// Bytes on the host and on the device after each of some rounds of a script, which leaves the scene as it found it.
fn rounds(lines: &[&str], count: usize) -> Vec<[u64; 2]> {
    let folder = tempfile::tempdir().unwrap();
    write_chair(folder.path());
    let mut baker = baker();
    let mut bytes = Vec::with_capacity(count);
    for _ in 0..count {
        for line in lines {
            play(&mut baker, line, folder.path());
        }
        bytes.push([HOST.current_usage() as u64, baker.gpu().live_bytes()]);
    }
    bytes
}

const WAIT: &str = r#"{"do": "wait", "until": "converged"}"#;
const UNDO: &str = r#"{"do": "undo"}"#;

#[test]
fn what_an_undone_edit_brought_is_given_back() {
    for lines in [
        &[
            r#"{"do": "copy", "node": "small.box", "name": "box 2"}"#,
            WAIT,
            UNDO,
            WAIT,
        ][..],
        &[
            r#"{"do": "add", "file": "chair.gltf", "name": "chair"}"#,
            WAIT,
            UNDO,
            WAIT,
        ],
        &[r#"{"do": "remove", "node": "tall.box"}"#, WAIT, UNDO, WAIT],
        &[
            r#"{"do": "transform", "node": "small.box", "translation": [0.4, 0.0, 0.6]}"#,
            WAIT,
            UNDO,
            WAIT,
        ],
        &[
            r#"{"do": "material", "material": "red", "baseColorFactor": [0.1, 0.1, 0.8, 1]}"#,
            WAIT,
            UNDO,
            WAIT,
        ],
    ] {
        let bytes = rounds(lines, 8);
        println!("{}: {bytes:?}", lines[0]);
    }
}

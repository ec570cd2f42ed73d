//! Holds the real binary to what a user and a script rely on: errors of one line and exit codes.

#[path = "common/failing.rs"]
mod failing;
#[path = "common/run.rs"]
mod run;

use std::path::Path;
use std::process::Command;

use failing::{TINY, content, fails};
use run::{bake, bake_that_says, builtin, rebake, said};
use serde_json::Value;
use tempfile::{TempDir, tempdir};

/// A black quadrilateral without any light.
fn dark_scene() -> (TempDir, std::path::PathBuf) {
    let folder = tempdir().unwrap();
    let positions: Vec<u8> = [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    std::fs::write(folder.path().join("dark.bin"), &positions).unwrap();
    let scene = folder.path().join("dark.gltf");
    let json = serde_json::json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }], "buffers": [{ "uri": "dark.bin", "byteLength": 36 }],
    });
    std::fs::write(&scene, json.to_string()).unwrap();
    (folder, scene)
}

#[test]
fn what_cannot_be_baked_is_one_line_and_leaves_nothing() {
    let (folder, dark) = dark_scene();
    let lit = builtin("cornell", folder.path());
    let missing = folder.path().join("missing.glb");
    let before = content(folder.path());
    let out = folder.path().join("out/deep");
    fails("", &missing, &out, &["missing.glb", "No such file"]);
    fails(
        "",
        &dark,
        &out,
        &["no light", "--sun", "--point", "--lights"],
    );
    fails(
        "--device imaginary",
        &lit,
        &out,
        &["imaginary", "rebake devices"],
    );
    fails("--device 77", &lit, &out, &["77", "rebake devices"]);
    fails("--settings nowhere.json", &lit, &out, &["nowhere.json"]);
    let settings = format!("--settings {}", dark.display());
    fails(&settings, &lit, &out, &["dark.gltf", "bake.json"]);
    let lights = format!("--lights {}", missing.display());
    fails(&lights, &lit, &out, &["missing.glb"]);
    // Not a bake in the wrong place either: the file that is there stays, and is told at once.
    fails("", &lit, &dark, &["dark.gltf", "not a folder"]);
    fails("", &lit, &dark.join("below"), &["dark.gltf"]);
    assert!(content(folder.path()) == before, "something was written");
}

#[test]
fn bad_option_values_name_the_option() {
    let folder = tempdir().unwrap();
    let scene = folder.path().join("scene.glb");
    for options in [
        "--texels none",
        "--texels 0",
        "--density=-1",
        "--density nan",
        "--page-size 3",
        "--clusters many",
        "--paths 1e99",
        "--bounces 1000",
        "--shadow-size 0",
        "--budget 30",
        "--budget=-1s",
        "--quality best",
        "--threads 0",
        "--sun 1,2",
        "--point 1,2,3,x",
        "--sun=nan,0,1",
    ] {
        let output = rebake(
            &format!("bake {options} -o"),
            &[&folder.path().join("out"), &scene],
        );
        assert_eq!(output.status.code(), Some(2), "{options}");
        let option = options.split([' ', '=']).next().expect("an option");
        let said = said(&output);
        assert!(
            said.contains(option) && said.starts_with("error: "),
            "{options}: {said}"
        );
    }
    let both = rebake(
        "bake --density 10 --texels 1k -o",
        &[&folder.path().join("out"), &scene],
    );
    assert_eq!(both.status.code(), Some(2));
    assert_eq!(content(folder.path()).len(), 0);
}

/// Every line of a stream as JSON.
fn lines(stream: &[u8]) -> Vec<Value> {
    let text = std::str::from_utf8(stream).expect("UTF-8");
    let parse = |line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{line}: {e}"));
    text.lines().map(parse).collect()
}

#[test]
fn json_is_for_machines() {
    let folder = tempdir().unwrap();
    let scene = builtin("furnace", folder.path());
    let out = folder.path().join("out");
    let output = rebake(&format!("bake --json {TINY} -o"), &[&out, &scene]);
    assert!(output.status.success(), "{}", said(&output));
    let [result] = &lines(&output.stdout)[..] else {
        panic!("one result is expected");
    };
    let report: Value =
        serde_json::from_slice(&std::fs::read(out.join("bake.json")).unwrap()).unwrap();
    assert_eq!(result["report"]["settings"], report["settings"]);
    for file in result["files"].as_array().expect("files") {
        assert!(
            Path::new(file.as_str().expect("a path")).is_file(),
            "{file}"
        );
    }
    let stages = lines(&output.stderr);
    for stage in ["unwrap", "paths", "accumulate", "resolve"] {
        assert!(
            stages
                .iter()
                .any(|s| s["stage"] == stage && s["seconds"].is_number()),
            "{stage}"
        );
    }
    let compared = rebake("compare --json", &[&out, &out]);
    assert_eq!(lines(&compared.stdout)[0]["different"], 0);
    let failed = rebake("bake --json -o", &[&out, &folder.path().join("none.glb")]);
    assert_eq!(failed.status.code(), Some(1));
    assert!(
        lines(&failed.stderr)[0]["error"]
            .as_str()
            .expect("an error")
            .contains("none.glb")
    );
}

#[test]
fn devices_are_listed_and_chosen() {
    let text = rebake("devices", &[]);
    assert!(text.status.success(), "{}", said(&text));
    let listed = rebake("devices --json", &[]);
    let devices = lines(&listed.stdout);
    assert_eq!(
        String::from_utf8_lossy(&text.stdout).lines().count(),
        devices.len()
    );
    let ready = devices
        .iter()
        .find(|d| d["lacks"].as_array().is_some_and(Vec::is_empty));
    let ready = ready.expect("a device that can bake");
    let folder = tempdir().unwrap();
    let scene = builtin("furnace", folder.path());
    let (_, report) = bake(
        &scene,
        "out",
        &format!("{TINY} --device {}", ready["index"]),
    );
    assert_eq!(report["device"]["name"], ready["name"]);
}

#[test]
fn lightmaps_are_compared() {
    let folder = tempdir().unwrap();
    let scene = builtin("furnace", folder.path());
    let (a, _) = bake(&scene, "a", TINY);
    let (b, _) = bake(&scene, "b", &format!("{TINY} --seed 5"));
    let (larger, _) = bake(&scene, "larger", &format!("{TINY} --page-size 256"));
    let png = folder.path().join("difference.png");
    let compare = |a: &Path, b: &Path| rebake("compare --json -o", &[&png, a, b]);
    assert_eq!(lines(&compare(&a, &a).stdout)[0]["different"], 0);
    let other = compare(&a.join("lightmap_0.exr"), &b.join("lightmap_0.exr"));
    let other = &lines(&other.stdout)[0];
    assert!(
        other["different"].as_u64().expect("a count") > 0
            && other["rmse"].as_f64().expect("a number") > 0.0
    );
    assert!(std::fs::read(&png).unwrap().starts_with(b"\x89PNG"));
    for (b, word) in [
        (&larger, "--settings"),
        (&folder.path().join("none"), "none"),
        (&scene, "furnace.glb"),
    ] {
        let output = rebake("compare", &[&a, b]);
        let said = said(&output);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(
            said.contains(word) && said.trim_end().lines().count() == 1,
            "{said}"
        );
    }
}

#[test]
fn built_in_scenes_are_written() {
    let folder = tempdir().unwrap();
    for name in [
        "cornell",
        "integrating-sphere-0.8",
        "furnace",
        "museum",
        "town-square",
        "warehouse",
    ] {
        let file = builtin(name, folder.path());
        let (scene, _) =
            rebake::scene::Scene::load(&file).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(scene.validate().is_ok(), "{name}");
    }
    let text = folder.path().join("cornell.gltf");
    assert!(rebake("scene cornell -o", &[&text]).status.success());
    assert!(rebake::scene::Scene::load(&text).is_ok());
    let unknown = rebake("scene atlantis -o", &[&folder.path().join("a.glb")]);
    assert_eq!(unknown.status.code(), Some(1));
    assert!(said(&unknown).contains("atlantis") && said(&unknown).contains("museum"));
    assert!(!folder.path().join("a.glb").exists());
}

/// A whole bake of each large scene, small as they go, under the validation layer. They have more charts than so few
/// texels go round.
#[test]
fn large_scenes_bake_in_silence() {
    let folder = tempdir().unwrap();
    for name in ["museum", "town-square", "warehouse"] {
        let scene = builtin(name, folder.path());
        let options = "--quality draft --texels 20k --paths 4k --clusters 40 --shadow-size 32";
        let (_, report) = bake_that_says(Some("in so many charts"), &scene, name, options);
        assert!(
            report["counts"]["texels"].as_u64().expect("a count") > 10_000,
            "{name}"
        );
        let cap = report["flux"]["balance_error"].as_f64().expect("a number");
        assert!(cap < 1e-6, "{name}: {cap}");
    }
}

/// Next to a wall, a camera sees its part of the map right while much of the rest is still wrong. The script is named without its
/// folder.
#[test]
fn what_a_camera_sees_follows_first() {
    let folder = tempfile::tempdir().unwrap();
    let scene = builtin("cornell", folder.path());
    let lines = [
        r#"{"do": "add", "file": "wall.gltf", "name": "wall"}"#,
        r#"{"do": "transform", "node": "wall", "translation": [0, 0, 0.6], "scale": [0.5, 0.8, 0.1]}"#,
        r#"{"do": "transform", "node": "small.box", "translation": [0.2, 0.3, 0.3]}"#,
    ];
    let wall = include_str!("../assets/replay/wall.gltf");
    std::fs::write(folder.path().join("wall.gltf"), wall).unwrap();
    std::fs::write(folder.path().join("script.jsonl"), lines.join("\n")).unwrap();
    let options =
        "--texels 20k --paths 8k --clusters 100 --quality draft --camera=0,1,0,-1,0.9,0.1 --verify";
    let done = Command::new(env!("CARGO_BIN_EXE_rebake"))
        .current_dir(folder.path())
        .args(["replay", "-q"])
        .arg(scene)
        .args(["script.jsonl", "-o", "out"])
        .args(options.split(' '))
        .output()
        .unwrap();
    assert!(done.status.success(), "{}", said(&done));
    let table = std::fs::read_to_string(folder.path().join("out/convergence.csv")).unwrap();
    let mut lines = table.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name| names.iter().position(|n| *n == name).unwrap();
    let (seen, all) = (column("viewport share"), column("RMS share"));
    let rows: Vec<&str> = lines.collect();
    // The update after which no more than a fiftieth is ever left. Without a camera that comes later for what it sees than for all.
    let right = |column: usize| {
        let left = |line: &&str| line.split(',').nth(column).unwrap().parse::<f64>().unwrap();
        rows.iter().rposition(|row| left(row) > 0.02).unwrap() + 1
    };
    let (seen, all) = (right(seen), right(all));
    assert!(
        10 * seen < 8 * all,
        "what is seen is right after {seen} updates, all after {all}, of {}",
        rows.len()
    );
}

//! The viewer's window, driven by real input events on a virtual X display.

mod window;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use window::{Display, Viewer, pause, until};

/// The files of a saved bake that do not tell the time.
fn saved(folder: &Path) -> Vec<Vec<u8>> {
    ["lightmap_0.exr", "scene.glb", "preview.png"]
        .map(|name| std::fs::read(folder.join("cornell-bake").join(name)).expect(name))
        .to_vec()
}

/// Takes a screenshot, the `number`th of a viewer; `tools/pictures` says where to keep it.
fn screenshot(display: &Display, folder: &Path, number: u32, name: &str) {
    if std::env::var_os("REBAKE_PICTURES").is_some() {
        // Notes about files go by themselves.
        std::thread::sleep(Duration::from_secs(8));
    }
    display.key("F12");
    let picture = folder.join(format!("cornell-{number:03}.png"));
    let picture = until("the screenshot", || image::open(&picture).ok());
    if let Some(kept) = std::env::var_os("REBAKE_PICTURES") {
        let small = picture.resize(800, 450, image::imageops::FilterType::Triangle);
        let path = Path::new(&kept).join(format!("edit-{number}-{name}.jpg"));
        small.into_rgb8().save(path).expect("a picture");
        if name == "dragged" {
            let whole = Path::new(&kept).join("viewer.jpg");
            picture.into_rgb8().save(whole).expect("a picture");
        }
    }
}

fn lines(path: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    text.lines().map(str::to_owned).collect()
}

#[test]
fn what_is_dragged_and_dimmed_and_undone_is_saved_as_it_was() {
    let display = Display::new();
    let folder = tempfile::tempdir().expect("a folder");
    let stats = folder.path().join("stats.json");
    // Pictures for people are finer.
    let [texels, quality] = match std::env::var_os("REBAKE_PICTURES") {
        Some(_) => ["256k", "preview"],
        None => ["8k", "draft"],
    };
    let trace = folder.path().join("trace.json");
    let [to_stats, to_trace] = [&stats, &trace].map(|path| path.to_str().expect("ASCII"));
    let more = ["--texels", texels, "--stats", to_stats, "--trace", to_trace];
    let viewer = Viewer::open_at(&display, folder.path(), quality, &more);
    viewer.wait_converged(&display);
    let save = || {
        let _none_before = std::fs::remove_file(folder.path().join("cornell-bake/bake.json"));
        display.key("ctrl+s");
        until("the bake", || {
            let report = std::fs::read(folder.path().join("cornell-bake/bake.json"));
            report.ok().map(|_| saved(folder.path()))
        })
    };
    let script: PathBuf = folder.path().join("cornell-edits.jsonl");
    // The script of all edits, once it has what is waited for.
    let history = |what: &str, done: &dyn Fn(&[String]) -> bool| {
        until(what, || {
            display.key("ctrl+h");
            let lines = lines(&script);
            done(&lines).then_some(lines)
        })
    };
    let before = save();
    screenshot(&display, folder.path(), 1, "opened");

    // The small box, along the red arrow.
    display.click(738, 600);
    viewer.wait_selected(&display, "small.box");
    screenshot(&display, folder.path(), 2, "selected");
    display.tool(&["mousemove", "790", "676"]);
    pause();
    display.tool(&["mousedown", "1"]);
    for x in (800..=850).step_by(10) {
        display.tool(&["mousemove", &x.to_string(), "676"]);
        pause();
    }
    display.tool(&["mouseup", "1"]);
    // All of a drag is one edit.
    let done = history("the drag", &|lines| lines.len() == 1);
    let drag = &done[0];
    assert!(
        drag.contains("\"transform\"") && drag.contains("\"node\":5"),
        "{done:?}"
    );
    viewer.wait_converged(&display);
    let moved = save();
    screenshot(&display, folder.path(), 3, "dragged");
    assert!(moved[0] != before[0], "the box casts its shadow elsewhere");

    // The lamp, in the inspector.
    display.key("Escape");
    display.click(640, 74);
    viewer.wait_selected(&display, "lamp");
    display.click(1085, 189);
    display.tool(&["type", "900"]);
    pause();
    display.key("Return");
    let dimmed = |line: &String| line.contains("\"emissiveStrength\":900.0");
    let done = history("the lamp", &|lines| lines.last().is_some_and(dimmed));
    assert_eq!(done.len(), 2, "what is typed is one edit: {done:?}");

    // And smaller: the field for its first side, below what it emits.
    display.click(1105, 210);
    display.tool(&["type", "0.25"]);
    pause();
    display.key("Return");
    let smaller = |line: &String| line.contains("\"scale\":[0.") && line.contains("\"node\":7");
    let done = history("the lamp's size", &|lines| {
        lines.last().is_some_and(smaller)
    });
    assert_eq!(done.len(), 3, "what is typed is one edit: {done:?}");

    viewer.wait_converged(&display);
    screenshot(&display, folder.path(), 4, "dimmed");

    // All of it back, at once.
    for _ in &done {
        display.key("ctrl+z");
    }
    let undo = |line: &&String| *line == r#"{"do":"undo"}"#;
    history("the undoing", &|lines| {
        lines.iter().filter(undo).count() == done.len()
    });
    viewer.wait_converged(&display);
    let after = save();
    assert!(
        after == before,
        "the map, the scene and the preview are as before, bit for bit"
    );

    screenshot(&display, folder.path(), 5, "undone");
    display.key("ctrl+q");
    viewer.close();
    let stats = std::fs::read_to_string(stats).expect("statistics");
    let stats: serde_json::Value = serde_json::from_str(&stats).expect("JSON");
    let photon = &stats["input_to_photon"];
    assert!(photon["events"].as_u64() > Some(20), "{stats:#}");
    assert!(photon["most_frames"].as_u64() <= Some(2), "{stats:#}");
    // The whole session is in its trace: what came in, what answered, and what was done meanwhile.
    let trace = std::fs::read(trace).expect("a trace");
    let trace: serde_json::Value = serde_json::from_slice(&trace).expect("JSON");
    let events = trace["traceEvents"].as_array().expect("a list");
    for name in [
        "key", "button", "cursor", "frame", "panels", "present", "slice", "drag", "answer",
    ] {
        let named = |e: &&serde_json::Value| e["ph"] == "X" && e["name"] == name;
        assert!(events.iter().any(|e| named(&e)), "no `{name}` in the trace");
    }
}

/// A mesh whose charts take many seconds to find.
fn crumpled(folder: &Path) -> PathBuf {
    const SIDE: u32 = 400;
    let height = |x: u32, z: u32| ((x * 7919 + z * 104_729) % 97) as f32 * 0.02;
    let mut bytes = Vec::new();
    for z in 0..SIDE {
        for x in 0..SIDE {
            let at = [x as f32 * 0.1, height(x, z), z as f32 * 0.1];
            bytes.extend(at.iter().flat_map(|v| v.to_le_bytes()));
        }
    }
    let indices = bytes.len();
    for z in 0..SIDE - 1 {
        for x in 0..SIDE - 1 {
            let a = z * SIDE + x;
            let corners = [a, a + SIDE, a + 1, a + 1, a + SIDE, a + SIDE + 1];
            bytes.extend(corners.iter().flat_map(|v| v.to_le_bytes()));
        }
    }
    let size = f64::from(SIDE - 1) * 0.1;
    let json = serde_json::json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [
            {"mesh": 0, "name": "crumpled"},
            {"name": "lamp", "translation": [20, 5, 20], "extensions": {"KHR_lights_punctual": {"light": 0}}},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": SIDE * SIDE, "type": "VEC3", "min": [0, 0, 0], "max": [size, 1.92, size]},
            {"bufferView": 1, "componentType": 5125, "count": 6 * (SIDE - 1) * (SIDE - 1), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": indices},
            {"buffer": 0, "byteOffset": indices, "byteLength": bytes.len() - indices},
        ],
        "buffers": [{"uri": "crumpled.bin", "byteLength": bytes.len()}],
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 100}]}},
    });
    std::fs::write(folder.join("crumpled.bin"), bytes).expect("a file");
    let path = folder.join("crumpled.gltf");
    std::fs::write(&path, json.to_string()).expect("a file");
    path
}

#[test]
fn closing_waits_for_no_charts() {
    let display = Display::new();
    let folder = tempfile::tempdir().expect("a folder");
    let scene = crumpled(folder.path());
    let viewer = Viewer::open_scene(&display, &scene, folder.path(), "draft", &[]);
    // By now charts are looked for: it takes a minute.
    std::thread::sleep(Duration::from_secs(3));
    let title = viewer.title(&display);
    assert!(title.contains("preparing"), "{title}");
    let closing = Instant::now();
    display.key("ctrl+q");
    viewer.close();
    let took = closing.elapsed();
    assert!(took < Duration::from_secs(8), "{took:?}");
}

#[test]
fn a_window_that_is_taken_away_ends_it_well() {
    let display = Display::new();
    let folder = tempfile::tempdir().expect("a folder");
    let viewer = Viewer::open(&display, folder.path(), &["--texels", "8k"]);
    viewer.wait_converged(&display);
    viewer.take_away(&display);
    viewer.close();
}

#[test]
fn closing_in_the_middle_of_a_bake_ends_well() {
    let display = Display::new();
    let folder = tempfile::tempdir().expect("a folder");
    for wait in [0, 700] {
        let viewer = Viewer::open(&display, folder.path(), &["--texels", "200k"]);
        std::thread::sleep(Duration::from_millis(wait));
        display.key("ctrl+q");
        viewer.close();
    }
}

#[test]
fn without_a_display_it_says_so_in_a_line() {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/cornell.gltf");
    let out = Command::new(env!("CARGO_BIN_EXE_viewer"))
        .arg(scene)
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .env("RUST_BACKTRACE", "0")
        .output()
        .expect("the viewer starts");
    assert!(!out.status.success());
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.contains("--headless"), "{said}");
}

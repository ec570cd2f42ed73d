//! Holds `--trace` to what a reader of traces relies on: spans nest, passes lie in their submissions, and the sums are those of
//! bake.json.

#[path = "common/run.rs"]
mod run;

use std::collections::BTreeMap;
use std::path::Path;

use run::{bake, builtin, rebake, said};
use serde_json::Value;
use tempfile::tempdir;

/// Half of the last digit that is written, microseconds.
const EXACT: f64 = 1e-3;

fn slices(trace: &Value) -> Vec<&Value> {
    let events = trace["traceEvents"].as_array().expect("a list");
    events.iter().filter(|e| e["ph"] == "X").collect()
}

fn span(slice: &Value) -> (f64, f64) {
    let [begin, took] = ["ts", "dur"].map(|name| slice[name].as_f64().expect("a number"));
    assert!(begin >= 0.0 && took >= 0.0, "{slice}");
    (begin, begin + took)
}

fn inside(inner: (f64, f64), outer: (f64, f64)) -> bool {
    inner.0 >= outer.0 - EXACT && inner.1 <= outer.1 + EXACT
}

/// Fails unless of two slices of a track that overlap one lies in the other.
fn check_nesting(slices: &[&Value]) {
    let mut tracks: BTreeMap<(u64, u64), Vec<(f64, f64)>> = BTreeMap::new();
    for slice in slices {
        let track = ["pid", "tid"].map(|name| slice[name].as_u64().expect("a number"));
        tracks.entry(track.into()).or_default().push(span(slice));
    }
    for track in tracks.values() {
        let mut open: Vec<(f64, f64)> = Vec::new();
        for &slice in track {
            open.retain(|o| o.1 > slice.0 + EXACT);
            assert!(
                open.iter().all(|&o| inside(slice, o)),
                "{slice:?}: {open:?}"
            );
            open.push(slice);
        }
    }
}

/// Fails unless the counts of a bake.json agree with each other.
fn check_counts(report: &Value) {
    let number = |path: &str| {
        let value = report.pointer(path).and_then(Value::as_u64);
        value.unwrap_or_else(|| panic!("{path} is no number"))
    };
    let sum = |path: &str| -> u64 {
        let parts = report.pointer(path).and_then(Value::as_object);
        let parts = parts.unwrap_or_else(|| panic!("{path} is no object"));
        parts.values().filter_map(Value::as_u64).sum()
    };
    let pairs = sum("/counts/pairs");
    assert!(pairs > 0 && pairs <= number("/counts/offered_pairs"));
    // The lamp's shadows are soft: 13 lookups a pair, not one.
    let taps = sum("/counts/taps");
    assert!(taps > pairs && taps <= 13 * pairs, "{taps} of {pairs}");
    let [maps, faces, drawn, all] = ["maps", "faces", "triangles", "offered"]
        .map(|name| number(&format!("/counts/shadows/{name}")));
    assert_eq!(maps, number("/counts/accumulated"));
    assert_eq!(faces, 5 * maps);
    // 32 triangles in the Cornell box.
    assert_eq!(all, faces * number("/counts/triangles"));
    assert!(drawn > 0 && drawn <= all);
    assert!(number("/memory/device/lightmap sums") >= 24 * number("/counts/texels"));
    assert!(sum("/memory/device") >= number("/memory/device_peak"));
}

fn read(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).expect("a file")).expect("JSON")
}

#[test]
fn a_trace_holds_the_bake_on_one_time_line() {
    let folder = tempdir().unwrap();
    let scene = builtin("cornell", folder.path());
    let file = folder.path().join("trace.json");
    let tiny = "--quality draft --texels 4k --paths 2000 --clusters 30 --shadow-size 16";
    let options = format!("{tiny} --trace {}", file.display());
    let (_, report) = bake(&scene, "out", &options);
    let trace = read(&file);
    let slices = slices(&trace);
    check_nesting(&slices);
    let of = |kind: &str| -> Vec<&Value> {
        slices
            .iter()
            .filter(|s| s["cat"] == kind)
            .copied()
            .collect()
    };

    let spans = of("span");
    for name in [
        "rebake",
        "paths",
        "octree",
        "wanted",
        "record batch",
        "wait",
        "trace paths",
    ] {
        assert!(spans.iter().any(|s| s["name"] == name), "no span `{name}`");
    }
    // A stage's span takes as long as bake.json says.
    let took = |name: &str| -> f64 {
        let spans = spans.iter().filter(|s| s["name"] == name);
        spans.map(|s| s["dur"].as_f64().unwrap()).sum()
    };
    for (stage, seconds) in report["seconds"].as_object().unwrap() {
        let (told, traced) = (seconds.as_f64().unwrap(), took(stage) * 1e-6);
        assert!(
            (told - traced).abs() < 2e-3,
            "{stage}: {told} s, {traced} s"
        );
    }

    let submissions = of("submission");
    let number = |slice: &Value| slice["args"]["submission"].as_u64().expect("a number");
    let by_number: BTreeMap<u64, (f64, f64)> =
        submissions.iter().map(|s| (number(s), span(s))).collect();
    assert_eq!(by_number.len(), submissions.len());
    let whole = span(spans.iter().find(|s| s["name"] == "rebake").unwrap());
    let all: Vec<_> = by_number.values().collect();
    assert!(all.windows(2).all(|w| w[0].1 <= w[1].0 + EXACT));
    assert!(all.iter().all(|s| inside(**s, whole)));
    // Whoever waited for a submission waited until it had run.
    for wait in spans.iter().filter(|s| s["name"] == "wait") {
        let ran = by_number[&number(wait)];
        assert!(span(wait).1 + 50.0 >= ran.1, "{wait}: {ran:?}");
    }

    let mut sums: BTreeMap<&str, (u64, f64)> = BTreeMap::new();
    for pass in of("pass") {
        assert!(inside(span(pass), by_number[&number(pass)]), "{pass}");
        let sum = sums.entry(pass["name"].as_str().unwrap()).or_default();
        *sum = (sum.0 + 1, sum.1 + pass["dur"].as_f64().unwrap() * 1e-3);
    }
    check_counts(&report);
    let timings = report["gpu"].as_array().unwrap();
    assert_eq!(timings.len(), sums.len());
    for timing in timings {
        let (calls, ms) = sums[timing["name"].as_str().unwrap()];
        assert_eq!(timing["calls"], calls, "{timing}");
        let told = timing["ms"].as_f64().unwrap();
        assert!((told - ms).abs() < 1e-3 * calls as f64, "{timing}: {ms} ms");
    }
}

#[test]
fn a_trace_is_refused_early_or_written_whole() {
    let folder = tempdir().unwrap();
    let nowhere = folder.path().join("none/trace.json");
    let output = rebake("-q devices --trace", &[&nowhere]);
    assert!(!output.status.success());
    assert!(output.stdout.is_empty() && said(&output).contains("none/trace.json"));
    // What fails is traced, too.
    let file = folder.path().join("trace.json");
    let missing = folder.path().join("missing.glb");
    let output = rebake("-q bake -o out --trace", &[&file, &missing]);
    assert!(!output.status.success());
    assert!(slices(&read(&file)).iter().any(|s| s["name"] == "load"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_viewers_trace_holds_frames_updates_and_passes() {
    let folder = tempdir().unwrap();
    let scene = builtin("cornell", folder.path());
    let walk = folder.path().join("walk.jsonl");
    let lines = [
        r#"{"do": "frame", "count": 2, "updates": 3}"#,
        r#"{"do": "transform", "node": "small.box", "translation": [0.4, 0.0, 0.5]}"#,
        r#"{"do": "frame", "count": 2, "updates": 3}"#,
    ];
    std::fs::write(&walk, lines.join("\n")).unwrap();
    let file = folder.path().join("trace.json");
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_viewer"))
        .args([
            &scene,
            Path::new("--headless"),
            Path::new("--script"),
            &walk,
        ])
        .args([Path::new("--frames-dir"), &folder.path().join("frames")])
        .args([Path::new("--trace"), &file])
        .args("--size 160x90 --quality draft --texels 4k".split(' '))
        .env_remove("RUST_LOG")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", said(&output));
    let trace = read(&file);
    let slices = slices(&trace);
    check_nesting(&slices);
    let of = |kind: &str, name: &str| -> Vec<(f64, f64)> {
        let own = slices
            .iter()
            .filter(|s| s["cat"] == kind && s["name"] == name);
        own.map(|s| span(s)).collect()
    };
    let [frames, edits] = ["frame", "edit"].map(|name| of("span", name));
    assert_eq!((frames.len(), edits.len()), (4, 1));
    for part in ["draw", "write picture"] {
        let parts = of("span", part);
        assert!(parts.len() >= 4, "{part}");
        assert!(parts.iter().all(|p| frames.iter().any(|f| inside(*p, *f))));
    }
    // Updates run between frames, after an edit as well.
    let updates = of("span", "update");
    assert!(updates.iter().any(|u| u.0 > edits[0].1));
    assert!(
        !updates
            .iter()
            .any(|u| frames.iter().any(|f| inside(*u, *f)))
    );
    for pass in ["view surfaces", "view tone", "view pages", "shadow cull"] {
        assert!(!of("pass", pass).is_empty(), "no pass `{pass}`");
    }
}

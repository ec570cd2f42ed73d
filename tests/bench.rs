//! Holds `rebake bench` to what a performance engineer relies on: every part has its figures, a second run can be compared with
//! the first, and what has got worse is an error.

#[path = "common/call.rs"]
mod call;

use std::path::Path;

use call::{rebake, said};
use serde_json::Value;
use tempfile::tempdir;

/// The cheapest measurement of everything.
const TINY: &str = "bench cornell --quality draft --texels 2k --paths 500 --clusters 8 --shadow-size 16 --repeats 2 --warm-up 0 \
    --sweep-paths 200,500 --sweep-texels 1k,2k --sweep-triangles 10,50 --sweep-batches 1,32 --sweep-cells 8,40";

fn figures(file: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(file).expect("figures")).expect("JSON")
}

#[test]
fn every_part_is_measured_and_compared() {
    let folder = tempdir().unwrap();
    let (old, new) = (
        folder.path().join("old.json"),
        folder.path().join("new.json"),
    );
    let plots = folder.path().join("plots");
    let output = rebake(&format!("{TINY} -o"), &[&old, Path::new("--plots"), &plots]);
    assert!(output.status.success(), "{}", said(&output));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("IBGI table 1") && text.contains("#T_uv"));
    for name in ["accumulation-ms", "cells-per-second", "response"] {
        let plot = plots.join(format!("cornell-{name}.png"));
        assert!(image::open(&plot).is_ok(), "{}", plot.display());
    }
    let first = figures(&old);
    let scene = &first["scenes"][0];
    let series: Vec<_> = scene["series"].as_array().unwrap().iter().collect();
    for (name, points) in [
        ("virtual light creation", 2),
        ("accumulation", 2),
        ("depth maps", 2),
        ("batches", 2),
        ("cells", 2),
    ] {
        let found = series.iter().find(|s| s["name"] == name);
        let found = found.unwrap_or_else(|| panic!("no series {name}"));
        assert_eq!(found["points"].as_array().unwrap().len(), points, "{name}");
    }
    let cells = series.iter().find(|s| s["name"] == "cells").unwrap();
    let at = |i: usize| cells["points"][i]["at"].as_f64().unwrap();
    assert!(at(0) < at(1), "more cells are asked for");
    let all = scene["figures"].as_array().unwrap();
    for name in [
        "bake",
        "virtual light",
        "T_uv",
        "move: updates",
        "wall: 95 % gone after",
        "frame, device",
        "move: limited updates are cheaper",
    ] {
        let figure = all.iter().find(|f| f["name"] == name);
        let figure = figure.unwrap_or_else(|| panic!("no figure {name}"));
        let of = |key: &str| figure[key].as_f64().unwrap();
        assert!(of("min") <= of("median") && of("median") <= of("max") && of("max") > 0.0);
    }

    // A later run against one that was a thousand times as fast, and against one that was as slow.
    let mut fast = first.clone();
    for figure in fast["scenes"][0]["figures"].as_array_mut().unwrap() {
        if figure["name"] == "bake" {
            figure["median"] = Value::from(figure["median"].as_f64().unwrap() / 1000.0);
        }
    }
    std::fs::write(&old, fast.to_string()).unwrap();
    let again = format!("{TINY} -q --only table --threshold 100 --compare");
    let output = rebake(&again, &[&old, Path::new("-o"), &new]);
    assert_eq!(output.status.code(), Some(1));
    let line = said(&output);
    assert!(
        line.contains("worse") && line.contains("cornell: bake"),
        "{line}"
    );
    // What was measured is written all the same.
    let output = rebake(&again, &[&new]);
    assert!(output.status.success(), "{}", said(&output));
}

#[test]
fn what_cannot_be_measured_is_one_line() {
    let folder = tempdir().unwrap();
    let other = folder.path().join("other.json");
    std::fs::write(&other, "{}").unwrap();
    for (arguments, words) in [
        ("bench -q no-such-scene", vec!["no-such-scene", "museum"]),
        ("bench -q missing.glb", vec!["missing.glb"]),
        (
            "bench -q cornell --script missing.jsonl",
            vec!["missing.jsonl"],
        ),
    ] {
        let output = rebake(arguments, &[]);
        assert_eq!(output.status.code(), Some(1), "{arguments}");
        let line = said(&output);
        assert_eq!(line.trim_end().lines().count(), 1, "{line}");
        assert!(words.iter().all(|w| line.contains(w)), "{line}");
    }
    let output = rebake("bench -q cornell --compare", &[&other]);
    assert_eq!(output.status.code(), Some(1));
    assert!(said(&output).contains("other.json"), "{}", said(&output));
}

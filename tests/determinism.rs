//! Holds the real binary to its promises: the same bytes every time, exact updates, balanced flux, a complete map in time.

#[path = "common/map.rs"]
mod map;
#[path = "common/run.rs"]
mod run;

use std::path::Path;
use std::time::{Duration, Instant};

use map::Map;
use run::{bake, builtin};
use serde_json::Value;
use tempfile::tempdir;

/// Small, yet with direct lights, polygons, disks and several batches.
const SMALL: &str = "--texels 12k --paths 8k --clusters 60 --shadow-size 64";

fn bytes(out: &Path, file: &str) -> Vec<u8> {
    std::fs::read(out.join(file)).expect("a file of the bake")
}

/// Whether two bakes wrote the same lightmap and, unless it is of another scene, the same scene.
fn assert_same(a: &Path, b: &Path, scene_too: bool, what: &str) {
    assert!(
        bytes(a, "lightmap_0.exr") == bytes(b, "lightmap_0.exr"),
        "{what}: lightmap_0.exr differs"
    );
    assert!(
        !scene_too || bytes(a, "scene.glb") == bytes(b, "scene.glb"),
        "{what}: scene.glb differs"
    );
}

#[test]
fn two_runs_any_threads_and_recorded_settings_give_the_same_bytes() {
    let folder = tempdir().unwrap();
    let scene = builtin("cornell", folder.path());
    let (first, report) = bake(&scene, "first", SMALL);
    let (again, _) = bake(&scene, "again", SMALL);
    assert_same(&first, &again, true, "a second run");
    for threads in [1, 2] {
        let options = format!("{SMALL} --threads {threads}");
        let (other, other_report) = bake(&scene, "other", &options);
        assert_eq!(other_report["device"]["threads"], threads);
        assert_same(&first, &other, true, &format!("--threads {threads}"));
        for part in ["settings", "atlas", "counts", "flux", "estimated_error"] {
            assert_eq!(
                report[part], other_report[part],
                "{part}, {threads} threads"
            );
        }
    }
    // The written scene with the recorded settings is the same bake: its atlas is now the authored one.
    let written = first.join("scene.glb");
    let recorded = first.join("bake.json");
    let (repeated, repeated_report) = bake(
        &written,
        "repeated",
        &format!("--settings {}", recorded.display()),
    );
    assert_same(&first, &repeated, false, "--settings");
    assert_eq!(report["settings"], repeated_report["settings"]);
    // Another seed is another bake, so the comparisons above can fail.
    let (seeded, _) = bake(&scene, "seeded", &format!("{SMALL} --seed 1"));
    assert!(bytes(&first, "lightmap_0.exr") != bytes(&seeded, "lightmap_0.exr"));
}

/// `--verify` subtracts every second light from the finished map, adds it again, and fails unless every bit is as before.
#[test]
fn subtracting_and_adding_restores_every_bit() {
    let folder = tempdir().unwrap();
    let scene = builtin("cornell", folder.path());
    let (plain, plain_report) = bake(&scene, "plain", SMALL);
    let sun_and_point = "--sun 50,20,800 --point 0.4,1.4,0.6,120";
    for (options, same) in [("", true), (sun_and_point, false)] {
        let (verified, report) = bake(&scene, "verified", &format!("{SMALL} {options} --verify"));
        assert_eq!(
            same,
            bytes(&plain, "lightmap_0.exr") == bytes(&verified, "lightmap_0.exr")
        );
        let sent = |report: &Value| report["counts"]["accumulated"].as_u64().expect("a count");
        assert!(
            sent(&report) > sent(&plain_report),
            "nothing was subtracted"
        );
    }
}

#[test]
fn flux_is_balanced() {
    let folder = tempdir().unwrap();
    for (name, options) in [
        ("cornell", SMALL.to_owned()),
        ("furnace", SMALL.to_owned()),
        ("integrating-sphere-0.8", format!("{SMALL} --bounces 3")),
    ] {
        let scene = builtin(name, folder.path());
        let (_, report) = bake(&scene, "out", &options);
        let flux = &report["flux"];
        for error in ["balance_error", "clustering_error"] {
            let value = flux[error].as_f64().expect("a number");
            assert!(value <= 1e-6, "{name}: {error} is {value}");
        }
        // The same from the recorded parts: what the lights sent either ended on a surface, left, or was cut off. Roulette
        // ends paths and strengthens others: what it took and gave is recorded too.
        let part = |name: &str| flux[name].as_f64().unwrap_or_else(|| panic!("flux.{name}"));
        let out = part("absorbed") + part("escaped") + part("lost_at_cap") + part("ended");
        let off = (part("sent") + part("gained") - out).abs() / part("sent");
        assert!(
            off < 1e-6,
            "{name}: {off} of the flux is unaccounted for: {flux}"
        );
        let cut = flux["lost_at_cap_share"].as_f64().expect("a number");
        if name.starts_with("integrating") {
            // Three surfaces pass on 80 % each; the fourth has no bounce left.
            assert!(
                (cut - 0.8f64.powi(3)).abs() < 0.01,
                "{name}: {cut} lost at the cap"
            );
        } else {
            assert!(cut < 0.002, "{name}: {cut} lost at the cap");
        }
    }
}

/// A budget that is too short for the whole bake gives a complete map of nearly the full brightness, near its time.
#[test]
fn a_budget_ends_in_time_with_a_complete_map() {
    let folder = tempdir().unwrap();
    let scene = builtin("cornell", folder.path());
    let options = "--texels 60k --quality production --clusters 6k";
    let timed = |name: &str, budget: &str| {
        let start = Instant::now();
        let baked = bake(&scene, name, &format!("{options} --budget {budget}"));
        (baked, start.elapsed())
    };
    // A bake in a few lights, which any budget allows, is never cut: it takes what it takes on this machine.
    let (_, least) = timed("least", "100ms");
    let budget = Duration::from_secs(6);
    let ((short, report), took) = timed("short", "6s");
    assert_eq!(
        report["stopped_early"], true,
        "6 s were enough: {}",
        report["seconds"]
    );
    assert!(
        took < budget + 2 * least,
        "took {took:?}, at least {least:?}"
    );
    let (full, full_report) = bake(&scene, "full", "--texels 60k");
    assert_eq!(full_report["stopped_early"], false);
    assert_eq!(report["atlas"], full_report["atlas"]);
    let (short, full) = (Map::read(&short), Map::read(&full));
    // By object: its mean over the texels of its rectangle.
    for object in report["atlas"]["objects"].as_array().expect("objects") {
        let number = |name: &str| object[name].as_u64().expect("a number") as usize;
        let mean = |map: &Map| {
            let rows = number("y")..number("y") + number("height");
            let texels =
                rows.flat_map(|y| &map.texels[y * map.size + number("x")..][..number("width")]);
            texels.flatten().sum::<f64>()
        };
        let off = mean(&short) / mean(&full) - 1.0;
        eprintln!("{}: {:+.2} %", object["name"], 100.0 * off);
        assert!(
            off.abs() < 0.1,
            "{}: the mean is {:.2} % off",
            object["name"],
            100.0 * off
        );
    }
    let mean = |map: &Map| map.texels.iter().flatten().sum::<f64>();
    let off = mean(&short) / mean(&full) - 1.0;
    assert!(off.abs() < 0.03, "the mean is {:.2} % off", 100.0 * off);
}

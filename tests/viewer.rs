//! The viewer through its program: what pictures show, and what it says when something is wrong.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn viewer(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_viewer"))
        .args(args)
        .env("RUST_BACKTRACE", "0")
        .output()
        .expect("the viewer starts")
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a path of ASCII")
}

fn cornell() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/cornell.gltf")
}

/// Plays a script on the Cornell box and returns its pictures, RGB.
fn play(name: &str, script: &str) -> Vec<image::RgbImage> {
    play_with(name, script, &cornell(), &[])
}

/// The same with another scene and more options.
fn play_with(name: &str, script: &str, scene: &Path, more: &[&str]) -> Vec<image::RgbImage> {
    let folder = tempfile::tempdir().expect("a folder");
    let walk = folder.path().join("walk.jsonl");
    let frames = folder.path().join(name);
    std::fs::write(&walk, script).expect("a script");
    let args = [
        text(scene),
        "--headless",
        "--script",
        text(&walk),
        "--frames-dir",
        text(&frames),
        "--size",
        "320x180",
        "--quality",
        "draft",
        "--texels",
        "8k",
        "--validate",
    ];
    let out = viewer(&[&args, more].concat());
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "{said}");
    assert_eq!(said, "");
    let pictures = (0..).map(|i| frames.join(format!("frame_{i:05}.png")));
    pictures
        .take_while(|path| path.exists())
        .map(|path| image::open(path).expect("a picture").into_rgb8())
        .collect()
}

/// Mean colour of the pixels around a place, given as shares of width and height.
fn around(picture: &image::RgbImage, x: f32, y: f32) -> [f32; 3] {
    let (width, height) = picture.dimensions();
    let (x, y) = ((x * width as f32) as u32, (y * height as f32) as u32);
    let mut sum = [0.0; 3];
    for dy in 0..5 {
        for dx in 0..5 {
            let pixel = picture.get_pixel(x + dx - 2, y + dy - 2);
            for (sum, value) in sum.iter_mut().zip(pixel.0) {
                *sum += f32::from(value) / 25.0;
            }
        }
    }
    sum
}

#[test]
fn pictures_show_the_light_of_the_map_and_are_the_same_each_time() {
    let script = concat!(
        "{\"do\":\"frame\"}\n",
        "{\"do\":\"wait\",\"until\":\"converged\"}\n",
        "{\"do\":\"frame\"}\n",
        "{\"do\":\"material\",\"material\":\"lamp\",\"emissiveStrength\":0.0}\n",
        "{\"do\":\"exposure\",\"ev\":2}\n",
        "{\"do\":\"wait\",\"until\":\"converged\"}\n",
        "{\"do\":\"frame\"}\n",
        "{\"do\":\"undo\"}\n",
        "{\"do\":\"exposure\"}\n",
        "{\"do\":\"wait\",\"until\":\"converged\"}\n",
        "{\"do\":\"frame\",\"count\":2}\n",
    );
    let pictures = play("pictures", script);
    assert_eq!(pictures.len(), 5);
    let [nothing, lit, dark, undone, again] = &pictures[..] else {
        unreachable!("five of them");
    };
    let back = around(nothing, 0.5, 0.25);
    assert!(back.iter().all(|v| *v < 4.0), "before any light: {back:?}");
    let (left, right) = (around(lit, 0.28, 0.5), around(lit, 0.72, 0.5));
    assert!(left[0] > 1.5 * left[1], "the left wall is red: {left:?}");
    assert!(
        right[1] > 1.5 * right[2],
        "the right wall is green: {right:?}"
    );
    let back = around(lit, 0.5, 0.25);
    assert!(back.iter().all(|v| *v > 40.0), "the back wall: {back:?}");
    let back = around(dark, 0.5, 0.25);
    assert!(back.iter().all(|v| *v < 4.0), "the lamp is off: {back:?}");
    assert_eq!(undone, lit, "undone is as before");
    assert_eq!(again, undone);
}

#[test]
fn false_colours_tell_lux_apart() {
    let script = concat!(
        "{\"do\":\"wait\",\"until\":\"converged\"}\n",
        "{\"do\":\"look\",\"look\":\"lux\",\"scale\":[0.001,0.002]}\n{\"do\":\"frame\"}\n",
        "{\"do\":\"look\",\"look\":\"lux\",\"scale\":[1e6,1e7]}\n{\"do\":\"frame\"}\n",
    );
    let pictures = play("lux", script);
    let [above, below] = [&pictures[0], &pictures[1]].map(|p| around(p, 0.5, 0.25));
    assert!(
        above[0] > 100.0 && above[2] < 20.0,
        "beyond the scale: {above:?}"
    );
    assert!(
        below[0] < 80.0 && below[1] < 60.0,
        "below the scale: {below:?}"
    );
}

/// Shares of a picture that differ from another one much, right of the scales, and left of them.
fn changed(a: &image::RgbImage, b: &image::RgbImage) -> [f32; 2] {
    let mut counts = [[0, 0]; 2];
    for (x, y, pixel) in a.enumerate_pixels() {
        let other = b.get_pixel(x, y);
        let far = (0..3).any(|k| pixel.0[k].abs_diff(other.0[k]) > 24);
        let side = &mut counts[usize::from(x < a.width() / 5)];
        side[0] += usize::from(far);
        side[1] += 1;
    }
    counts.map(|[far, all]| far as f32 / all as f32)
}

#[test]
fn overlays_lie_over_the_scene_with_their_scales_and_go_again() {
    let script = concat!(
        "{\"do\":\"exposure\",\"ev\":5}\n",
        "{\"do\":\"wait\",\"until\":\"converged\"}\n",
        "{\"do\":\"frame\"}\n",
        "{\"do\":\"overlay\",\"show\":[\"lights\"]}\n{\"do\":\"frame\"}\n",
        "{\"do\":\"overlay\",\"show\":[\"cells\"]}\n{\"do\":\"frame\"}\n",
        "{\"do\":\"overlay\",\"show\":[\"vpls\"]}\n{\"do\":\"frame\"}\n",
        "{\"do\":\"overlay\",\"show\":[\"invalid\"]}\n{\"do\":\"frame\"}\n",
        "{\"do\":\"material\",\"material\":\"lamp\",\"emissiveStrength\":8.0}\n",
        "{\"do\":\"wait\",\"until\":{\"updates\":0}}\n{\"do\":\"frame\",\"updates\":0}\n",
        "{\"do\":\"undo\"}\n{\"do\":\"wait\",\"until\":\"converged\"}\n{\"do\":\"frame\"}\n",
    );
    let pictures = play("overlays", script);
    let [plain, lights, cells, vpls, valid, invalid, again] = &pictures[..] else {
        panic!("{} pictures", pictures.len());
    };
    let [scene, scale] = changed(plain, lights);
    assert!(scene > 0.3 && scale > 0.05, "lights: {scene} {scale}");
    let [scene, scale] = changed(plain, cells);
    assert!(
        (0.02..0.6).contains(&scene) && scale > 0.05,
        "cells: {scene} {scale}"
    );
    let [scene, scale] = changed(plain, vpls);
    assert!(
        (0.02..0.9).contains(&scene) && scale == 0.0,
        "VPLs: {scene} {scale}"
    );
    assert_eq!(valid, plain, "nothing is invalid");
    let [scene, scale] = changed(plain, invalid);
    assert!(scene > 0.02 && scale > 0.05, "invalid: {scene} {scale}");
    assert_eq!(again, plain, "all is valid again");
}

#[test]
fn a_page_is_shown_flat_with_its_charts_and_texels_on_the_scene() {
    let script = concat!(
        "{\"do\":\"wait\",\"until\":\"converged\"}\n",
        "{\"do\":\"look\",\"look\":\"page\"}\n{\"do\":\"frame\"}\n",
        "{\"do\":\"look\",\"look\":\"page\",\"center\":[0.05,0.05],\"zoom\":8}\n{\"do\":\"frame\"}\n",
        "{\"do\":\"look\",\"look\":\"texels\"}\n{\"do\":\"frame\"}\n",
        "{\"do\":\"exposure\",\"ev\":9}\n{\"do\":\"frame\"}\n",
    );
    let pictures = play("page", script);
    let [page, corner, texels, darker] = &pictures[..] else {
        panic!("{} pictures", pictures.len());
    };
    // Beside the page is nothing; its first chart begins near its corner.
    let outside = around(page, 0.1, 0.5);
    assert!(outside.iter().all(|v| *v < 32.0), "{outside:?}");
    let inside = around(corner, 0.6, 0.6);
    assert!(inside.iter().all(|v| *v > 40.0), "{inside:?}");
    let colourful = |picture: &image::RgbImage| {
        let far = |p: &&image::Rgb<u8>| p.0.iter().max().unwrap() - p.0.iter().min().unwrap() > 60;
        picture.pixels().filter(far).count()
    };
    assert!(colourful(page) > 300, "outlines: {}", colourful(page));
    let (x, y) = (160, 100);
    let near: Vec<_> = (0..40)
        .map(|i| texels.get_pixel(x - 20 + i, y).0[2])
        .collect();
    let (low, high) = (near.iter().min().unwrap(), near.iter().max().unwrap());
    assert!(high - low > 40, "texels differ: {near:?}");
    assert_eq!(texels, darker, "whatever the light is");
}

#[test]
fn errors_are_told_against_a_reference_of_the_same_texels() {
    let folder = tempfile::tempdir().expect("a folder");
    let bake = folder.path().join("bake");
    let out = Command::new(env!("CARGO_BIN_EXE_rebake"))
        .args(["bake", text(&cornell()), "-o", text(&bake), "-q"])
        .args(["--quality", "draft", "--texels", "8k"])
        .output()
        .expect("rebake starts");
    assert!(
        out.status.success(),
        "{}",
        String::from_utf8_lossy(&out.stderr)
    );
    let script = concat!(
        "{\"do\":\"wait\",\"until\":\"converged\"}\n",
        "{\"do\":\"look\",\"look\":\"error\",\"scale\":[0.01,1]}\n{\"do\":\"frame\"}\n",
        "{\"do\":\"material\",\"material\":\"lamp\",\"emissiveStrength\":1530}\n",
        "{\"do\":\"wait\",\"until\":\"converged\"}\n{\"do\":\"frame\"}\n",
    );
    let scene = bake.join("scene.glb");
    let more = ["--reference", text(&bake)];
    let pictures = play_with("error", script, &scene, &more);
    let [same, dimmed] = &pictures[..] else {
        panic!("{} pictures", pictures.len());
    };
    let [same, dimmed] = [same, dimmed].map(|p| around(p, 0.5, 0.25));
    assert!(same[1] < 40.0 && same[0] < 70.0, "below 1 %: {same:?}");
    // The lamp had 5,100: an error of 70 %.
    assert!(dimmed[0] > 120.0 && dimmed[2] < 40.0, "{dimmed:?}");

    // Without one, or with one of other texels, a line says so.
    let walk = folder.path().join("walk.jsonl");
    std::fs::write(&walk, "{\"do\":\"look\",\"look\":\"error\"}").expect("a script");
    let frames = folder.path().join("frames");
    let options = [
        "--headless",
        "--script",
        text(&walk),
        "--frames-dir",
        text(&frames),
    ];
    let fail = |more: &[&str]| {
        let scene = cornell();
        let out = viewer(&[&[text(&scene)], &options[..], more].concat());
        assert!(!out.status.success());
        String::from_utf8_lossy(&out.stderr).into_owned()
    };
    let said = fail(&[]);
    assert!(
        said.contains("line 1") && said.contains("--reference"),
        "{said}"
    );
    let said = fail(&["--texels", "400k", "--reference", text(&bake)]);
    assert!(
        said.contains("other pages") && said.contains("scene.glb"),
        "{said}"
    );
}

#[test]
fn lights_that_are_added_shine() {
    let script = concat!(
        "{\"do\":\"exposure\",\"ev\":9}\n",
        "{\"do\":\"wait\",\"until\":\"converged\"}\n{\"do\":\"frame\"}\n",
    );
    let without = play("without", script);
    let more = ["--sun", "20,180,20000", "--point", "0,1,0,100"];
    let with = play_with("with", script, &cornell(), &more);
    let [without, with] = [&without, &with].map(|p| around(&p[0], 0.5, 0.3));
    assert!(with[0] > without[0] + 20.0, "{without:?} {with:?}");
}

#[test]
fn says_in_a_line_what_is_wrong() {
    let folder = tempfile::tempdir().expect("a folder");
    let walk = folder.path().join("walk.jsonl");
    std::fs::write(&walk, "\n{\"do\":\"camera\",\"name\":\"nowhere\"}\n").expect("a script");
    let (scene, frames) = (cornell(), folder.path().join("frames"));
    let play = |walk: &Path| {
        let args = [
            text(&scene),
            "--headless",
            "--script",
            text(walk),
            "--frames-dir",
            text(&frames),
        ];
        let out = viewer(&args);
        assert!(!out.status.success());
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        assert_eq!(said.lines().count(), 1, "{said}");
        said
    };
    let said = play(&walk);
    assert!(
        said.contains("line 2") && said.contains("\"nowhere\""),
        "{said}"
    );
    let said = play(&folder.path().join("none.jsonl"));
    assert!(said.contains("none.jsonl"), "{said}");
    std::fs::write(&walk, "{\"do\":\"fly\"}").expect("a script");
    let said = play(&walk);
    assert!(
        said.contains("line 1") && said.contains("camera, frame"),
        "{said}"
    );
}

#[test]
fn walking_and_editing_again_and_again_takes_no_more_memory() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let stats = folder.path().join("stats.json");
    let frames = folder.path().join("frames");
    let walk = root.join("assets/walks/endurance.jsonl");
    let scene = cornell();
    let out = Command::new(env!("CARGO_BIN_EXE_viewer"))
        .args([text(&scene), "--headless", "--script", text(&walk)])
        .args(["--frames-dir", text(&frames), "--stats", text(&stats)])
        .args(["--size", "160x90", "--quality", "draft", "--texels", "4k"])
        .args(["--for", "12"])
        .output()
        .expect("the viewer starts");
    assert!(
        out.status.success(),
        "{}",
        String::from_utf8_lossy(&out.stderr)
    );
    let stats = std::fs::read_to_string(stats).expect("statistics");
    let stats: serde_json::Value = serde_json::from_str(&stats).expect("JSON");
    let memory = stats["memory"].as_array().expect("a list");
    let held = |i: usize, key: &str| memory[i][key].as_f64().expect("bytes") / 1e6;
    assert!(memory.len() >= 4, "too slow to tell: {memory:?}");
    // The first rounds fill caches and pools.
    let (early, last) = (memory.len() / 2, memory.len() - 1);
    let device = [early, last].map(|i| held(i, "device_bytes"));
    assert!(device[1] <= device[0] * 1.01, "device, MB: {device:?}");
    let host = [early, last].map(|i| held(i, "host_bytes"));
    assert!(host[1] <= host[0] * 1.05 + 4.0, "host, MB: {host:?}");
}

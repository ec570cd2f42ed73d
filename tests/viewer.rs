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
    let folder = tempfile::tempdir().expect("a folder");
    let walk = folder.path().join("walk.jsonl");
    let frames = folder.path().join(name);
    std::fs::write(&walk, script).expect("a script");
    let scene = cornell();
    let args = [
        text(&scene),
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
    let out = viewer(&args);
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

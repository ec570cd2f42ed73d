//! Holds the way to a converged map to what is promised: no energy is missing or counted twice between two updates.

use std::path::Path;
use std::time::Duration;

use glam::Vec3;
use rebake::bake::{Baker, Job, Limit, Options, Quality, Silent};
use rebake::gpu::{Gpu, GpuOptions};
use rebake::lightmap::AtlasOptions;
use rebake::scene::edit::Command;
use rebake::scene::{Camera, Scene, builtin::builtin};

fn values(baker: &mut Baker) -> Vec<f32> {
    let map = baker.lightmap().expect("a device");
    map.pages.into_iter().flatten().flatten().collect()
}

/// Over the texels that are anything's: the others hold nothing.
fn mean(values: &[f32]) -> f64 {
    let lit = values.iter().filter(|v| **v != 0.0);
    lit.clone().map(|v| f64::from(*v)).sum::<f64>() / lit.count() as f64
}

/// The Cornell box, baked.
fn cornell(quality: Quality) -> Baker {
    let gpu = Gpu::new(&GpuOptions::default())
        .expect("a Vulkan device (tools/setup.sh installs lavapipe)");
    let document = builtin("cornell").expect("built in");
    let scene = Scene::from_document(&document).expect("a scene");
    let job = Job {
        atlas: AtlasOptions {
            texels: 8192,
            ..AtlasOptions::default()
        },
        options: Options {
            quality: Some(quality),
            ..Options::default()
        },
        ..Job::default()
    };
    let mut baker = Baker::new(&gpu, scene, document, &job, &Silent).expect("a bake");
    baker.step(Limit::Converged).expect("a bake");
    baker
}

fn edit(baker: &mut Baker, line: &str) {
    let Ok(Command::Edit(edit)) = Command::parse(line) else {
        panic!("{line} is no edit");
    };
    baker.apply(&edit, Path::new(".")).expect("an edit");
}

/// Looks into the corner between the floor and a wall, on the left or on the right.
fn corner(side: f32) -> Camera {
    Camera::looking(Vec3::new(0.0, 1.0, 0.9), Vec3::new(side, 0.2, -0.5))
}

/// The map after every so many updates, the first and the last one included.
fn frames(quality: Quality, line: &str, every: u64, camera: Option<&Camera>) -> Vec<Vec<f32>> {
    let mut baker = cornell(quality);
    baker.look_from(camera);
    let mut frames = vec![values(&mut baker)];
    edit(&mut baker, line);
    while !baker.is_converged() {
        baker.step(Limit::Updates(every)).expect("updates");
        frames.push(values(&mut baker));
    }
    frames
}

const DIM: &str = r#"{"do": "material", "material": "lamp", "emissiveStrength": 2500}"#;

#[test]
fn a_light_that_is_dimmed_grows_dark_without_flicker() {
    let [bright, dark] = one_way(Quality::Preview, DIM, None);
    assert!(dark < 0.6 * bright, "{bright} {dark}");
}

#[test]
fn what_is_seen_of_a_dimmed_light_goes_ahead_without_flicker() {
    one_way(Quality::Preview, DIM, Some(&corner(-1.0)));
}

#[test]
fn few_lights_flicker_as_little_when_theirs_is_dimmed_or_grows() {
    one_way(Quality::Draft, DIM, None);
    let brighter = r#"{"do": "material", "material": "lamp", "emissiveStrength": 8000}"#;
    let [dark, bright] = one_way(Quality::Draft, brighter, None);
    assert!(bright > 1.3 * dark, "{dark} {bright}");
}

/// Makes an edit that only brightens or only dims, update by update: no texel leaves what lies between its first value and its
/// last. Returns the maps' means before and after.
fn one_way(quality: Quality, line: &str, camera: Option<&Camera>) -> [f64; 2] {
    let frames = frames(quality, line, 1, camera);
    let (old, new) = (&frames[0], &frames[frames.len() - 1]);
    let means = [mean(old), mean(new)];
    assert!(frames.len() > 20);
    for (at, frame) in frames.iter().enumerate() {
        let beyond = (0..frame.len())
            .map(|i| {
                let (low, high) = (old[i].min(new[i]), old[i].max(new[i]));
                (frame[i] - high).max(low - frame[i])
            })
            .fold(0.0, f32::max);
        assert!(
            f64::from(beyond) <= 1e-6 * means[0],
            "update {at}: a texel is {beyond} lux beyond both maps, whose means are {means:?}"
        );
    }
    means
}

#[test]
fn slices_cut_updates_anywhere_and_edits_may_come_there() {
    let mut baker = cornell(Quality::Preview);
    baker.look_from(Some(&corner(-1.0)));
    let before = values(&mut baker);
    // So short that each sends a light.
    let slice = |whole| Limit::Slice {
        time: Duration::from_nanos(1),
        whole,
    };
    edit(
        &mut baker,
        r#"{"do": "transform", "node": "small.box", "translation": [0.4, 0.0, 0.5]}"#,
    );
    let (mut cut, mut steps) = (0, 0);
    while cut < 20 {
        let progress = baker.step(slice(false)).expect("a slice");
        assert!(progress.updates <= 1 && !progress.converged, "{progress:?}");
        cut += u32::from(!baker.is_whole());
        steps += 1;
        assert!(steps < 500, "updates of several lights are cut");
    }
    while baker.is_whole() {
        baker.step(slice(false)).expect("a slice");
    }
    // In the middle of an update, and of what was seen first.
    baker.look_from(Some(&corner(1.0)));
    edit(
        &mut baker,
        r#"{"do": "material", "material": "lamp", "emissiveStrength": 9000}"#,
    );
    edit(&mut baker, r#"{"do": "remove", "node": "tall.box"}"#);
    assert!(!baker.is_whole());
    let mut steps = 0;
    while !baker.is_whole() {
        let progress = baker.step(slice(true)).expect("a slice");
        assert_eq!(progress.updates, 0, "nothing is begun");
        steps += 1;
        assert!(steps < 100, "what was begun is finished");
    }
    for _ in 0..30 {
        baker.step(slice(false)).expect("a slice");
    }
    for _ in 0..3 {
        baker.undo().expect("an edit to undo");
        baker.step(slice(false)).expect("a slice");
    }
    // Large slices now: to the end, which leaves nothing waiting.
    while !baker.is_converged() {
        let time = Duration::from_millis(200);
        baker
            .step(Limit::Slice { time, whole: false })
            .expect("a slice");
    }
    assert!(baker.is_whole());
    baker
        .verify()
        .expect("every texel holds what its lights give");
    assert!(
        values(&mut baker) == before,
        "the map is as before, bit for bit"
    );
}

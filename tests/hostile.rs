//! Two hundred corrupted inputs: none may panic, hang, eat the memory or leave half a result, and each says why in one line.

mod hostile_cases;

use std::{
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
    time::{Duration, Instant},
};

use hostile_cases::{Case, base, cases, glb};
use rebake::scene::{Document, Scene, overlay_lights};

fn write(case: &Case, folder: &Path) -> std::path::PathBuf {
    for (name, bytes) in &case.files {
        fs::write(folder.join(name), bytes).unwrap();
    }
    folder.join(case.files.first().map_or("missing.glb", |(name, _)| name))
}

/// Peak memory of this process in MiB, where the system tells it.
fn peak_memory() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| {
        line.trim()
            .trim_end_matches(" kB")
            .trim()
            .parse::<u64>()
            .ok()
    })
    .unwrap_or(0)
        / 1024
}

#[test]
fn the_undamaged_scene_loads() {
    let scene = Scene::from_document(&Document::parse(&glb(&base()), None).unwrap()).unwrap();
    scene.validate().unwrap();
    assert_eq!(
        (
            scene.objects.len(),
            scene.lights.len(),
            scene.cameras.len(),
            scene.textures.len()
        ),
        (2, 3, 1, 1)
    );
}

#[test]
fn the_loader_survives_all() {
    let cases = cases();
    assert!(cases.len() >= 200, "{}", cases.len());
    let (mut wrong, mut failed) = (Vec::new(), 0);
    for case in &cases {
        let folder = tempfile::tempdir().unwrap();
        let path = write(case, folder.path());
        let start = Instant::now();
        let result = catch_unwind(AssertUnwindSafe(|| {
            let (mut scene, mut document) = Scene::load(&path)?;
            scene.validate()?;
            document.to_glb()?;
            let center = scene.bounds().center();
            assert!(center.is_finite());
            let weights = glam::Vec3::splat(1.0 / 3.0);
            for object in 0..scene.objects.len() as u32 {
                for triangle in 0..scene.mesh(object).triangles.len() as u32 {
                    assert!(
                        scene.albedo(object, triangle, weights).is_finite()
                            && scene.emission(object, triangle, weights).is_finite()
                    );
                    scene.alpha_passes(object, triangle, weights);
                    assert!(
                        scene
                            .world_triangle(object, triangle)
                            .iter()
                            .all(|corner| corner.is_finite())
                    );
                }
            }
            overlay_lights(&mut scene, &mut document, &path)
        }));
        let time = start.elapsed();
        match result {
            Err(_) => wrong.push(format!("{}: panic", case.name)),
            Ok(Ok(())) if case.must_fail => wrong.push(format!("{}: accepted", case.name)),
            Ok(Ok(())) => {}
            Ok(Err(error)) => {
                failed += 1;
                let line = error.to_string();
                if line.is_empty() || line.len() > 600 || line.chars().any(char::is_control) {
                    wrong.push(format!("{}: not one clear line: {line:?}", case.name));
                }
            }
        }
        if time > Duration::from_secs(2) {
            wrong.push(format!("{}: took {time:?}", case.name));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(
        failed > 120,
        "only {failed} were refused: the inputs are not hostile"
    );
    assert!(peak_memory() < 1024, "{} MiB", peak_memory());
}

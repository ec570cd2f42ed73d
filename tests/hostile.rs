//! Two hundred corrupted inputs: none may panic, hang, eat the memory or leave half a result, and each says why in one line.

mod hostile_cases;

use std::{
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
    process::{Command, Output, Stdio},
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

use hostile_cases::{Case, base, cases, glb};
use rebake::scene::{
    Document, Scene,
    edit::{self, Editor},
    overlay_lights,
};

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

/// Runs the program; none if it has to be killed.
fn bake(scene: &Path, out: &Path) -> Option<Output> {
    let mut child = Command::new(env!("CARGO_BIN_EXE_rebake"))
        .args([
            "bake",
            "-q",
            "--quality",
            "draft",
            "--texels",
            "1k",
            "--paths",
            "1k",
            "--bounces",
            "2",
            "--clusters",
            "8",
        ])
        .arg(scene)
        .arg("-o")
        .arg(out)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > Duration::from_secs(60) {
            child.kill().unwrap();
            child.wait().unwrap();
            return None;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Some(child.wait_with_output().unwrap())
}

/// What the program did wrong with an input, if anything.
fn misbehaviour(case: &Case) -> Option<String> {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(case, folder.path());
    let out = folder.path().join("out");
    let before = fs::read_dir(folder.path()).unwrap().count();
    let Some(output) = bake(&scene, &out) else {
        return Some("did not end".into());
    };
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    match output.status.code() {
        Some(0) if case.must_fail => Some("accepted".into()),
        Some(0) => {
            let whole = ["scene.glb", "lightmap_0.exr", "bake.json"]
                .iter()
                .all(|file| out.join(file).is_file());
            (!whole || Scene::load(&out.join("scene.glb")).is_err())
                .then(|| "success without a whole result".into())
        }
        Some(1) => {
            let lines: Vec<&str> = said.lines().collect();
            if lines.len() != 1 || !lines[0].starts_with("error: ") || lines[0].len() > 700 {
                return Some(format!("not one clear line: {said:?}"));
            }
            let left = fs::read_dir(folder.path()).unwrap().count();
            (left != before).then(|| "something of the output is left".into())
        }
        code => Some(format!("ended with {code:?}: {said}")),
    }
}

#[test]
fn the_program_survives_all() {
    let cases = cases();
    let next = AtomicUsize::new(0);
    let wrong = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(2, usize::from) {
            scope.spawn(|| {
                while let Some(case) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if let Some(what) = misbehaviour(case) {
                        wrong.lock().unwrap().push(format!("{}: {what}", case.name));
                    }
                }
            });
        }
    });
    let wrong = wrong.into_inner().unwrap();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn edits_survive_all() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.glb"), glb(&base())).unwrap();
    let (scene, document) = Scene::load(&folder.path().join("scene.glb")).unwrap();
    let mut editor = Editor::new(scene, document).unwrap();
    let first = (editor.document().json.clone(), editor.scene().clone());
    let (mut accepted, mut refused) = (0, 0);
    for line in hostile_cases::lines::lines() {
        let result = edit::Command::parse(&line).and_then(|command| match command {
            edit::Command::Edit(edit) => editor.apply(&edit, folder.path()).map(drop),
            _ => panic!("{line} was read as {command:?}"),
        });
        match result {
            Ok(()) => {
                accepted += 1;
                assert!(editor.scene().bounds().center().is_finite(), "{line}");
                let written = editor.document().to_glb().unwrap();
                let read = Scene::from_document(&Document::parse(&written, None).unwrap());
                assert_eq!(read.unwrap().lights.len(), editor.scene().lights.len());
                editor.undo().unwrap();
            }
            Err(error) => {
                refused += 1;
                let said = error.to_string();
                assert!(
                    !said.is_empty() && said.len() < 600 && !said.chars().any(char::is_control),
                    "{line}: {said:?}"
                );
            }
        }
        assert!(
            editor.document().json == first.0 && *editor.scene() == first.1,
            "{line}"
        );
    }
    assert!(
        accepted > 10 && refused > 500,
        "{accepted} accepted, {refused} refused"
    );
}

#[test]
fn additions_of_all_survive() {
    let document = Document::parse(&glb(&base()), None).unwrap();
    let scene = Scene::from_document(&document).unwrap();
    let mut editor = Editor::new(scene, document).unwrap();
    let first = editor.document().json.clone();
    for case in cases() {
        let folder = tempfile::tempdir().unwrap();
        let path = write(&case, folder.path());
        let add = edit::Edit::Add {
            file: path.file_name().unwrap().to_string_lossy().into_owned(),
            name: None,
            parent: Some("parent".into()),
        };
        if let Err(error) = editor.apply(&add, folder.path()) {
            let said = error.to_string();
            assert!(
                said.len() < 700 && !said.chars().any(char::is_control),
                "{}: {said:?}",
                case.name
            );
        } else {
            // Whatever it was: it can be edited, written, and taken back.
            let last = editor.document().json["nodes"].as_array().unwrap().len() as u32 - 1;
            for edit in [
                edit::Edit::Copy {
                    node: last.into(),
                    name: None,
                },
                edit::Edit::Transform {
                    node: last.into(),
                    translation: Some([0.5; 3]),
                    rotation: None,
                    scale: None,
                },
                edit::Edit::Material {
                    material: 0.into(),
                    base_color_factor: Some([0.5; 4]),
                    emissive_factor: Some([0.5; 3]),
                    emissive_strength: Some(2.0),
                },
                edit::Edit::Remove { node: last.into() },
            ] {
                // A refusal is as good.
                let _ = editor.apply(&edit, folder.path());
            }
            let written = editor.document().to_glb().unwrap();
            Scene::from_document(&Document::parse(&written, None).unwrap()).unwrap();
            while editor.undo().is_ok() {}
        }
        assert_eq!(editor.document().json, first, "{}", case.name);
    }
}

#[test]
fn edits_of_all_survive() {
    for case in cases() {
        let folder = tempfile::tempdir().unwrap();
        let Ok((scene, document)) = Scene::load(&write(&case, folder.path())) else {
            continue;
        };
        let first = document.json.clone();
        let Ok(mut editor) = Editor::new(scene, document) else {
            panic!("{}: read once, but not twice", case.name);
        };
        let count = |key: &str| first[key].as_array().map_or(0, Vec::len) as u32;
        let nodes = (0..count("nodes")).flat_map(|node| {
            [
                edit::Edit::Copy {
                    node: node.into(),
                    name: None,
                },
                edit::Edit::Transform {
                    node: node.into(),
                    translation: None,
                    rotation: None,
                    scale: Some([0.5; 3]),
                },
                edit::Edit::Light {
                    node: node.into(),
                    intensity: Some(3.0),
                    color: None,
                    spot: Some(edit::Spot {
                        inner_cone_angle: Some(0.1),
                        outer_cone_angle: None,
                    }),
                },
                edit::Edit::Remove { node: node.into() },
            ]
        });
        let materials = (0..count("materials")).map(|material| edit::Edit::Material {
            material: material.into(),
            base_color_factor: Some([0.5; 4]),
            emissive_factor: Some([0.5; 3]),
            emissive_strength: Some(2.0),
        });
        for edit in materials.chain(nodes) {
            // A refusal is as good.
            let _ = editor.apply(&edit, folder.path());
        }
        while editor.undo().is_ok() {}
        assert_eq!(
            editor.document().json.to_string(),
            first.to_string(),
            "{}",
            case.name
        );
    }
}

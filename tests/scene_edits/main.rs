//! Edits: whatever a script does, the scene is its document's, is written as it is, and goes back where it came from.

mod fixtures;
mod oracle;
mod refusals;
mod scripts;

use std::{path::Path, sync::Arc};

use fixtures::{chair, write_chair};
use oracle::check;
use rebake::scene::{
    Aperture, Document, Light, Scene,
    builtin::builtin,
    edit::{Change, Command, EditError, Editor},
};
use serde_json::{Value, json};

fn open(name: &str) -> Editor {
    let document = builtin(name).unwrap();
    Editor::new(Scene::from_document(&document).unwrap(), document).unwrap()
}

fn parsed(value: &Value) -> Document {
    Document::parse(value.to_string().as_bytes(), None).unwrap()
}

fn editor(value: &Value) -> Editor {
    let document = parsed(value);
    Editor::new(Scene::from_document(&document).unwrap(), document).unwrap()
}

fn apply(editor: &mut Editor, line: Value, folder: &Path) -> Result<Change, EditError> {
    match Command::parse(&line.to_string())? {
        Command::Edit(edit) => editor.apply(&edit, folder),
        Command::Undo => editor.undo(),
        Command::Redo => editor.redo(),
        Command::Wait(_) => Ok(Change::default()),
    }
}

fn object<'a>(editor: &'a Editor, name: &str) -> (u32, &'a rebake::scene::Object) {
    let objects = &editor.scene().objects;
    let at = objects.iter().position(|o| o.name == name).unwrap();
    (at as u32, &objects[at])
}

/// The light on the only node of that name.
fn lamp<'a>(editor: &'a Editor, name: &str) -> &'a Light {
    let lights = &editor.scene().lights;
    lights.iter().find(|l| l.name == name).unwrap()
}

#[test]
fn a_transform_keeps_what_it_leaves_out() {
    let mut editor = editor(&chair());
    let here = Path::new(".");
    let before = object(&editor, "seat").1.transform;
    // The frame has a matrix: it halves and moves by (0.2, 0.1, 0).
    let line = json!({"do": "transform", "node": "frame", "translation": [1, 2, 3]});
    let change = apply(&mut editor, line, here).unwrap();
    let after = object(&editor, "seat").1.transform;
    assert_eq!(after.matrix3, before.matrix3);
    assert_eq!(after.translation, glam::Vec3A::new(1.0, 2.0, 3.0));
    assert!(editor.document().json["nodes"][2].get("matrix").is_some());
    assert_eq!((change.objects, change.lights), (vec![0, 1], vec![1, 3]));

    let line = json!({"do": "transform", "node": "frame", "rotation": [0, 2, 0, 0]});
    apply(&mut editor, line, here).unwrap();
    let turned = object(&editor, "seat").1.transform;
    assert!(
        turned
            .matrix3
            .x_axis
            .abs_diff_eq(glam::Vec3A::new(-0.5, 0.0, 0.0), 1e-6)
    );
    assert_eq!(turned.translation, after.translation);
    let frame = &editor.document().json["nodes"][2];
    assert_eq!(
        (frame.get("matrix"), &frame["rotation"]),
        (None, &json!([0.0, 1.0, 0.0, 0.0]))
    );

    let line = json!({"do": "transform", "node": 3, "translation": [0.1, 0.2, 0.3]});
    let change = apply(&mut editor, line, here).unwrap();
    assert_eq!(
        (change.objects, change.surfaces, change.lights),
        (vec![], vec![], vec![6])
    );
    // As it was given, not as single precision has it.
    assert_eq!(
        editor.document().json["nodes"][3]["translation"].to_string(),
        "[0.1,0.2,0.3]"
    );
}

#[test]
fn a_sheared_matrix_has_no_parts_to_keep() {
    let mut file = chair();
    file["nodes"][2]["matrix"][4] = 0.3.into();
    let mut editor = editor(&file);
    let line = json!({"do": "transform", "node": "frame", "scale": [1, 1, 1]});
    let message = apply(&mut editor, line, Path::new("."))
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("node 2 (frame), \"scale\"") && message.contains("give the rotation too"),
        "{message}"
    );
    let line =
        json!({"do": "transform", "node": "frame", "scale": [1, 1, 1], "rotation": [0, 0, 0, 1]});
    apply(&mut editor, line, Path::new(".")).unwrap();
    let expected = glam::Affine3A::from_translation(glam::Vec3::new(0.2, 0.1, 0.0));
    assert_eq!(object(&editor, "seat").1.transform, expected);
}

#[test]
fn a_shared_light_is_split_and_a_shared_material_is_not() {
    let mut editor = editor(&chair());
    let here = Path::new(".");
    let right = lamp(&editor, "right").clone();
    let line = json!({"do": "light", "node": "left", "intensity": 7, "color": [0, 1, 0], "spot": {"innerConeAngle": 0.1}});
    let change = apply(&mut editor, line, here).unwrap();
    assert_eq!((change.objects, change.lights), (vec![], vec![6]));
    let left = lamp(&editor, "left");
    assert_eq!(left.intensity, glam::Vec3::new(0.0, 7.0, 0.0));
    assert_eq!(
        left.aperture,
        Aperture::Spot {
            inner: 0.1,
            outer: 0.7
        }
    );
    assert_eq!(*lamp(&editor, "right"), right);
    let lights = &editor.document().json["extensions"]["KHR_lights_punctual"]["lights"];
    assert_eq!(lights.as_array().unwrap().len(), 2);
    // Its own by now.
    apply(
        &mut editor,
        json!({"do": "light", "node": "left", "intensity": 0}),
        here,
    )
    .unwrap();
    let lights = &editor.document().json["extensions"]["KHR_lights_punctual"]["lights"];
    assert_eq!(lights.as_array().unwrap().len(), 2);

    let line = json!({"do": "material", "material": "screen", "emissiveStrength": 30});
    let change = apply(&mut editor, line, here).unwrap();
    assert_eq!(
        (change.objects, change.surfaces, change.lights),
        (vec![], vec![], vec![1, 3])
    );
    assert_eq!(
        editor.scene().materials[1].emission,
        glam::Vec3::new(30.0, 30.0, 15.0)
    );
    // The net lets light pass where its alpha says so.
    let line = json!({"do": "material", "material": "net", "baseColorFactor": [0.5, 1, 1, 1]});
    let change = apply(&mut editor, line, here).unwrap();
    assert_eq!(
        (change.objects, change.surfaces, change.lights),
        (vec![], vec![0, 1], vec![])
    );
    let line = json!({"do": "material", "material": "net", "baseColorFactor": [0.5, 1, 1, 0.9]});
    let change = apply(&mut editor, line, here).unwrap();
    assert_eq!(
        (change.objects, change.surfaces, change.lights),
        (vec![0, 1], vec![], vec![1, 3])
    );
}

#[test]
fn additions_come_last_and_share_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    write_chair(folder.path());
    let mut editor = open("cornell");
    let line = json!({"do": "add", "file": "chair.gltf", "parent": "floor"});
    let change = apply(&mut editor, line, folder.path()).unwrap();
    assert_eq!(change.objects, [8, 9]);
    assert_eq!(change.lights, [21, 23, 26, 28]);
    let nodes = editor.document().json["nodes"].as_array().unwrap();
    assert_eq!(
        (nodes.len(), &nodes[9]["name"], &nodes[0]["children"]),
        (15, &json!("chair"), &json!([9]))
    );
    let floor = editor.scene().objects[0].transform;
    let frame = glam::Affine3A::from_scale_rotation_translation(
        glam::Vec3::splat(0.5),
        glam::Quat::IDENTITY,
        glam::Vec3::new(0.2, 0.1, 0.0),
    );
    assert_eq!(editor.scene().objects[8].transform, floor * frame);

    // Once more: a new name of its own, but nothing else of which there is one.
    let counts = |editor: &Editor| {
        let json = &editor.document().json;
        [
            "meshes",
            "materials",
            "textures",
            "images",
            "accessors",
            "buffers",
        ]
        .map(|kind| json[kind].as_array().map_or(0, Vec::len))
    };
    let before = counts(&editor);
    apply(
        &mut editor,
        json!({"do": "add", "file": "chair.gltf"}),
        folder.path(),
    )
    .unwrap();
    assert_eq!(counts(&editor), before);
    assert_eq!(editor.document().json["nodes"][15]["name"], "chair 2");
    let scene = editor.scene();
    assert_eq!(scene.objects[8].mesh, scene.objects[10].mesh);

    apply(
        &mut editor,
        json!({"do": "copy", "node": "chair", "name": "stool"}),
        folder.path(),
    )
    .unwrap();
    let scene = editor.scene().clone();
    assert_eq!(scene.objects.len(), 14);
    assert_eq!(scene.objects[12].transform, scene.objects[8].transform);
    let change = apply(
        &mut editor,
        json!({"do": "remove", "node": "chair"}),
        folder.path(),
    )
    .unwrap();
    assert_eq!(change.objects, [8, 9]);
    assert!(editor.scene().is_gone(8) && !editor.scene().is_gone(12));
    // The name is free, and the node out of reach.
    apply(
        &mut editor,
        json!({"do": "copy", "node": "stool", "name": "chair"}),
        folder.path(),
    )
    .unwrap();
    let message = apply(&mut editor, json!({"do": "copy", "node": 9}), folder.path());
    let message = message.unwrap_err().to_string();
    assert!(
        message.contains("node 9") && message.contains("does not show it"),
        "{message}"
    );
    for _ in 0..5 {
        editor.undo().unwrap();
    }
    assert_eq!(editor.document().json, builtin("cornell").unwrap().json);
    // What was read for it is still at hand.
    editor.redo().unwrap();
    let mesh = |scene: &Scene| scene.meshes[scene.objects[8].mesh as usize].clone();
    assert!(Arc::ptr_eq(&mesh(editor.scene()), &mesh(&scene)));
}

#[test]
fn without_scenes_what_is_removed_does_not_become_a_root() {
    let mut file = chair();
    file.as_object_mut()
        .unwrap()
        .retain(|key, _| !key.starts_with("scene"));
    let mut editor = editor(&file);
    apply(
        &mut editor,
        json!({"do": "remove", "node": "seat"}),
        Path::new("."),
    )
    .unwrap();
    assert!(editor.scene().is_gone(0) && !editor.scene().is_gone(1));
    check(&editor).unwrap();
    editor.undo().unwrap();
    assert_eq!(editor.document().json.get("scenes"), None);
}

#[test]
fn an_object_scaled_to_nothing_in_the_file_has_its_index_too() {
    let mut file = chair();
    file["nodes"][0]["scale"] = json!([0, 0, 0]);
    let mut editor = editor(&file);
    assert!(editor.scene().is_gone(0));
    let line = json!({"do": "transform", "node": "seat", "scale": [1, 1, 1]});
    let change = apply(&mut editor, line, Path::new(".")).unwrap();
    assert_eq!((change.objects, change.lights), (vec![0], vec![1]));
    check(&editor).unwrap();
}

#[test]
fn the_last_light_may_go_and_the_last_object_may_not() {
    let mut editor = open("cornell");
    let here = Path::new(".");
    apply(&mut editor, json!({"do": "remove", "node": "lamp"}), here).unwrap();
    assert!(editor.scene().lights.is_empty());
    for name in [
        "floor",
        "ceiling",
        "back.wall",
        "left.wall",
        "right.wall",
        "small.box",
    ] {
        apply(&mut editor, json!({"do": "remove", "node": name}), here).unwrap();
    }
    let message = apply(
        &mut editor,
        json!({"do": "remove", "node": "tall.box"}),
        here,
    );
    let message = message.unwrap_err().to_string();
    assert!(message.contains("no object would be left"), "{message}");
    check(&editor).unwrap();
}

/// The scripts in assets/replay, which benches and the documentation use.
#[test]
fn every_script_of_the_assets_makes_sense() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/replay");
    let mut scripts = 0;
    for entry in std::fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        if path.extension().is_none_or(|e| e != "jsonl") {
            continue;
        }
        scripts += 1;
        let (scene, kind) = name.rsplit_once('-').unwrap();
        let mut editor = open(scene);
        let mut all = Change::default();
        for line in std::fs::read_to_string(&path).unwrap().lines() {
            let change = apply(&mut editor, serde_json::from_str(line).unwrap(), &folder);
            let change = change.unwrap_or_else(|error| panic!("{name}: {error}"));
            all.objects.extend(change.objects);
            all.lights.extend(change.lights);
        }
        match kind {
            "move" | "wall" => assert!(!all.objects.is_empty(), "{name}"),
            "lamp" | "dim" => assert!(!all.lights.is_empty(), "{name}"),
            _ => panic!("{name} is no scenario"),
        }
    }
    assert_eq!(scripts, 16);
}

//! Edits: whatever a script does, the scene is its document's, is written as it is, and goes back where it came from.

mod edit_common;

use std::{path::Path, sync::Arc};

use edit_common::{Step, chair, edit, steps, write_chair};
use proptest::prelude::*;
use rebake::scene::{
    Aperture, Document, Light, Scene, TextureRef,
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

/// Without what is gone, and with indices as a loader gives them.
fn dense(scene: &Scene) -> Scene {
    let mut dense = scene.clone();
    dense.meshes.retain(|mesh| mesh.source != u32::MAX);
    let live = |o: &u32| !scene.is_gone(*o);
    let kept: Vec<u32> = (0..scene.objects.len() as u32).filter(live).collect();
    dense.objects = kept
        .iter()
        .map(|o| scene.objects[*o as usize].clone())
        .collect();
    for light in &mut dense.lights {
        if let Aperture::Surface { object } = &mut light.aperture {
            *object = kept.binary_search(object).unwrap() as u32;
        }
    }
    dense
}

/// Everything that light sees of an object, and of its emission, told from the document's point of view.
fn look(scene: &Scene, object: u32) -> Option<(Vec<[glam::Vec3; 3]>, String, String, String)> {
    if object as usize >= scene.objects.len() || scene.is_gone(object) {
        return None;
    }
    let texture = |t: &Option<TextureRef>| {
        let t = t.as_ref()?;
        let texels = &scene.textures[t.texture as usize].texels;
        Some((texels, t.texcoord, t.transform, t.wrap))
    };
    let (mut passes, mut reflects, mut emits) = (String::new(), String::new(), String::new());
    for primitive in &scene.mesh(object).primitives {
        let m = &scene.materials[primitive.material as usize];
        let base = texture(&m.base_color_texture);
        if m.alpha == rebake::scene::AlphaMode::Opaque {
            passes += "never ";
        } else {
            passes += &format!("{:?} {:?} {base:?} ", m.alpha, m.base_color.w);
        }
        reflects += &format!("{:?} {base:?} ", m.base_color.truncate());
        emits += &format!("{:?} {:?}", m.emission, texture(&m.emission_texture));
    }
    let triangles = 0..scene.mesh(object).triangles.len() as u32;
    let triangles = triangles.map(|t| scene.world_triangle(object, t)).collect();
    Some((triangles, passes, reflects, emits))
}

/// `Change::between` the slow way.
fn differences(old: &Scene, new: &Scene) -> Change {
    let mut change = Change::default();
    let mut touched = Vec::new();
    for object in 0..old.objects.len().max(new.objects.len()) as u32 {
        match (look(old, object), look(new, object)) {
            (None, None) => {}
            (Some(a), Some(b)) if a.0 == b.0 && a.1 == b.1 => {
                if a.2 != b.2 {
                    change.surfaces.push(object);
                }
                if a.3 != b.3 {
                    touched.push(object);
                }
            }
            _ => {
                change.objects.push(object);
                touched.push(object);
            }
        }
    }
    change.bounds_changed = old.bounds() != new.bounds();
    let find = |scene: &Scene, id: u32| -> Option<Light> {
        scene.lights.iter().find(|l| l.id() == id).cloned()
    };
    let ids = old.lights.iter().chain(&new.lights).map(Light::id);
    let ids: std::collections::BTreeSet<u32> = ids.collect();
    change.lights = ids
        .into_iter()
        .filter(|id| match (find(old, *id), find(new, *id)) {
            (Some(mut a), Some(b)) => {
                a.name = b.name.clone();
                let around = match b.aperture {
                    Aperture::Surface { object } => touched.contains(&object),
                    Aperture::Directional => change.bounds_changed,
                    _ => false,
                };
                a != b || around
            }
            _ => true,
        })
        .collect();
    change
}

fn check(editor: &Editor) -> Result<(), TestCaseError> {
    let scene = editor.scene();
    let fresh = Scene::from_document(editor.document()).unwrap();
    prop_assert_eq!(&dense(scene), &fresh);
    prop_assert!(scene.objects.is_sorted_by_key(|o| o.node));
    prop_assert!(scene.lights.is_sorted_by_key(Light::id));
    let written = editor.document().to_glb().unwrap();
    let read = Scene::from_document(&Document::parse(&written, None).unwrap()).unwrap();
    prop_assert_eq!(&read, &fresh);
    Ok(())
}

fn run(mut editor: Editor, steps: &[Step]) -> Result<(), TestCaseError> {
    let folder = tempfile::tempdir().unwrap();
    write_chair(folder.path());
    let state = |editor: &Editor| (editor.document().json.to_string(), editor.scene().clone());
    let mut states = vec![state(&editor)];
    for step in steps {
        let old = editor.scene().clone();
        let change = match edit(&editor, step) {
            None if states.len() == 1 => {
                prop_assert!(editor.undo().is_err());
                continue;
            }
            None => {
                states.pop();
                editor.undo().unwrap()
            }
            Some(edit) => match editor.apply(&edit, folder.path()) {
                Ok(change) => {
                    states.push(state(&editor));
                    change
                }
                Err(error) => {
                    let (json, _) = state(&editor);
                    prop_assert_eq!(&json, &states[states.len() - 1].0, "{}", error);
                    prop_assert!(Arc::ptr_eq(&old, editor.scene()));
                    prop_assert!(!error.to_string().contains('\n'), "{}", error);
                    continue;
                }
            },
        };
        prop_assert_eq!(&change, &differences(&old, editor.scene()));
        let boxes = change.boxes(&old, editor.scene());
        prop_assert!(boxes.len() <= 2 * change.objects.len());
        check(&editor)?;
    }
    let last = state(&editor);
    let count = states.len() - 1;
    for (json, scene) in states.iter().rev().skip(1) {
        editor.undo().unwrap();
        prop_assert_eq!(&state(&editor), &(json.clone(), scene.clone()));
    }
    prop_assert!(editor.undo().is_err());
    for _ in 0..count {
        editor.redo().unwrap();
    }
    prop_assert_eq!(&state(&editor), &last);
    Ok(())
}

fn cases(cases: u32) -> ProptestConfig {
    // The message of a failure holds the script; a file beside this one would be found by nobody.
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(cases(24))]
    #[test]
    fn scripts_over_cornell(steps in steps(1..30)) {
        run(open("cornell"), &steps)?;
    }

    #[test]
    fn scripts_over_a_tree_with_matrices_and_shared_lights(steps in steps(1..20)) {
        run(editor(&chair()), &steps)?;
    }
}

proptest! {
    #![proptest_config(cases(2))]
    #[test]
    fn scripts_over_the_museum(steps in steps(3..6)) {
        run(open("museum"), &steps)?;
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

#[test]
fn a_refusal_names_the_node_the_field_and_the_way_out() {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    write_chair(folder.path());
    std::fs::write(inner.join("broken.glb"), b"glTF\x02\0\0\0").unwrap();
    std::fs::write(inner.join("empty.gltf"), r#"{"asset":{"version":"2.0"}}"#).unwrap();
    let mut file = chair();
    file["nodes"][4]["name"] = "left".into();
    file["extensions"]["KHR_lights_punctual"]["lights"][0]["spot"]["innerConeAngle"] = 0.5.into();
    let mut editor = editor(&file);
    let before = (editor.document().json.clone(), editor.scene().clone());
    for (line, parts) in [
        (
            r#"{"do": "remove", "node": "seet"}"#,
            ["node \"seet\"", "did you mean \"seat\""],
        ),
        (
            r#"{"do": "remove", "node": 99}"#,
            ["node 99", "the last one is 4"],
        ),
        (
            r#"{"do": "remove", "node": "left"}"#,
            ["2 nodes are called \"left\"", "3, 4"],
        ),
        (
            r#"{"do": "material", "material": "wood", "emissiveStrength": 1}"#,
            ["material \"wood\"", "did you mean"],
        ),
        (
            r#"{"do": "material", "material": "net"}"#,
            ["material 1 (net)", "give baseColorFactor"],
        ),
        (
            r#"{"do": "material", "material": "net", "baseColorFactor": [1, 2, 0, 1]}"#,
            ["\"baseColorFactor\": 2", "between 0 and 1"],
        ),
        (
            r#"{"do": "material", "material": "net", "emissiveFactor": [-0.5, 0, 0]}"#,
            ["\"emissiveFactor\": -0.5", "emissiveStrength"],
        ),
        (
            r#"{"do": "material", "material": "screen", "emissiveStrength": -1}"#,
            ["\"emissiveStrength\": -1", "0 or more"],
        ),
        (
            r#"{"do": "material", "material": "screen", "emissiveStrength": 1e39}"#,
            ["\"emissiveStrength\"", "give a smaller one"],
        ),
        (
            r#"{"do": "transform", "node": "seat"}"#,
            ["node 0 (seat)", "give translation"],
        ),
        (
            r#"{"do": "transform", "node": "seat", "scale": [1, 0, 1]}"#,
            ["\"scale\"", "use \"remove\""],
        ),
        (
            r#"{"do": "transform", "node": "seat", "scale": [1e-20, 1e-20, 1e-20]}"#,
            ["\"scale\"", "use \"remove\""],
        ),
        (
            r#"{"do": "transform", "node": "frame", "scale": [1e-15, 1e-15, 1e-15]}"#,
            ["node 0 (seat), \"scale\"", "use \"remove\""],
        ),
        (
            r#"{"do": "transform", "node": "seat", "rotation": [0, 0, 0, 0]}"#,
            ["\"rotation\"", "[0, 0, 0, 1]"],
        ),
        (
            r#"{"do": "transform", "node": "seat", "translation": [1e300, 0, 0]}"#,
            ["\"translation\"", "give a smaller one"],
        ),
        (
            r#"{"do": "transform", "node": "seat", "translation": [1e9, 0, 0]}"#,
            ["node 0 (seat)", "the limit is"],
        ),
        (
            r#"{"do": "light", "node": "seat", "intensity": 3}"#,
            ["node 0 (seat)", "use \"material\""],
        ),
        (
            r#"{"do": "light", "node": 3}"#,
            ["node 3 (left)", "give intensity"],
        ),
        (
            r#"{"do": "light", "node": 3, "intensity": -1}"#,
            ["\"intensity\": -1", "0 or more"],
        ),
        (
            r#"{"do": "light", "node": 3, "color": [1, 1, 1.5]}"#,
            ["\"color\": 1.5", "\"intensity\""],
        ),
        (
            r#"{"do": "light", "node": 3, "spot": {"outerConeAngle": 0.4}}"#,
            ["innerConeAngle (0.5) <= outerConeAngle (0.4)", "give both"],
        ),
        (
            r#"{"do": "light", "node": 3, "spot": {"outerConeAngle": 90}}"#,
            ["pi/2", "radians"],
        ),
        (
            r#"{"do": "copy", "node": "seat", "name": "frame"}"#,
            ["\"name\": \"frame\" is the name of node 2", "give another"],
        ),
        (
            r#"{"do": "copy", "node": "seat", "name": ""}"#,
            ["\"name\"", "leave it out"],
        ),
        (
            r#"{"do": "add", "file": "../chair.gltf"}"#,
            ["\"../chair.gltf\"", "outside"],
        ),
        (
            r#"{"do": "add", "file": "/etc/passwd"}"#,
            ["\"/etc/passwd\"", "outside"],
        ),
        (
            r#"{"do": "add", "file": "chair.glb"}"#,
            ["\"chair.glb\"", "cannot be read"],
        ),
        (
            r#"{"do": "add", "file": "broken.glb"}"#,
            ["\"broken.glb\"", "cut off"],
        ),
        (
            r#"{"do": "add", "file": "empty.gltf"}"#,
            ["\"empty.gltf\"", "no triangles"],
        ),
        (
            r#"{"do": "add", "file": "../inner"}"#,
            ["\"../inner\"", "outside"],
        ),
        (
            r#"{"do": "add", "file": "data:,x"}"#,
            ["\"data:,x\"", "outside"],
        ),
        (
            r#"{"do": "undo"}"#,
            ["nothing to undo", "edits of this session"],
        ),
        (
            r#"{"do": "redo"}"#,
            ["nothing to redo", "edits of this session"],
        ),
    ] {
        let command: Value = serde_json::from_str(line).unwrap();
        let message = match apply(&mut editor, command, &inner) {
            Ok(_) => panic!("{line} was accepted"),
            Err(error) => error.to_string(),
        };
        assert!(
            parts.iter().all(|p| message.contains(p)) && !message.contains('\n'),
            "{line}: {message}"
        );
        assert_eq!(editor.document().json, before.0, "{line}");
        assert!(Arc::ptr_eq(editor.scene(), &before.1), "{line}");
    }
}

#[test]
fn copies_of_copies_meet_a_limit() {
    // A chain of nodes: copying each level, the lowest first, doubles what is below.
    let mut file = chair();
    let depth = 40;
    let first = 5;
    for i in 0..depth {
        let child = if i + 1 < depth { first + i + 1 } else { 0 };
        let node = json!({ "name": format!("level {i}"), "children": [child] });
        file["nodes"].as_array_mut().unwrap().push(node);
    }
    file["nodes"][2]["children"] = json!([1]);
    file["scenes"][0]["nodes"] = json!([2, first]);
    let mut editor = editor(&file);
    let refusal = (1..depth).rev().find_map(|i| {
        let line = json!({"do": "copy", "node": format!("level {i}"), "name": format!("copy {i}")});
        apply(&mut editor, line, Path::new(".")).err()
    });
    let message = refusal.unwrap().to_string();
    assert!(
        message.contains("nodes") && message.contains("copy or add less"),
        "{message}"
    );
}

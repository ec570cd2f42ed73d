//! What is refused, in words that help, and without a trace.

use std::{path::Path, sync::Arc};

use serde_json::{Value, json};

use crate::fixtures::{chair, write_chair};
use crate::{apply, editor};

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

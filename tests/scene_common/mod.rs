//! A tiny glTF made in memory, for the tests of the loader to change.

use rebake::scene::{Document, Scene, SceneError};
use serde_json::{Value, json};

/// glTF around three vertices (0,0,0), (1,0,0), (0,1,0), float positions at byte 0, and whatever bytes follow them at 36.
pub fn triangle(more: &[u8], changes: &[(&str, Value)]) -> Result<Scene, SceneError> {
    Scene::from_document(&document(more, changes)?)
}

pub fn document(more: &[u8], changes: &[(&str, Value)]) -> Result<Document, SceneError> {
    let positions: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let mut bin: Vec<u8> = positions.iter().flat_map(|f| f.to_le_bytes()).collect();
    bin.extend_from_slice(more);
    let uri = bin
        .iter()
        .map(|byte| format!("%{byte:02x}"))
        .collect::<String>();
    let mut json = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }, { "buffer": 0, "byteOffset": 36, "byteLength": more.len() }],
        "buffers": [{ "byteLength": bin.len(), "uri": format!("data:,{uri}") }],
    });
    for (pointer, value) in changes {
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        match json.pointer_mut(parent).unwrap() {
            Value::Array(array) => array.insert(key.parse().unwrap(), value.clone()),
            parent => parent[key] = value.clone(),
        }
    }
    Document::parse(json.to_string().as_bytes(), None)
}

pub fn message<T>(result: Result<T, SceneError>) -> String {
    match result {
        Ok(_) => panic!("should have failed"),
        Err(error) => {
            let message = error.to_string();
            assert!(!message.contains('\n'), "{message}");
            message
        }
    }
}

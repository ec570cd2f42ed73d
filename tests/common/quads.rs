//! Writes small glTF scenes of flat quadrilaterals, by hand.

use std::path::{Path, PathBuf};

use glam::Vec3;
use serde_json::{Value, json};

/// A quadrilateral that is black to the light it receives.
pub struct Quad {
    /// Its node's name.
    pub name: &'static str,
    /// Counter-clockwise seen from the front.
    pub corners: [[f32; 3]; 4],
    /// Emitted radiance, cd/m², linear RGB.
    pub emission: [f32; 3],
}

/// Writes `quads` and the punctual lights (elements of `KHR_lights_punctual`, each with its node) as `scene.gltf` and
/// `scene.bin`.
pub fn write(folder: &Path, quads: &[Quad], lights: &[(Value, Value)]) -> PathBuf {
    let mut bin = Vec::new();
    let (mut views, mut accessors) = (Vec::new(), Vec::new());
    let (mut meshes, mut materials, mut nodes) = (Vec::new(), Vec::new(), Vec::new());
    let mut accessor = |bytes: Vec<u8>, mut accessor: Value| {
        accessor["bufferView"] = views.len().into();
        views.push(json!({ "buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len() }));
        bin.extend(bytes);
        accessors.push(accessor);
        accessors.len() - 1
    };
    let bytes = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect();
    for (index, quad) in quads.iter().enumerate() {
        let [a, b, c, d] = quad.corners.map(Vec3::from);
        let normal = (b - a).cross(c - a).normalize().to_array();
        let (low, high) = (a.min(b).min(c).min(d), a.max(b).max(c).max(d));
        let positions = accessor(
            bytes(quad.corners.as_flattened()),
            json!({ "componentType": 5126, "count": 4, "type": "VEC3", "min": low.to_array(), "max": high.to_array() }),
        );
        let normals = accessor(
            bytes([normal; 4].as_flattened()),
            json!({ "componentType": 5126, "count": 4, "type": "VEC3" }),
        );
        let indices = accessor(
            [0u32, 1, 2, 0, 2, 3]
                .iter()
                .flat_map(|i| i.to_le_bytes())
                .collect(),
            json!({ "componentType": 5125, "count": 6, "type": "SCALAR" }),
        );
        let strength = quad.emission.iter().copied().fold(0.0, f32::max);
        let mut material = json!({
            "pbrMetallicRoughness": { "baseColorFactor": [0.0, 0.0, 0.0, 1.0], "metallicFactor": 0.0 },
        });
        if strength > 0.0 {
            material["emissiveFactor"] = json!(quad.emission.map(|e| e / strength));
            material["extensions"] =
                json!({ "KHR_materials_emissive_strength": { "emissiveStrength": strength } });
        }
        materials.push(material);
        meshes.push(json!({ "primitives": [{
            "attributes": { "POSITION": positions, "NORMAL": normals }, "indices": indices, "material": index,
        }] }));
        nodes.push(json!({ "name": quad.name, "mesh": index }));
    }
    let mut document = json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": ["KHR_materials_emissive_strength", "KHR_lights_punctual"],
        "buffers": [{ "uri": "scene.bin", "byteLength": bin.len() }],
        "bufferViews": views, "accessors": accessors, "meshes": meshes, "materials": materials,
    });
    let mut punctual = Vec::new();
    for (index, (light, node)) in lights.iter().enumerate() {
        let mut node = node.clone();
        node["extensions"] = json!({ "KHR_lights_punctual": { "light": index } });
        punctual.push(light);
        nodes.push(node);
    }
    if !punctual.is_empty() {
        document["extensions"] = json!({ "KHR_lights_punctual": { "lights": punctual } });
    }
    document["scenes"] = json!([{ "nodes": (0..nodes.len()).collect::<Vec<_>>() }]);
    document["scene"] = 0.into();
    document["nodes"] = nodes.into();
    std::fs::write(folder.join("scene.bin"), bin).expect("scene.bin");
    let file = folder.join("scene.gltf");
    std::fs::write(&file, document.to_string()).expect("scene.gltf");
    file
}

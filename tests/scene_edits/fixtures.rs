//! A file to add in tests of edits, and edits made from random numbers.

use std::{fs, path::Path};

use proptest::prelude::*;
use rebake::scene::edit::{Edit, Editor, Name, Spot};
use serde_json::{Value, json};

/// Writes `chair.gltf`: a group with a matrix that holds two nodes with one mesh, the one mirrored, and beside it two nodes
/// that share a spot light. The mesh has an emissive, textured part and a masked one.
pub fn write_chair(folder: &Path) {
    fs::write(folder.join("chair.gltf"), chair().to_string()).unwrap();
}

pub fn chair() -> Value {
    let positions: [f32; 9] = [0.0, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 0.4, 0.1];
    let uvs: [f32; 6] = [0.0, 0.0, 1.0, 0.0, 0.0, 1.0];
    let bytes = positions.iter().chain(&uvs).flat_map(|f| f.to_le_bytes());
    let bin: String = bytes.map(|byte| format!("%{byte:02x}")).collect();
    // 2 x 1 texels: red, and white that is half transparent.
    let mut png = Vec::new();
    let image = image::RgbaImage::from_raw(2, 1, vec![255, 0, 0, 255, 255, 255, 255, 127]).unwrap();
    image
        .write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png)
        .unwrap();
    let png: String = png.iter().map(|byte| format!("%{byte:02x}")).collect();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": { "KHR_lights_punctual": { "lights": [
            { "type": "spot", "name": "bulb", "intensity": 5, "spot": { "outerConeAngle": 0.7 } }
        ] } },
        "scene": 0,
        "scenes": [{ "nodes": [2, 3, 4] }],
        "nodes": [
            { "name": "seat", "mesh": 0 },
            { "mesh": 0, "scale": [-1, 1, 1], "translation": [0, 0.5, 0] },
            { "name": "frame", "children": [1, 0], "matrix": [0.5,0,0,0, 0,0.5,0,0, 0,0,0.5,0, 0.2,0.1,0,1] },
            { "name": "left", "translation": [0, 1, 0], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
            { "name": "right", "rotation": [-half, 0, 0, half], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
        ],
        "meshes": [{ "primitives": [
            { "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "material": 0 },
            { "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "material": 1 },
        ] }],
        "materials": [
            { "name": "screen", "emissiveFactor": [1, 1, 0.5], "emissiveTexture": { "index": 0 } },
            { "name": "net", "alphaMode": "MASK", "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } },
        ],
        "textures": [{ "source": 0 }],
        "images": [{ "uri": format!("data:image/png,{png}") }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" },
            { "bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2" },
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": 36 }, { "buffer": 0, "byteOffset": 36, "byteLength": 24 }
        ],
        "buffers": [{ "byteLength": 60, "uri": format!("data:,{bin}") }],
    })
}

/// What one step of a random script is made of.
#[derive(Clone, Debug)]
pub struct Step {
    kind: u8,
    which: u32,
    given: u8,
    values: [f64; 4],
}

pub fn steps(count: impl Into<prop::collection::SizeRange>) -> impl Strategy<Value = Vec<Step>> {
    let step = (
        0u8..14,
        any::<u32>(),
        0u8..8,
        prop::array::uniform4(0.0..1.0),
    )
        .prop_map(|(kind, which, given, values)| Step {
            kind,
            which,
            given,
            values,
        });
    prop::collection::vec(step, count)
}

/// A step as an edit of what there is; none for undo. Some are refused.
pub fn edit(editor: &Editor, step: &Step) -> Option<Edit> {
    let count = |kind: &str| editor.document().json[kind].as_array().map_or(0, Vec::len) as u32;
    let [x, y, z, w] = step.values;
    let node = Name::Index(step.which % count("nodes"));
    let bit = |i: u8| step.given & 1 << i != 0;
    // The scene's lights, so that most steps find one.
    let lights = &editor.scene().lights;
    let lamp = match lights.len() {
        0 => node.clone(),
        n => Name::Index(lights[step.which as usize % n].node),
    };
    Some(match step.kind {
        0..4 => Edit::Transform {
            node,
            translation: (bit(0) || step.given == 0).then_some([x, y, z]),
            rotation: bit(1).then_some([x - 0.5, y, z, w]),
            scale: bit(2).then_some([0.5 + x, 0.5 + y, if w < 0.1 { -1.0 } else { 1.0 }]),
        },
        4..6 => Edit::Light {
            node: lamp,
            intensity: (bit(0) || step.given == 0).then_some(if w < 0.1 { 0.0 } else { 50.0 * x }),
            color: bit(1).then_some([x, y, z]),
            spot: bit(2).then_some(Spot {
                inner_cone_angle: Some(0.5 * y),
                outer_cone_angle: (w < 0.5).then_some(0.5 + z),
            }),
        },
        6..8 => Edit::Material {
            material: Name::Index(step.which % count("materials")),
            base_color_factor: (bit(0) || step.given == 0).then_some([x, y, z, w]),
            emissive_factor: bit(1).then_some(if w < 0.3 { [0.0; 3] } else { [z, y, x] }),
            emissive_strength: bit(2).then_some(20.0 * w),
        },
        8 => Edit::Add {
            file: "chair.gltf".into(),
            name: None,
            parent: bit(0).then_some(node),
        },
        9..11 => Edit::Copy { node, name: None },
        11..13 => Edit::Remove { node },
        _ => return None,
    })
}

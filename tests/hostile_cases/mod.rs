//! The corrupted inputs: damaged files, nonsense, and single hostile values in a small scene that has all the loader reads.

pub mod lines;
mod values;

use rebake::scene::{Document, builtin::builtin};
use serde_json::{Value, json};

/// One input: files of a folder, the scene first.
pub struct Case {
    /// What is wrong with it.
    pub name: String,
    /// Name and content.
    pub files: Vec<(&'static str, Vec<u8>)>,
    /// Whether any success would be wrong. Flipped bits may well give another valid scene.
    pub must_fail: bool,
}

/// SplitMix64 (Steele, Lea, Flood 2014).
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) % limit as u64) as usize
    }
}

/// A small scene with all that the loader reads: a textured, masked, lit quad with all attributes, instanced, a light and a camera.
pub fn base() -> Value {
    let mut bin = Vec::new();
    let floats =
        |bin: &mut Vec<u8>, values: &[f32]| values.iter().for_each(|v| bin.extend(v.to_le_bytes()));
    floats(
        &mut bin,
        &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, -1.0],
    );
    floats(&mut bin, &[0.0, 1.0, 0.0].repeat(4));
    floats(&mut bin, &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
    [0u16, 1, 2, 2, 1, 3]
        .iter()
        .for_each(|i| bin.extend(i.to_le_bytes()));
    let png = png();
    let (indices, image) = (128, bin.len());
    bin.extend(&png);
    let accessor = |view: u32, component: u32, count: u32, kind: &str| json!({ "bufferView": view, "componentType": component, "count": count, "type": kind });
    let view = |from: usize, to: usize| json!({ "buffer": 0, "byteOffset": from, "byteLength": to - from });
    json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_texture_transform"],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "spot", "intensity": 100.0, "spot": { "outerConeAngle": 0.5 } }] } },
        "scene": 0,
        "scenes": [{ "nodes": [0, 2, 3] }],
        "nodes": [
            { "name": "parent", "scale": [-1.0, 2.0, 1.0], "children": [1] },
            { "name": "quad", "mesh": 0, "rotation": [0.0, 0.6, 0.0, 0.8] },
            { "name": "lamp", "mesh": 0, "translation": [0.0, 1.0, 0.0], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
            { "name": "camera", "camera": 0, "matrix": [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 3.0, 1.0] },
        ],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }],
        "meshes": [{ "name": "quad", "primitives": [{
            "attributes": { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "TEXCOORD_1": 2 }, "indices": 3, "material": 0, "mode": 4,
        }] }],
        "materials": [{
            "name": "cloth",
            "pbrMetallicRoughness": { "baseColorFactor": [0.8, 0.7, 0.6, 1.0], "baseColorTexture": {
                "index": 0, "extensions": { "KHR_texture_transform": { "offset": [0.1, 0.2], "rotation": 0.3, "scale": [2.0, 2.0] } } } },
            "emissiveFactor": [1.0, 0.5, 0.2], "emissiveTexture": { "index": 0 },
            "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 10.0 } },
            "alphaMode": "MASK", "alphaCutoff": 0.3, "doubleSided": true,
        }],
        "textures": [{ "source": 0, "sampler": 0 }],
        "samplers": [{ "wrapS": 33071, "wrapT": 33648 }],
        "images": [{ "name": "weave", "bufferView": 4, "mimeType": "image/png" }],
        "accessors": [accessor(0, 5126, 4, "VEC3"), accessor(1, 5126, 4, "VEC3"), accessor(2, 5126, 4, "VEC2"), accessor(3, 5123, 6, "SCALAR")],
        "bufferViews": [view(0, 48), view(48, 96), view(96, 128), view(indices, image), view(image, bin.len())],
        "buffers": [{ "byteLength": bin.len(), "uri": format!("data:,{}", bin.iter().map(|b| format!("%{b:02x}")).collect::<String>()) }],
    })
}

fn png() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = image::RgbaImage::from_fn(4, 4, |x, y| {
        image::Rgba([60 * x as u8, 60 * y as u8, 128, 255])
    });
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// The same as a GLB.
pub fn glb(json: &Value) -> Vec<u8> {
    Document::parse(json.to_string().as_bytes(), None)
        .unwrap()
        .to_glb()
        .unwrap()
}

/// Flipped bits and cut ends of real files.
fn damaged(cases: &mut Vec<Case>) {
    let small = glb(&base());
    let cornell = builtin("cornell").unwrap().to_glb().unwrap();
    let json_end = |glb: &[u8]| 20 + u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let mut random = Random(1);
    for i in 0..90 {
        let mut bytes = if i % 3 == 0 {
            cornell.clone()
        } else {
            small.clone()
        };
        // One flip in the text seldom leaves valid JSON; in the binary part it always does.
        let (from, to) = match i % 4 {
            0 => (0, 20),
            1 => (20, json_end(&bytes)),
            2 => (json_end(&bytes) + 8, bytes.len()),
            _ => (0, bytes.len()),
        };
        for _ in 0..1 + i / 10 {
            bytes[from + random.below(to - from)] ^= 1 << random.below(8);
        }
        cases.push(Case {
            name: format!("bit flips {i}"),
            files: vec![("scene.glb", bytes)],
            must_fail: false,
        });
    }
    for i in 0..30 {
        let mut bytes = if i % 2 == 0 {
            cornell.clone()
        } else {
            small.clone()
        };
        bytes.truncate(if i < 10 {
            3 * i
        } else {
            random.below(bytes.len())
        });
        cases.push(Case {
            name: format!("cut off {i}"),
            files: vec![("scene.glb", bytes)],
            must_fail: true,
        });
    }
    // Digits replaced by digits: valid JSON that means something else.
    let text = base().to_string().into_bytes();
    let digits: Vec<usize> = (0..text.len())
        .filter(|i| text[*i].is_ascii_digit() && text[i - 1] != b'%')
        .collect();
    for i in 0..20 {
        let mut text = text.clone();
        for _ in 0..=i / 4 {
            text[digits[random.below(digits.len())]] = b'0' + random.below(10) as u8;
        }
        cases.push(Case {
            name: format!("other digits {i}"),
            files: vec![("scene.gltf", text)],
            must_fail: false,
        });
    }
}

/// What no tool would write.
fn nonsense(cases: &mut Vec<Case>) {
    for (name, text) in [
        ("empty", ""),
        ("no JSON", "hello"),
        ("null", "null"),
        ("a list", "[]"),
        ("no asset", "{}"),
        ("glTF 1", r#"{"asset":{"version":"1.0"}}"#),
        ("nothing in it", r#"{"asset":{"version":"2.0"}}"#),
        (
            "lists that are none",
            r#"{"asset":{"version":"2.0"},"scene":0,"scenes":{"nodes":5},"nodes":"x","meshes":7,"buffers":null}"#,
        ),
        (
            "a number beyond numbers",
            r#"{"asset":{"version":"2.0"},"nodes":[{"translation":[1e999,0,0]}]}"#,
        ),
    ] {
        cases.push(Case {
            name: name.into(),
            files: vec![("scene.gltf", text.into())],
            must_fail: true,
        });
    }
    let deep = format!(
        r#"{{"asset":{{"version":"2.0"}},"extras":{}{}}}"#,
        "[".repeat(100_000),
        "]".repeat(100_000)
    );
    cases.push(Case {
        name: "nested JSON".into(),
        files: vec![("scene.gltf", deep.into())],
        must_fail: true,
    });
    cases.push(Case {
        name: "not UTF-8".into(),
        files: vec![("scene.gltf", vec![0xFF; 64])],
        must_fail: true,
    });
    cases.push(Case {
        name: "no file".into(),
        files: vec![],
        must_fail: true,
    });
}

/// All of them, the same at every call.
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    damaged(&mut cases);
    nonsense(&mut cases);
    values::changed(&mut cases);
    cases
}

//! The small scene with one value replaced by something hostile.

use serde_json::{Value, json};

use super::{Case, base, png};

/// A PNG of a few bytes that promises 60,000 x 60,000 texels.
fn bomb() -> Vec<u8> {
    let mut bytes = png();
    bytes[16..24].copy_from_slice(&[0, 0, 0xEA, 0x60, 0, 0, 0xEA, 0x60]);
    bytes
}

/// Adds them all.
pub fn changed(cases: &mut Vec<Case>) {
    let positions = |values: [f32; 12]| {
        let bytes: String = values
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .map(|b| format!("%{b:02x}"))
            .collect();
        vec![
            (
                "/buffers/1",
                json!({ "byteLength": 48, "uri": format!("data:,{bytes}") }),
            ),
            ("/bufferViews/0/buffer", json!(1)),
            ("/bufferViews/0/byteOffset", json!(0)),
        ]
    };
    let with = |x: f32| positions([0.0, 0.0, 0.0, x, 0.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, -1.0]);
    let one = |pointer: &'static str, value: Value| vec![(pointer, value)];
    let image = |uri: &str| one("/images/0", json!({ "uri": uri }));
    let many: Vec<Value> = (0..100_000)
        .map(|_| json!({ "attributes": { "POSITION": 0 }, "indices": 3 }))
        .collect();
    let fails = [
        ("NaN position", with(f32::NAN)),
        ("infinite position", with(f32::INFINITY)),
        ("a position of 1e38", with(1e38)),
        ("cyclic nodes", one("/nodes/1/children", json!([0]))),
        ("own child", one("/nodes/1/children", json!([1]))),
        ("two parents", one("/nodes/2/children", json!([1]))),
        (
            "a child that is not there",
            one("/nodes/0/children", json!([99])),
        ),
        ("a negative child", one("/nodes/0/children", json!([-1]))),
        (
            "a root that is not there",
            one("/scenes/0/nodes", json!([99])),
        ),
        ("a scene that is not there", one("/scene", json!(9))),
        ("a mesh that is not there", one("/nodes/1/mesh", json!(9))),
        ("a mesh that is text", one("/nodes/1/mesh", json!("x"))),
        (
            "an accessor that is not there",
            one("/meshes/0/primitives/0/indices", json!(77)),
        ),
        (
            "a material that is not there",
            one("/meshes/0/primitives/0/material", json!(4294967296u64)),
        ),
        ("mode 7", one("/meshes/0/primitives/0/mode", json!(7))),
        (
            "2^63 vertices",
            one("/accessors/0/count", json!(1u64 << 63)),
        ),
        ("2^31 indices", one("/accessors/3/count", json!(1u64 << 31))),
        (
            "a billion zeros",
            vec![(
                "/accessors/0",
                json!({ "count": 1_000_000_000, "componentType": 5126, "type": "VEC3" }),
            )],
        ),
        ("minus one vertices", one("/accessors/0/count", json!(-1))),
        ("half a vertex", one("/accessors/0/count", json!(0.5))),
        (
            "an offset of 2^64 - 1",
            one("/accessors/0/byteOffset", json!(u64::MAX)),
        ),
        (
            "a view beyond its buffer",
            one("/bufferViews/0/byteLength", json!(1 << 30)),
        ),
        (
            "a view at 2^64 - 1",
            one("/bufferViews/0/byteOffset", json!(u64::MAX)),
        ),
        ("a stride of 1", one("/bufferViews/0/byteStride", json!(1))),
        (
            "a stride of 2^64 - 1",
            one("/bufferViews/0/byteStride", json!(u64::MAX)),
        ),
        (
            "a buffer of 2^62 bytes",
            one("/buffers/0/byteLength", json!(1u64 << 62)),
        ),
        (
            "componentType 9999",
            one("/accessors/0/componentType", json!(9999)),
        ),
        ("positions of two", one("/accessors/0/type", json!("VEC2"))),
        (
            "a matrix of indices",
            one("/accessors/3/type", json!("MAT4")),
        ),
        (
            "fewer normals than vertices",
            one("/accessors/1/count", json!(3)),
        ),
        (
            "indices from the image",
            one("/accessors/3/bufferView", json!(4)),
        ),
        (
            "2^40 sparse elements",
            one("/accessors/0/sparse", json!({ "count": 1u64 << 40 })),
        ),
        (
            "sparse without views",
            one("/accessors/0/sparse", json!({ "count": 1 })),
        ),
        (
            "a primitive 100,000 times over a large accessor",
            vec![
                ("/meshes/0/primitives", many.into()),
                ("/accessors/0/count", json!(1 << 20)),
            ],
        ),
        ("a broken image", one("/images/0/bufferView", json!(0))),
        (
            "a PNG bomb",
            one(
                "/images/0",
                json!({ "uri": format!("data:,{}", bomb().iter().map(|b| format!("%{b:02x}")).collect::<String>()) }),
            ),
        ),
        ("a missing image", image("textures/missing.png")),
        ("an image outside", image("../../../../../../etc/passwd")),
        ("an absolute image", image("/etc/passwd")),
        ("a device", image("/dev/zero")),
        ("a URL", image("https://example.com/a.png")),
        ("a name of 100,000 letters", image(&"a".repeat(100_000))),
        ("a name of newlines", image("a\nb\r\n\u{7}\0c")),
        (
            "a missing buffer",
            one("/buffers/0/uri", json!("missing.bin")),
        ),
        ("a short buffer", one("/buffers/0/uri", json!("short.bin"))),
        ("no buffer", one("/buffers/0", json!({ "byteLength": 8 }))),
        (
            "base64 that is none",
            one(
                "/buffers/0/uri",
                json!("data:application/octet-stream;base64,****"),
            ),
        ),
        ("a folder as buffer", one("/buffers/0/uri", json!("."))),
        (
            "an unknown required extension",
            one(
                "/extensionsRequired",
                json!(["EXT_meshopt_compression", "X\nY"]),
            ),
        ),
        (
            "a light that is not there",
            one("/nodes/2/extensions/KHR_lights_punctual/light", json!(3)),
        ),
        (
            "an unknown light",
            one(
                "/extensions/KHR_lights_punctual/lights/0/type",
                json!("laser"),
            ),
        ),
        (
            "a spot of two pi",
            one(
                "/extensions/KHR_lights_punctual/lights/0/spot/outerConeAngle",
                json!(6.2),
            ),
        ),
        (
            "a camera of no angle",
            one("/cameras/0/perspective/yfov", json!(0)),
        ),
        (
            "a scale beyond numbers",
            vec![
                ("/nodes/0/scale", json!([1e30, 1e30, 1e30])),
                ("/nodes/1/scale", json!([1e30, 1e30, 1e30])),
            ],
        ),
        (
            "a rotation of nothing",
            one("/nodes/1/rotation", json!([0, 0, 0, 0])),
        ),
        (
            "a matrix of text",
            one("/nodes/3/matrix", json!("identity")),
        ),
        (
            "a colour of text",
            one("/materials/0/emissiveFactor", json!(["red", 0, 0])),
        ),
        (
            "TEXCOORD_7",
            one("/materials/0/emissiveTexture/texCoord", json!(7)),
        ),
        (
            "no light at all",
            vec![
                ("/materials/0/emissiveFactor", json!([0, 0, 0])),
                ("/nodes/2/extensions", json!({})),
            ],
        ),
        ("no mesh at all", vec![("/scenes/0/nodes", json!([3]))]),
    ];
    let passes = [
        ("zero-area triangles", positions([0.0; 12])),
        ("a million to one", with(1e-6)),
        (
            "a needle of 1 km",
            positions([
                0.0, 0.0, 0.0, 1000.0, 0.0, 0.0, 500.0, 0.0, -1e-3, 1000.0, 1e-3, -1e-3,
            ]),
        ),
        ("positions near the smallest number", positions([1e-44; 12])),
        (
            "everything scaled to nothing but one",
            vec![("/nodes/0/scale", json!([0, 0, 0]))],
        ),
        ("one index", one("/accessors/3/count", json!(1))),
        (
            "a strength of 1e30",
            one(
                "/materials/0/extensions/KHR_materials_emissive_strength/emissiveStrength",
                json!(1e30),
            ),
        ),
        (
            "a texture transform of 1e30",
            one(
                "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform/scale",
                json!([1e30, 1e30]),
            ),
        ),
        (
            "a name of 100,000 letters for a node",
            one("/nodes/1/name", json!("n\n".repeat(50_000))),
        ),
    ];
    let fails = fails
        .into_iter()
        .map(|(name, changes)| (name, changes, true));
    for (name, changes, must_fail) in fails.chain(
        passes
            .into_iter()
            .map(|(name, changes)| (name, changes, false)),
    ) {
        let mut json = base();
        for (pointer, value) in changes {
            let (parent, key) = pointer.rsplit_once('/').unwrap();
            match json
                .pointer_mut(parent)
                .unwrap_or_else(|| panic!("{pointer}"))
            {
                Value::Array(array) if key.parse::<usize>().unwrap() < array.len() => {
                    array[key.parse::<usize>().unwrap()] = value
                }
                Value::Array(array) => array.push(value),
                parent => parent[key] = value,
            }
        }
        let files = vec![
            ("scene.gltf", json.to_string().into_bytes()),
            ("short.bin", vec![0; 16]),
        ];
        cases.push(Case {
            name: name.into(),
            files,
            must_fail,
        });
    }
}

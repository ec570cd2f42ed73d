//! What the glTF loader promises, feature by feature, each on a tiny file made in memory.

use std::{f32::consts::PI, fs};

use glam::{Affine3A, Vec3, Vec4};
use rebake::scene::{
    Aperture, Document, Scene, SceneError, Wrap, builtin::builtin, overlay_lights,
};
use serde_json::{Value, json};

/// glTF around three vertices (0,0,0), (1,0,0), (0,1,0), float positions at byte 0, and whatever bytes follow them at 36.
fn triangle(more: &[u8], changes: &[(&str, Value)]) -> Result<Scene, SceneError> {
    Scene::from_document(&document(more, changes)?)
}

fn document(more: &[u8], changes: &[(&str, Value)]) -> Result<Document, SceneError> {
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

fn message<T>(result: Result<T, SceneError>) -> String {
    match result {
        Ok(_) => panic!("should have failed"),
        Err(error) => {
            let message = error.to_string();
            assert!(!message.contains('\n'), "{message}");
            message
        }
    }
}

#[test]
fn triangles_without_indices_and_with_indices_of_every_width() {
    let scene = triangle(&[], &[]).unwrap();
    assert_eq!(scene.meshes[0].triangles, [[0, 1, 2]]);
    assert_eq!(
        scene.meshes[0].normals,
        [Vec3::ZERO; 3],
        "no normals in the file"
    );
    assert_eq!(scene.objects[0].name, "node 0");
    for (component, bytes) in [
        (5121, vec![2u8, 0, 1]),
        (
            5123,
            [2u16, 0, 1].iter().flat_map(|i| i.to_le_bytes()).collect(),
        ),
        (
            5125,
            [2u32, 0, 1].iter().flat_map(|i| i.to_le_bytes()).collect(),
        ),
    ] {
        let indices =
            json!({ "bufferView": 1, "componentType": component, "count": 3, "type": "SCALAR" });
        let changes = [
            ("/accessors/1", indices),
            ("/meshes/0/primitives/0/indices", json!(1)),
        ];
        assert_eq!(
            triangle(&bytes, &changes).unwrap().meshes[0].triangles,
            [[2, 0, 1]]
        );
    }
}

#[test]
fn strips_and_fans_keep_the_winding_and_points_are_left_out() {
    let indices = json!({ "bufferView": 1, "componentType": 5121, "count": 5, "type": "SCALAR" });
    let with = |mode: u32| {
        let changes = [
            ("/accessors/1", indices.clone()),
            ("/meshes/0/primitives/0/indices", json!(1)),
            ("/meshes/0/primitives/0/mode", json!(mode)),
        ];
        triangle(&[0, 1, 2, 1, 0], &changes)
    };
    assert_eq!(
        with(5).unwrap().meshes[0].triangles,
        [[0, 1, 2], [1, 1, 2], [2, 1, 0]]
    );
    assert_eq!(
        with(6).unwrap().meshes[0].triangles,
        [[1, 2, 0], [2, 1, 0], [1, 0, 0]]
    );
    assert_eq!(
        with(4).unwrap().meshes[0].triangles,
        [[0, 1, 2]],
        "two indices are left over"
    );
    assert!(with(0).unwrap().objects.is_empty());
    assert!(message(with(9)).contains("mode 9"));
}

#[test]
fn sparse_accessors_replace_elements() {
    let mut more = vec![1u8, 0, 0, 0];
    more.extend([5.0f32, 6.0, 7.0].iter().flat_map(|f| f.to_le_bytes()));
    let sparse = json!({ "count": 1, "indices": { "bufferView": 1, "componentType": 5121 }, "values": { "bufferView": 1, "byteOffset": 4 } });
    let scene = triangle(&more, &[("/accessors/0/sparse", sparse)]).unwrap();
    assert_eq!(
        scene.meshes[0].positions,
        [Vec3::ZERO, Vec3::new(5.0, 6.0, 7.0), Vec3::Y]
    );
}

#[test]
fn interleaved_and_normalized_attributes() {
    // Stride 8: u16 texture coordinates and four bytes in between.
    let mut more = Vec::new();
    for uv in [[0u16, 65535], [65535, 0], [13107, 26214]] {
        more.extend(uv.iter().flat_map(|c| c.to_le_bytes()));
        more.extend([9; 4]);
    }
    let changes = [
        ("/bufferViews/1/byteStride", json!(8)),
        (
            "/accessors/1",
            json!({ "bufferView": 1, "componentType": 5123, "normalized": true, "count": 3, "type": "VEC2" }),
        ),
        ("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(1)),
    ];
    let scene = triangle(&more, &changes).unwrap();
    let uvs: Vec<[f32; 2]> = scene.meshes[0].texcoords[0]
        .iter()
        .map(|uv| uv.to_array())
        .collect();
    assert_eq!(uvs, [[0.0, 1.0], [1.0, 0.0], [0.2, 0.4]]);
}

#[test]
fn nodes_nest_instance_and_mirror() {
    let changes = [
        (
            "/nodes/1",
            json!({ "name": "parent", "translation": [1.0, 0.0, 0.0], "scale": [-2.0, 1.0, 1.0], "children": [0, 2] }),
        ),
        (
            "/nodes/2",
            json!({ "name": "flat", "mesh": 0, "scale": [1.0, 0.0, 1.0] }),
        ),
        ("/scenes/0/nodes", json!([1])),
    ];
    let scene = triangle(&[], &changes).unwrap();
    assert_eq!(
        scene.objects.len(),
        1,
        "what is scaled to nothing is left out"
    );
    assert!(scene.mirrored(0));
    let [a, b, c] = scene.world_triangle(0, 0);
    assert_eq!(
        [a, b, c],
        [Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::new(-1.0, 0.0, 0.0)]
    );
    assert!((b - a).cross(c - a).z > 0.0, "the front still faces +Z");
    let bounds = scene.bounds();
    assert_eq!(
        (bounds.min, bounds.max),
        (Vec3::new(-1.0, 0.0, 0.0), Vec3::new(1.0, 1.0, 0.0))
    );

    let cycle = [
        ("/nodes/0/children", json!([1])),
        ("/nodes/1", json!({ "children": [0] })),
    ];
    assert!(message(triangle(&[], &cycle)).contains("node 0 (node 0): it is reached twice"));
}

#[test]
fn a_deep_hierarchy_needs_no_stack() {
    let nodes: Vec<Value> = (0..100_000)
        .map(|i| {
            if i < 99_999 {
                json!({ "children": [i + 1] })
            } else {
                json!({ "mesh": 0 })
            }
        })
        .collect();
    assert_eq!(
        triangle(&[], &[("/nodes", Value::Array(nodes))])
            .unwrap()
            .objects[0]
            .node,
        99_999
    );
}

/// A 2 x 1 PNG: mid grey of alpha 64, and red of alpha 255.
fn png() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = image::RgbaImage::from_raw(2, 1, vec![128, 128, 128, 64, 255, 0, 0, 255]).unwrap();
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

#[test]
fn materials_textures_and_what_a_surface_looks_like() {
    let png = png();
    let changes = [
        (
            "/images",
            json!([{ "bufferView": 1, "mimeType": "image/png" }]),
        ),
        ("/samplers", json!([{ "wrapS": 33071, "wrapT": 33648 }])),
        ("/textures", json!([{ "source": 0, "sampler": 0 }])),
        (
            "/materials",
            json!([{
                "pbrMetallicRoughness": {
                    "baseColorFactor": [0.5, 1.0, 1.0, 1.0],
                    "baseColorTexture": { "index": 0, "extensions": { "KHR_texture_transform": { "offset": [0.25, 0.0], "texCoord": 1 } } },
                },
                "emissiveFactor": [1.0, 0.5, 0.0],
                "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 8.0 } },
                "alphaMode": "BLEND",
                "doubleSided": true,
            }]),
        ),
        ("/meshes/0/primitives/0/material", json!(0)),
        // Both texture coordinates of all vertices are 0.
        (
            "/accessors/1",
            json!({ "componentType": 5126, "count": 3, "type": "VEC2" }),
        ),
        ("/meshes/0/primitives/0/attributes/TEXCOORD_1", json!(1)),
        (
            "/extensionsRequired",
            json!(["KHR_texture_transform", "KHR_materials_unlit"]),
        ),
    ];
    let scene = triangle(&png, &changes).unwrap();
    let middle = Vec3::splat(1.0 / 3.0);
    let reference = scene.materials[1].base_color_texture.as_ref().unwrap();
    assert_eq!(
        (reference.texcoord, reference.wrap),
        (1, [Wrap::Clamp, Wrap::Mirror])
    );
    // u = 0.25 is the centre of the grey texel: sRGB 128 is 0.2158605 linear.
    assert!(
        (scene.albedo(0, 0, middle) - Vec3::new(0.107_930_24, 0.215_860_5, 0.215_860_5))
            .abs()
            .max_element()
            < 1e-6
    );
    assert_eq!(scene.emission(0, 0, middle), Vec3::new(8.0, 4.0, 0.0));
    assert!(
        scene.alpha_passes(0, 0, middle),
        "64 of 255 is below one half"
    );
    assert!(scene.materials[1].double_sided);
    assert_eq!(scene.materials[0].base_color, Vec4::ONE);
    // Half way between the two texels the filter mixes linear colours.
    let half = scene.textures[0].sample(glam::Vec2::new(0.5, 0.0), [Wrap::Clamp; 2]);
    assert!(
        (half - Vec4::new(0.607_930_2, 0.107_930_24, 0.107_930_24, 0.625_490_2))
            .abs()
            .max_element()
            < 1e-6
    );
}

#[test]
fn wrapping_repeats_clamps_and_mirrors() {
    let scene = triangle(
        &png(),
        &[
            ("/images", json!([{ "bufferView": 1 }])),
            ("/textures", json!([{ "source": 0 }])),
            (
                "/materials",
                json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }]),
            ),
        ],
    )
    .unwrap();
    // Green of the red texel is 0, of the grey one it is not; texel centres lie at 0.25 and 0.75.
    let red = |u: f32, wrap| {
        scene.textures[0]
            .sample(glam::Vec2::new(u, 0.5), [wrap; 2])
            .y
            < 1e-6
    };
    for (u, repeat, clamp, mirror) in [
        (1.25, false, true, true),
        (1.75, true, true, false),
        (-0.25, true, false, false),
        (-1.25, true, false, true),
    ] {
        assert_eq!(
            [
                red(u, Wrap::Repeat),
                red(u, Wrap::Clamp),
                red(u, Wrap::Mirror)
            ],
            [repeat, clamp, mirror],
            "at {u}"
        );
    }
}

#[test]
fn punctual_lights_have_units_colour_and_direction() {
    let light = |kind: &str, more: Value| {
        let mut light = json!({ "type": kind, "color": [1.0, 0.5, 0.25], "intensity": 4.0 });
        for (key, value) in more.as_object().unwrap() {
            light[key] = value.clone();
        }
        light
    };
    let lights = json!([
        light("point", json!({})),
        light(
            "spot",
            json!({ "spot": { "innerConeAngle": 0.1, "outerConeAngle": 0.2 } })
        ),
        light("directional", json!({}))
    ]);
    let node = |i: u32| {
        json!({ "name": format!("light {i}"), "rotation": [-0.5f32.sqrt(), 0.0, 0.0, 0.5f32.sqrt()], "scale": [-3.0, 2.0, 1.0],
        "extensions": { "KHR_lights_punctual": { "light": i } } })
    };
    let changes = [
        (
            "/extensions",
            json!({ "KHR_lights_punctual": { "lights": lights } }),
        ),
        ("/nodes/1", node(0)),
        ("/nodes/2", node(1)),
        ("/nodes/3", node(2)),
        ("/scenes/0/nodes", json!([0, 1, 2, 3])),
    ];
    let scene = triangle(&[], &changes).unwrap();
    assert_eq!(
        scene.lights.iter().map(|l| l.aperture).collect::<Vec<_>>(),
        [
            Aperture::Point,
            Aperture::Spot {
                inner: 0.1,
                outer: 0.2
            },
            Aperture::Directional
        ]
    );
    for light in &scene.lights {
        assert_eq!(light.intensity, Vec3::new(4.0, 2.0, 1.0));
        let forward = light.transform.transform_vector3(Vec3::NEG_Z);
        assert!(forward.distance(Vec3::NEG_Y) < 1e-6, "{forward}");
        assert!(
            (light.transform.matrix3.determinant() - 1.0).abs() < 1e-6,
            "scale and mirroring are gone"
        );
    }
    assert!(scene.validate().is_ok());
}

#[test]
fn a_dark_scene_says_how_to_light_it() {
    let text = message(triangle(&[], &[]).unwrap().validate());
    assert!(
        text.contains("--sun") && text.contains("--point") && text.contains("--lights"),
        "{text}"
    );
    assert!(matches!(
        triangle(
            &[],
            &[("/nodes/0", json!({})), ("/scenes/0/nodes", json!([]))]
        )
        .unwrap()
        .validate(),
        Err(SceneError::Empty)
    ));
}

#[test]
fn added_lights_are_the_same_in_the_scene_and_in_the_written_file() {
    let mut document = document(&[], &[]).unwrap();
    let mut scene = Scene::from_document(&document).unwrap();
    scene
        .add_sun(&mut document, 30.0, 90.0, 1000.0, Vec3::new(1.0, 0.9, 0.3))
        .unwrap();
    scene
        .add_point(&mut document, Vec3::new(1.0, 2.0, 3.0), 55.5, Vec3::ONE)
        .unwrap();
    let toward_sun = scene.lights[0].transform.transform_vector3(Vec3::Z);
    assert!(
        toward_sun.distance(Vec3::new((PI / 6.0).cos(), 0.5, 0.0)) < 1e-6,
        "{toward_sun}"
    );
    let read =
        Scene::from_document(&Document::parse(&document.to_glb().unwrap(), None).unwrap()).unwrap();
    assert_eq!(format!("{:?}", read.lights), format!("{:?}", scene.lights));
    for (lux, elevation) in [(0.0, 10.0), (f32::NAN, 10.0), (-1.0, 10.0), (1.0, 100.0)] {
        assert!(
            scene
                .add_sun(&mut document, elevation, 0.0, lux, Vec3::ONE)
                .is_err()
        );
    }
}

#[test]
fn lights_of_another_file_are_laid_over() {
    let folder = tempfile::tempdir().unwrap();
    let other = folder.path().join("lights.gltf");
    builtin("cornell").unwrap().write(&other).unwrap();
    let mut base = document(&[], &[]).unwrap();
    let mut scene = Scene::from_document(&base).unwrap();
    overlay_lights(&mut scene, &mut base, &other).unwrap();
    assert_eq!(
        scene
            .objects
            .iter()
            .map(|o| o.name.as_str())
            .collect::<Vec<_>>(),
        ["node 0", "lamp"]
    );
    assert_eq!(scene.lights.len(), 1);
    assert_eq!(
        scene.emission(1, 0, Vec3::X),
        Vec3::new(5100.0, 3600.0, 1200.0)
    );
    builtin("integrating-sphere")
        .unwrap()
        .write(&other)
        .unwrap();
    overlay_lights(&mut scene, &mut base, &other).unwrap();
    assert_eq!(
        (scene.objects.len(), scene.lights.len()),
        (2, 2),
        "its only light is a point"
    );
    let read =
        Scene::from_document(&Document::parse(base.to_gltf().as_bytes(), None).unwrap()).unwrap();
    assert_eq!(format!("{:?}", read.lights), format!("{:?}", scene.lights));
}

#[test]
fn what_is_wrong_is_named() {
    let nan: Vec<u8> = [0.0f32, 0.0, f32::NAN]
        .iter()
        .cycle()
        .take(9)
        .flat_map(|f| f.to_le_bytes())
        .collect();
    let accessor = |component: u32, count: u64, kind: &str| json!({ "bufferView": 1, "componentType": component, "count": count, "type": kind });
    let indexed = |accessor: Value| {
        [
            ("/accessors/1", accessor),
            ("/meshes/0/primitives/0/indices", json!(1)),
        ]
    };
    for (what, result, parts) in [
        (
            "NaN",
            triangle(&nan, &[("/accessors/0/bufferView", json!(1))]),
            [
                "mesh 0 (mesh 0), primitive 0, POSITION (accessor 0)",
                "vertex 0",
            ],
        ),
        (
            "index",
            triangle(&[0, 1, 7], &indexed(accessor(5121, 3, "SCALAR"))),
            ["indices (accessor 1)", "index 2 is 7"],
        ),
        (
            "count",
            triangle(&[0; 3], &indexed(accessor(5121, 1 << 20, "SCALAR"))),
            ["accessor 1", "do not fit"],
        ),
        (
            "type",
            triangle(&[0; 12], &indexed(accessor(5126, 3, "SCALAR"))),
            ["accessor 1", "unsigned"],
        ),
        (
            "view",
            triangle(&[], &[("/bufferViews/0/byteLength", json!(37))]),
            ["bufferView 0", "beyond buffer 0"],
        ),
        (
            "scale",
            triangle(&[], &[("/nodes/0/scale", json!([1e38, 1.0, 1.0]))]),
            ["node 0", "1e"],
        ),
        (
            "far",
            triangle(&[], &[("/nodes/0/translation", json!([1e8, 0.0, 0.0]))]),
            ["node 0", "metre"],
        ),
        (
            "matrix",
            triangle(&[], &[("/nodes/0/matrix", json!([1.0]))]),
            ["\"matrix\"", "16"],
        ),
        (
            "extensions",
            triangle(
                &[],
                &[(
                    "/extensionsRequired",
                    json!(["A_b", "KHR_draco_mesh_compression"]),
                )],
            ),
            ["A_b", "KHR_draco_mesh_compression"],
        ),
        (
            "image",
            triangle(
                &[1; 9],
                &[
                    ("/images", json!([{ "bufferView": 1, "name": "wood" }])),
                    ("/textures", json!([{ "source": 0 }])),
                    (
                        "/materials",
                        json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }]),
                    ),
                ],
            ),
            ["image 0 (wood)", "PNG"],
        ),
        (
            "file",
            triangle(&[], &[("/images", json!([{ "uri": "wood.png" }]))]),
            ["image 0 (wood.png)", "embed"],
        ),
    ] {
        let text = message(result);
        assert!(
            parts.iter().all(|part| text.contains(part)),
            "{what}: {text}"
        );
    }
}

#[test]
fn a_document_returns_whole_from_both_kinds_of_file() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("wood.png"), png()).unwrap();
    let changes = [
        (
            "/images",
            json!([{ "uri": "wood.png" }, { "bufferView": 1, "mimeType": "image/png" }]),
        ),
        ("/extras", json!({ "note": 0.1 })),
    ];
    let mut json = document(&png(), &changes[1..]).unwrap();
    json.json["images"] = json!([{ "uri": "wood.png" }]);
    let plain = folder.path().join("plain.gltf");
    fs::write(&plain, {
        let mut text: Value = serde_json::from_str(&json.to_gltf()).unwrap();
        text["images"] = changes[0].1.clone();
        text.to_string()
    })
    .unwrap();
    let loaded = Document::load(&plain).unwrap();
    for name in ["copy.glb", "copy.gltf"] {
        let path = folder.path().join(name);
        loaded.write(&path).unwrap();
        let copy = Document::load(&path).unwrap();
        assert_eq!(copy.json["extras"], json!({ "note": 0.1 }));
        assert_eq!(copy.image_bytes(0), png());
        assert_eq!(copy.image_bytes(1), png());
        assert_eq!(copy.images[0].mime, "image/png");
        let [a, b] =
            [&loaded, &copy].map(|d| format!("{:?}", Scene::from_document(d).unwrap().meshes));
        assert_eq!(a, b);
    }
    assert_eq!(
        fs::read_dir(folder.path()).unwrap().count(),
        4,
        "nothing is left beside the files"
    );
    assert!(message(loaded.write(&folder.path().join("no/where.glb"))).contains("cannot write"));
}

#[test]
fn normals_are_unit_or_zero() {
    let more: Vec<u8> = [0.0f32, 0.0, 1e-30, 0.0, 0.0, f32::NAN, 0.0, 0.0, 0.0]
        .iter()
        .flat_map(|f| f.to_le_bytes())
        .collect();
    let changes = [
        (
            "/accessors/1",
            json!({ "bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3" }),
        ),
        ("/meshes/0/primitives/0/attributes/NORMAL", json!(1)),
    ];
    assert_eq!(
        triangle(&more, &changes).unwrap().meshes[0].normals,
        [Vec3::Z, Vec3::ZERO, Vec3::ZERO]
    );
}

#[test]
fn object_transforms_stay_the_files() {
    let scene = triangle(
        &[],
        &[(
            "/nodes/0/matrix",
            json!([
                0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 3.0, 4.0, 5.0, 1.0
            ]),
        )],
    )
    .unwrap();
    let expected = Affine3A::from_rotation_translation(
        glam::Quat::from_rotation_z(PI / 2.0),
        Vec3::new(3.0, 4.0, 5.0),
    );
    assert!(scene.objects[0].transform.abs_diff_eq(expected, 1e-6));
}

//! What the glTF loader promises about geometry, nodes and errors, each on a tiny file made in memory.

mod scene_common;

use std::f32::consts::PI;

use glam::{Affine3A, Vec3};
use scene_common::{message, triangle};
use serde_json::{Value, json};

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
    let nodes: Vec<Value> = (0..20_000)
        .map(|i| {
            if i < 19_999 {
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
        19_999
    );
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

#[test]
fn vertices_that_no_triangle_uses_do_not_widen_the_bounds() {
    let stray: Vec<u8> = [0u16, 1, 0].iter().flat_map(|i| i.to_le_bytes()).collect();
    let scene = triangle(
        &stray,
        &[
            (
                "/accessors/1",
                json!({ "bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR" }),
            ),
            ("/meshes/0/primitives/0/indices", json!(1)),
        ],
    )
    .unwrap();
    assert_eq!(scene.meshes[0].positions.len(), 3);
    assert_eq!(scene.bounds().max, glam::Vec3::X);
}

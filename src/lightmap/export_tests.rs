//! Tests of what a bake writes: the scene read back, materials per page, and folders that stay whole.

use std::collections::BTreeSet;
use std::sync::Arc;

use serde_json::{Value, json};

use super::*;
use crate::lightmap::{AtlasOptions, lit_document};

/// A document from JSON and one buffer, which is `bytes`.
fn document(mut json: Value, bytes: Vec<u8>) -> Document {
    json["asset"] = json!({ "version": "2.0" });
    json["buffers"] = json!([{ "byteLength": bytes.len() }]);
    Document {
        json,
        buffers: vec![Arc::new(bytes)],
        images: Vec::new(),
    }
}

/// Three shown nodes and one that is not: a strip without indices or material, a mesh of two instances, whose base colour texture
/// reads set 1. Unused bytes lie in the buffer, and an extension nobody knows in a node.
fn sample() -> (Document, Scene) {
    let mut bytes = Vec::new();
    let mut floats = |values: &[f32]| {
        let start = bytes.len();
        bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
        start
    };
    let strip = floats(&[
        0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0., 0., 2., 0., 1., 2., 0.,
    ]);
    let square = floats(&[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.]);
    let uv = floats(&[0., 0., 1., 0., 1., 1., 0., 1.]);
    let junk = floats(&[7.0; 1000]);
    let indices = bytes.len();
    bytes.extend([0u8, 1, 2, 0, 2, 3, 0, 0]);
    let view = |start: usize, length: usize| json!({ "buffer": 0, "byteOffset": start, "byteLength": length });
    let accessor = |view: usize, component: u32, count: usize, kind: &str| json!({ "bufferView": view, "componentType": component, "count": count, "type": kind });
    let json = json!({
        "extensionsUsed": ["VENDOR_thing"],
        "scene": 0,
        "scenes": [{ "nodes": [0, 1, 2] }],
        "nodes": [
            { "mesh": 0, "name": "strip", "extensions": { "VENDOR_thing": { "keep": [1, 2.5] } } },
            { "mesh": 1, "translation": [3, 0, 0], "extras": { "note": "kept" } },
            { "mesh": 1, "scale": [-2, 2, 2] },
            { "mesh": 0, "name": "not shown" },
        ],
        "meshes": [
            { "name": "strip", "primitives": [{ "attributes": { "POSITION": 0 }, "mode": 5 }] },
            { "name": "square", "primitives": [{ "attributes": { "POSITION": 1, "TEXCOORD_1": 2, "_MINE": 2 }, "indices": 3, "material": 0 }] },
        ],
        "materials": [{ "name": "paint", "pbrMetallicRoughness": { "baseColorTexture": { "index": 0, "texCoord": 1 } } }],
        "textures": [{ "source": 0 }],
        "images": [{}],
        "accessors": [accessor(0, 5126, 6, "VEC3"), accessor(1, 5126, 4, "VEC3"), accessor(2, 5126, 4, "VEC2"), accessor(3, 5121, 6, "SCALAR")],
        "bufferViews": [view(strip, 72), view(square, 48), view(uv, 32), view(indices, 6), view(junk, 4000)],
    });
    let mut document = document(json, bytes);
    document.images.push(crate::scene::EncodedImage {
        mime: "image/png".into(),
        data: crate::scene::ImageData::Bytes(Arc::new(
            crate::lightmap::compare::png(&[9, 8, 7], 1, 1).unwrap(),
        )),
    });
    let scene = Scene::from_document(&document).unwrap();
    (document, scene)
}

/// Two squares a page: the instances of one mesh end up on different pages.
fn atlas(scene: &Scene) -> Atlas {
    let options = AtlasOptions {
        density: Some(9.0),
        page_size: Some(24),
        ..AtlasOptions::default()
    };
    let atlas = Atlas::build(scene, &options).unwrap();
    assert!(atlas.pages > 1);
    atlas
}

fn map(atlas: &Atlas) -> Lightmap {
    let texels = (atlas.page_size * atlas.page_size) as usize;
    let page = |k: u32| (0..texels).map(|i| [i as f32, k as f32, 0.5]).collect();
    Lightmap {
        page_size: atlas.page_size,
        pages: (0..atlas.pages).map(page).collect(),
    }
}

fn corners(scene: &Scene, object: usize) -> Vec<[glam::Vec3; 3]> {
    let count = scene.mesh(object as u32).triangles.len() as u32;
    (0..count)
        .map(|t| scene.world_triangle(object as u32, t))
        .collect()
}

#[test]
fn the_scene_read_back_is_the_same_with_its_atlas() {
    let (document, scene) = sample();
    let atlas = atlas(&scene);
    let lit = Document::parse(
        &lit_document(&document, &scene, &atlas).to_glb().unwrap(),
        None,
    )
    .unwrap();
    let mut lit_without_reference = lit.clone();
    // The moved set is beyond what a bake reads; what it says about the base colour is checked below.
    for material in lit_without_reference.json["materials"]
        .as_array_mut()
        .unwrap()
    {
        material
            .as_object_mut()
            .unwrap()
            .remove("pbrMetallicRoughness");
    }
    let again = Scene::from_document(&lit_without_reference).unwrap();
    assert_eq!(again.objects.len(), 3);
    for (i, (a, b)) in scene.objects.iter().zip(&again.objects).enumerate() {
        assert_eq!(
            (&a.name, a.node, a.transform),
            (&b.name, b.node, b.transform)
        );
        assert_eq!(corners(&scene, i), corners(&again, i));
    }
    let placements = atlas.placements(&scene);
    let read = Atlas::from_settings(
        &again,
        atlas.density,
        atlas.page_size,
        atlas.pages,
        &placements,
    )
    .unwrap();
    for (a, b) in atlas.objects.iter().zip(&read.objects) {
        let corners = |o: &crate::lightmap::ObjectAtlas| -> Vec<_> {
            o.layout
                .triangles
                .iter()
                .map(|t| t.map(|v| o.layout.vertices[v as usize].uv))
                .collect()
        };
        assert_eq!(corners(a), corners(b), "coordinates survive bit for bit");
        assert_eq!(a.layout.charts, b.layout.charts);
    }
}

#[test]
fn materials_are_copied_per_page_and_all_else_stays() {
    let (document, scene) = sample();
    let atlas = atlas(&scene);
    let json = lit_document(&document, &scene, &atlas).json;
    let mut seen = BTreeSet::new();
    for (object, place) in scene.objects.iter().zip(&atlas.objects) {
        let mesh = json["nodes"][object.node as usize]["mesh"]
            .as_u64()
            .unwrap() as usize;
        assert!(seen.insert(mesh), "each object has a mesh of its own");
        let primitive = &json["meshes"][mesh]["primitives"][0];
        let material = &json["materials"][primitive["material"].as_u64().unwrap() as usize];
        let lightmap = &material["extensions"]["MOZ_lightmap"];
        assert_eq!(
            (
                lightmap["texCoord"].as_u64(),
                lightmap["intensity"].as_u64()
            ),
            (Some(1), Some(1))
        );
        let texture = &json["textures"][lightmap["index"].as_u64().unwrap() as usize];
        let image = texture["extensions"]["EXT_texture_exr"]["source"]
            .as_u64()
            .unwrap() as usize;
        assert_eq!(
            json["images"][image]["uri"],
            format!("lightmap_{}.exr", place.page).as_str()
        );
        assert!(primitive.get("mode").is_none());
    }
    let square =
        |node: usize| &json["meshes"][json["nodes"][node]["mesh"].as_u64().unwrap() as usize];
    assert!(square(1)["primitives"][0]["attributes"]["_MINE"].is_u64());
    assert!(
        square(1)["primitives"][0]["attributes"]["TEXCOORD_2"].is_u64(),
        "the set that the base colour reads"
    );
    let base = &json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"];
    assert_eq!(base["texCoord"], 2);
    assert_eq!(
        json["nodes"][0]["extensions"],
        document.json["nodes"][0]["extensions"]
    );
    assert_eq!(
        json["nodes"][1]["extras"],
        document.json["nodes"][1]["extras"]
    );
    assert_eq!(
        json["nodes"][2]["scale"],
        document.json["nodes"][2]["scale"]
    );
    assert_eq!(
        json["nodes"][3], document.json["nodes"][3],
        "what is not shown keeps its mesh"
    );
    assert_eq!(json["meshes"][0], document.json["meshes"][0]);
    assert_eq!(
        json["extensionsUsed"],
        json!(["VENDOR_thing", "MOZ_lightmap", "EXT_texture_exr"])
    );
}

#[test]
fn lighting_a_lit_document_again_adds_nothing() {
    let document = crate::scene::builtin::builtin("cornell").unwrap();
    let scene = Scene::from_document(&document).unwrap();
    let options = AtlasOptions {
        density: Some(20.0),
        page_size: Some(64),
        ..AtlasOptions::default()
    };
    let atlas = Atlas::build(&scene, &options).unwrap();
    let once = lit_document(&document, &scene, &atlas);
    let scene = Scene::from_document(&once).unwrap();
    let again =
        Atlas::from_settings(&scene, 20.0, 64, atlas.pages, &atlas.placements(&scene)).unwrap();
    let twice = lit_document(&once, &scene, &again);
    for kind in [
        "images",
        "textures",
        "samplers",
        "materials",
        "meshes",
        "nodes",
        "accessors",
    ] {
        assert_eq!(once.json[kind], twice.json[kind], "{kind}");
    }
    assert_eq!(once.to_glb().unwrap(), twice.to_glb().unwrap());
}

#[test]
fn a_folder_is_replaced_whole_and_an_older_page_goes() {
    let (document, scene) = sample();
    let atlas = atlas(&scene);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a/b");
    let write = |map: &Lightmap, note: &str| {
        let extra = vec![("bake.json".to_owned(), note.as_bytes().to_vec())];
        write_outputs(
            &out,
            &document,
            &scene,
            &atlas,
            map,
            Content::DirectAndIndirect,
            extra,
        )
    };
    let names = || -> BTreeSet<String> {
        fs::read_dir(&out)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect()
    };
    let mut wide = map(&atlas);
    wide.pages.push(wide.pages[0].clone());
    assert_eq!(write(&wide, "first").unwrap().len(), wide.pages.len() + 2);
    assert!(names().contains(&format!("lightmap_{}.exr", atlas.pages)));
    fs::write(out.join("mine.txt"), "kept").unwrap();
    let paths = write(&map(&atlas), "second").unwrap();
    let mut expected: BTreeSet<String> = (0..atlas.pages).map(glb::page_file).collect();
    expected.extend(["scene.glb", "bake.json", "mine.txt"].map(String::from));
    assert_eq!(names(), expected);
    assert!(paths.iter().all(|p| p.exists()));
    assert_eq!(fs::read_to_string(out.join("bake.json")).unwrap(), "second");
    // Twice the same input: the same bytes.
    let bytes = |name: &str| fs::read(out.join(name)).unwrap();
    let before = [bytes("scene.glb"), bytes("lightmap_0.exr")];
    write(&map(&atlas), "third").unwrap();
    assert_eq!([bytes("scene.glb"), bytes("lightmap_0.exr")], before);
}

#[test]
fn a_failure_leaves_what_was_there() {
    let (document, scene) = sample();
    let atlas = atlas(&scene);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let write = |out: &Path, name: &str| {
        let extra = vec![(name.to_owned(), b"new".to_vec())];
        write_outputs(
            out,
            &document,
            &scene,
            &atlas,
            &map(&atlas),
            Content::IndirectOnly,
            extra,
        )
    };
    check_output(&out).unwrap();
    assert!(!out.exists(), "a check leaves nothing behind");
    // A name in a folder that does not exist cannot be written: nothing may remain, not even the folder.
    let error = write(&out, "no/such/file").unwrap_err().to_string();
    assert!(error.contains("no/such/file"), "{error}");
    assert!(!out.exists());
    write(&out, "bake.json").unwrap();
    let all = |out: &Path| -> Vec<(PathBuf, Vec<u8>)> {
        let mut files: Vec<_> = fs::read_dir(out)
            .unwrap()
            .map(|e| e.unwrap().path())
            .map(|p| (p.clone(), fs::read(&p).unwrap_or_default()))
            .collect();
        files.sort();
        files
    };
    let before = all(&out);
    assert!(write(&out, "no/such/file").is_err());
    assert_eq!(all(&out), before);
    let file = folder.path().join("file");
    fs::write(&file, "x").unwrap();
    assert!(matches!(
        write(&file, "bake.json"),
        Err(ExportError::NotAFolder { .. })
    ));
}

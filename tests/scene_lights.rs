//! What the glTF loader promises about materials, lights and files, each on a tiny file made in memory.

mod scene_common;

use std::{f32::consts::PI, fs};

use glam::{Vec3, Vec4};
use rebake::scene::{
    Aperture, Document, Scene, SceneError, Wrap, builtin::builtin, overlay_lights,
};
use scene_common::{document, message, triangle};
use serde_json::{Value, json};

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

    fs::write(&other, "{}").unwrap();
    let before = format!("{scene:?}");
    let text = message(overlay_lights(&mut scene, &mut base, &other));
    assert!(text.contains("lights.gltf: this is no glTF"), "{text}");
    assert_eq!(format!("{scene:?}"), before);
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

//! The built-in scenes: sizes, orientation, and that the files in assets/ are what the code makes.

use std::path::Path;

use glam::Vec3;
use rebake::scene::{Document, Scene, SceneError, builtin::builtin};

fn area(scene: &Scene) -> f64 {
    let mut area = 0.0;
    for object in 0..scene.objects.len() as u32 {
        for triangle in 0..scene.mesh(object).triangles.len() as u32 {
            let [a, b, c] = scene.world_triangle(object, triangle).map(Vec3::as_dvec3);
            area += (b - a).cross(c - a).length() / 2.0;
        }
    }
    area
}

fn load(name: &str) -> Scene {
    let scene = Scene::from_document(&builtin(name).unwrap()).unwrap();
    scene.validate().unwrap();
    assert_eq!(scene.cameras.len(), 1, "{name}");
    scene
}

#[test]
fn cornell_is_the_classic_box() {
    let scene = load("cornell");
    let names: Vec<&str> = scene
        .objects
        .iter()
        .map(|object| object.name.as_str())
        .collect();
    assert_eq!(
        names,
        [
            "floor",
            "ceiling",
            "back.wall",
            "left.wall",
            "right.wall",
            "small.box",
            "tall.box",
            "lamp"
        ]
    );
    assert_eq!(
        (
            scene.lights.len(),
            scene
                .meshes
                .iter()
                .map(|m| m.triangles.len())
                .sum::<usize>()
        ),
        (1, 32)
    );
    let bounds = scene.bounds();
    assert_eq!(
        (bounds.min, bounds.max),
        (Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0))
    );
    // Walls face the middle, boxes away from their own, the lamp down.
    for (object, name) in names.iter().enumerate() {
        let object = object as u32;
        let mesh = scene.mesh(object);
        let center = mesh.positions.iter().sum::<Vec3>() / mesh.positions.len() as f32;
        let center = scene.objects[object as usize]
            .transform
            .transform_point3(center);
        for triangle in 0..mesh.triangles.len() as u32 {
            let [a, b, c] = scene.world_triangle(object, triangle);
            let normal = (b - a).cross(c - a).normalize();
            let vertex = mesh.normals[mesh.triangles[triangle as usize][0] as usize];
            assert!(
                scene.objects[object as usize]
                    .transform
                    .transform_vector3(vertex)
                    .dot(normal)
                    > 0.999,
                "{name}"
            );
            let outward = (a - center).dot(normal);
            match *name {
                "lamp" => assert!(normal.dot(Vec3::NEG_Y) > 0.999),
                "small.box" | "tall.box" => assert!(outward > 0.0, "{name}"),
                _ => assert!((Vec3::Y - a).dot(normal) > 0.9, "{name}"),
            }
        }
    }
    assert_eq!(scene.albedo(3, 0, Vec3::X), Vec3::new(0.63, 0.065, 0.05));
    assert_eq!(
        scene.emission(7, 1, Vec3::X),
        Vec3::new(5100.0, 3600.0, 1200.0)
    );
}

#[test]
fn the_sphere_is_nearly_round_and_faces_its_lamp() {
    let scene = load("integrating-sphere-0.8");
    assert_eq!(scene.meshes[0].triangles.len(), 20_480);
    let ratio = area(&scene) / (4.0 * std::f64::consts::PI);
    assert!((0.999..1.0).contains(&ratio), "{ratio}");
    assert!((area(&scene) - 12.5626).abs() < 5e-5, "{}", area(&scene));
    for triangle in 0..20_480 {
        let [a, b, c] = scene.world_triangle(0, triangle);
        assert!((b - a).cross(c - a).dot(a) < 0.0);
    }
    assert_eq!(scene.albedo(0, 0, Vec3::X), Vec3::splat(0.8));
}

#[test]
fn every_wall_of_the_furnace_glows_inward() {
    let scene = load("furnace");
    assert!((area(&scene) - 24.0).abs() < 1e-6);
    for triangle in 0..12 {
        let [a, b, c] = scene.world_triangle(0, triangle);
        assert!((b - a).cross(c - a).dot(Vec3::Y - a) > 0.0);
        assert_eq!(scene.emission(0, triangle, Vec3::X), Vec3::ONE);
    }
}

/// Within half a percent of the triangles of table 1 in "Incrementally Baked Global Illumination", and with just its lights.
#[test]
fn the_large_scenes_have_the_sizes_of_their_models() {
    for (name, triangles, lights) in [
        ("museum", 1_012_755.0, 164),
        ("town-square", 174_720.0, 35),
        ("warehouse", 349_079.0, 24),
    ] {
        let scene = load(name);
        let count: usize = (0..scene.objects.len() as u32)
            .map(|o| scene.mesh(o).triangles.len())
            .sum();
        assert!(
            (count as f64 / triangles - 1.0).abs() < 0.005,
            "{name}: {count}"
        );
        assert_eq!(scene.lights.len(), lights, "{name}");
        assert!(
            !scene.textures.is_empty() && scene.meshes.len() < scene.objects.len(),
            "{name}"
        );
        for mesh in &scene.meshes {
            assert!(mesh.texcoords[1].is_empty(), "{name}");
            // Each vertex normal lies on the front side of its triangles, and no triangle is degenerate.
            let mut flat = 0;
            for t in &mesh.triangles {
                let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
                let normal = (b - a).cross(c - a);
                flat += usize::from(normal.length() < 1e-9);
                let vertex = t.iter().map(|v| mesh.normals[*v as usize]).sum::<Vec3>();
                assert!(
                    normal.dot(vertex) >= 0.0 || normal.length() < 1e-6,
                    "{name}, {}",
                    mesh.name
                );
            }
            assert_eq!(flat, 0, "{name}, {}", mesh.name);
        }
    }
}

#[test]
fn a_scene_is_made_of_the_same_bytes_every_time() {
    let bytes = || builtin("town-square").unwrap().to_glb().unwrap();
    assert!(bytes() == bytes());
}

#[test]
fn unknown_names_are_answered_with_the_known_ones() {
    for name in [
        "cornel",
        "furnace-1",
        "furnace-x",
        "integrating-sphere-",
        "furnace-NaN",
    ] {
        let Err(SceneError::UnknownBuiltin { .. }) = builtin(name) else {
            panic!("{name}")
        };
    }
    assert!(
        builtin("x")
            .unwrap_err()
            .to_string()
            .contains("integrating-sphere")
    );
}

#[test]
fn the_files_in_assets_are_what_the_code_makes() {
    for (name, file) in [
        ("cornell", "cornell.gltf"),
        ("integrating-sphere", "integrating-sphere.glb"),
        ("furnace", "furnace.gltf"),
    ] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("assets")
            .join(file);
        let made = tempfile::tempdir().unwrap();
        let fresh = made.path().join(file);
        builtin(name).unwrap().write(&fresh).unwrap();
        let same = std::fs::read(&path).ok() == std::fs::read(&fresh).ok();
        assert!(
            same,
            "assets/{file} differs; write it again with `rebake scene {name} -o assets/{file}`"
        );
        assert!(Document::load(&path).is_ok());
    }
}

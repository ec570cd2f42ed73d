//! Tests of the atlas: rectangles apart, budget met, and the same atlas read back.

use glam::{Affine3A, Quat, Vec2, Vec3};

use super::super::coverage::fetched;
use super::*;
use crate::scene::{Mesh, Object};

/// A square of 1 m in x and y.
fn square() -> Mesh {
    Mesh {
        name: "square".into(),
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y],
        normals: vec![Vec3::Z; 4],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

fn scene(transforms: &[Affine3A]) -> Scene {
    let object = |(i, &transform): (usize, &Affine3A)| Object {
        name: format!("square {i}"),
        node: 10 + i as u32,
        mesh: 0,
        transform,
    };
    Scene {
        meshes: vec![Arc::new(square())],
        objects: transforms.iter().enumerate().map(object).collect(),
        ..Scene::default()
    }
}

#[test]
fn a_budget_sets_the_density_and_the_cap_bounds_it() {
    let scene = scene(&[Affine3A::from_scale(Vec3::splat(10.0))]);
    let options = AtlasOptions {
        texels: 40_000,
        ..AtlasOptions::default()
    };
    let atlas = Atlas::build(&scene, &options).unwrap();
    // 204 x 204 texels would be lit at 20 texels/m, those around the border included.
    assert!((19.0..19.9).contains(&atlas.density), "{}", atlas.density);
    assert_eq!((atlas.page_size, atlas.pages), (256, 1));
    let lit = fetched(&atlas.objects[0].layout, atlas.objects[0].size);
    let lit = lit.iter().filter(|f| **f).count();
    assert!((39_200..=40_800).contains(&lit), "{lit} texels");
    let capped = Atlas::build(
        &scene,
        &AtlasOptions {
            max_density: 5.0,
            ..options
        },
    )
    .unwrap();
    assert_eq!(capped.density, 5.0);
}

#[test]
fn instances_share_a_layout_per_scale_whatever_their_rotation() {
    let turned = Affine3A::from_scale_rotation_translation(
        Vec3::splat(2.0),
        Quat::from_rotation_x(0.7) * Quat::from_rotation_z(1.1),
        Vec3::ONE,
    );
    let stretched = Affine3A::from_scale(Vec3::new(-2.0, 4.0, 2.0));
    let scene = scene(&[Affine3A::from_scale(Vec3::splat(2.0)), turned, stretched]);
    let options = AtlasOptions {
        density: Some(8.0),
        ..AtlasOptions::default()
    };
    let [a, b, c] = &Atlas::build(&scene, &options).unwrap().objects[..] else {
        panic!()
    };
    assert!(Arc::ptr_eq(&a.layout, &b.layout));
    assert_eq!(a.size, UVec2::splat(20));
    assert_eq!(c.size.min_element(), 20, "2 m at 8 texels/m, and padding");
    assert_eq!(c.size.max_element(), 36, "4 m");
}

#[test]
fn what_does_not_fit_is_named() {
    let scene = scene(&[
        Affine3A::IDENTITY,
        Affine3A::from_scale(Vec3::new(9.0, 1.0, 1.0)),
    ]);
    let options = AtlasOptions {
        density: Some(30.0),
        page_size: Some(64),
        ..AtlasOptions::default()
    };
    let error = Atlas::build(&scene, &options).unwrap_err().to_string();
    assert!(
        error.contains("square 1") && error.contains("--density") && error.contains("--page-size"),
        "{error}"
    );
    let absurd = AtlasOptions {
        density: Some(1e30),
        page_size: None,
        ..options
    };
    assert!(matches!(
        Atlas::build(&scene, &absurd),
        Err(LightmapError::TooLarge { .. })
    ));
    for (density, page_size) in [(Some(0.0), None), (Some(f32::NAN), None), (None, Some(4))] {
        let options = AtlasOptions {
            density,
            page_size,
            ..AtlasOptions::default()
        };
        assert!(matches!(
            Atlas::build(&scene, &options),
            Err(LightmapError::Option { .. })
        ));
    }
    assert!(matches!(
        Atlas::build(&Scene::default(), &AtlasOptions::default()),
        Err(LightmapError::NoSurface)
    ));
}

#[test]
fn broken_transforms_are_errors_and_flat_ones_are_not() {
    let broken = scene(&[Affine3A::from_scale(Vec3::new(1.0, f32::NAN, 1.0))]);
    assert!(matches!(
        Atlas::build(&broken, &AtlasOptions::default()),
        Err(LightmapError::NotFinite { .. })
    ));
    for flat in [Vec3::ZERO, Vec3::new(0.0, 1.0, 1.0)] {
        let atlas = Atlas::build(
            &scene(&[Affine3A::from_scale(flat)]),
            &AtlasOptions::default(),
        )
        .unwrap();
        assert_eq!(atlas.objects[0].layout.triangles.len(), 2);
        assert!(atlas.objects[0].size.min_element() >= 5);
    }
}

#[test]
fn an_atlas_survives_its_way_through_a_file() {
    let transforms: Vec<_> = (1..6)
        .map(|i| Affine3A::from_scale(Vec3::splat(0.37 * i as f32)))
        .collect();
    let mut scene = scene(&transforms);
    let options = AtlasOptions {
        density: Some(17.3),
        page_size: Some(48),
        ..AtlasOptions::default()
    };
    let atlas = Atlas::build(&scene, &options).unwrap();
    assert!(atlas.pages > 1);
    let placements = atlas.placements(&scene);
    // What the export writes: one mesh an object, with page coordinates.
    scene.meshes.clear();
    for (i, place) in atlas.objects.iter().enumerate() {
        let coordinates = place
            .layout
            .vertices
            .iter()
            .map(|v| (v.uv + place.origin.as_vec2()) / 48.0);
        let of = square();
        scene.objects[i].mesh = i as u32;
        scene.meshes.push(Arc::new(Mesh {
            positions: place
                .layout
                .vertices
                .iter()
                .map(|v| of.positions[v.source as usize])
                .collect(),
            texcoords: [Vec::new(), coordinates.collect::<Vec<Vec2>>()],
            triangles: place.layout.triangles.clone(),
            ..of
        }));
    }
    let again = Atlas::from_settings(&scene, atlas.density, 48, atlas.pages, &placements).unwrap();
    for (a, b) in atlas.objects.iter().zip(&again.objects) {
        assert_eq!(
            (a.page, a.origin, a.size, a.source),
            (b.page, b.origin, b.size, b.source)
        );
        let corners = |o: &ObjectAtlas| -> Vec<[Vec2; 3]> {
            o.layout
                .triangles
                .iter()
                .map(|t| t.map(|v| o.layout.vertices[v as usize].uv))
                .collect()
        };
        assert_eq!(corners(a), corners(b), "bit for bit");
        assert_eq!(a.layout.charts, b.layout.charts);
    }
    let error = Atlas::from_settings(&scene, 1.0, 48, atlas.pages, &placements[1..]).unwrap_err();
    assert!(error.to_string().contains("node 10"), "{error}");
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(32))]
    #[test]
    fn rectangles_never_overlap(sides in proptest::collection::vec((0.1f32..6.0, 0.1f32..6.0), 1..40)) {
        let transforms: Vec<_> =
            sides.iter().map(|&(x, y)| Affine3A::from_scale(Vec3::new(x, y, 1.0))).collect();
        let options = AtlasOptions { density: Some(9.0), page_size: Some(96), ..AtlasOptions::default() };
        let atlas = Atlas::build(&scene(&transforms), &options).unwrap();
        for (i, a) in atlas.objects.iter().enumerate() {
            proptest::prop_assert!((a.origin + a.size).max_element() <= atlas.page_size);
            for b in &atlas.objects[..i] {
                let apart = (a.origin + a.size).cmple(b.origin) | (b.origin + b.size).cmple(a.origin);
                proptest::prop_assert!(a.page != b.page || apart.any());
            }
        }
    }
}

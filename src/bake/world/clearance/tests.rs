//! Clearances in rooms where they are known, and after edits against those of a fresh start.

use glam::{Affine3A, Quat};
use proptest::prelude::*;

use super::super::changes::{Changed, Changes, Place};
use super::*;
use crate::transport::testing::{add_quads, box_quads, material, quad};

/// A floor of 2 m x 2 m in y = 0, a box of 40 cm on it, and a post that stays, each an object, with texels 10 cm apart.
fn scene() -> (Scene, Texels) {
    let mut scene = Scene::default();
    let white = material(Vec3::splat(0.5), Vec3::ZERO, false);
    let floor = quad(Vec3::new(-1.0, 0.0, 1.0), Vec3::X * 2.0, Vec3::NEG_Z * 2.0);
    add_quads(&mut scene, &[floor], white.clone());
    let corner = Vec3::new(-0.2, 0.0, -0.2);
    add_quads(
        &mut scene,
        &box_quads(corner, corner + 0.4, false),
        white.clone(),
    );
    let (low, high) = (Vec3::new(0.4, 0.0, -0.8), Vec3::new(0.6, 0.5, 0.1));
    add_quads(&mut scene, &box_quads(low, high, false), white);
    let mut texels = Texels::default();
    for object in 0..3 {
        let first = (texels.list.len() / Texel::TILE) as u32;
        let mesh = scene.mesh(object).clone();
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|v| mesh.positions[v as usize]);
            let face = (b - a).cross(c - a).normalize().to_array();
            let steps = ((b - a).length().max((c - a).length()) * 10.0).ceil();
            for i in 0..steps as u32 {
                for j in 0..steps as u32 - i {
                    let [s, t] = [i, j].map(|i| (i as f32 + 0.3) / steps);
                    texels.list.push(Texel {
                        position: (a + (b - a) * s + (c - a) * t).to_array(),
                        object,
                        normal: face,
                        face,
                        pixel: 0,
                    });
                }
            }
        }
        let full = texels.list.len().next_multiple_of(Texel::TILE);
        let filler = Texel {
            pixel: Texel::NONE,
            ..texels.list[texels.list.len() - 1]
        };
        texels.list.resize(full, filler);
        texels.tiles.push(first..(full / Texel::TILE) as u32);
    }
    (scene, texels)
}

/// Of one point of the floor.
fn at(scene: &Scene, x: f32, z: f32, reach: f32) -> Clearance {
    let clearances = Clearances {
        reach,
        boxes: Vec::new(),
    };
    let texel = Texel {
        position: [x, 0.0, z],
        object: 0,
        normal: [0.0, 1.0, 0.0],
        face: [0.0, 1.0, 0.0],
        pixel: 0,
    };
    clearances.around(scene, &SceneBvh::build(scene), &texel)
}

#[test]
fn lookups_keep_away_from_walls_on_either_side_of_them() {
    let (scene, _) = scene();
    let reach = 0.1;
    assert_eq!(at(&scene, 0.5, 0.5, reach), Clearance::OPEN);
    for (x, way) in [(0.23, 1.0), (0.17, -1.0)] {
        let beside = at(&scene, x, 0.0, reach);
        let push = Vec3::from_array(beside.push);
        assert!((beside.near - 0.03).abs() < 1e-5, "{beside:?}");
        assert!((push - Vec3::X * way).length() < 1e-5, "{beside:?}");
        assert!((beside.way - 0.07).abs() < 1e-5, "{beside:?}");
        assert_eq!(beside.room, Clearance::OPEN.room);
    }
    // In the corner inside the box, as far along both axes.
    let corner = at(&scene, 0.18, 0.19, reach);
    let push = Vec3::from_array(corner.push);
    assert!((push * corner.way - Vec3::new(-0.08, 0.0, -0.09)).length() < 1e-5);
    assert!((corner.way - 0.09).abs() < 1e-5, "{corner:?}");
}

#[test]
fn what_covers_a_texel_leaves_it_little_room() {
    let (mut scene, _) = scene();
    scene.objects[1].transform = Affine3A::from_translation(Vec3::Y * 0.005);
    let under = at(&scene, 0.0, 0.0, 0.1);
    assert!((under.room - 0.005).abs() < 1e-4, "{under:?}");
    assert_eq!(under.push, [0.0; 3]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]
    #[test]
    fn after_any_moves_clearances_are_those_of_a_fresh_start(
        moves in proptest::collection::vec((-0.9f32..0.9, 0.0f32..0.3, 0.0f32..6.0, 0.5f32..1.5), 1..5),
    ) {
        let (mut scene, mut texels) = scene();
        let mut bvh = SceneBvh::build(&scene);
        let mut clearances = Clearances::new(&scene, &bvh, &mut texels, 10.0);
        let first = texels.clearances.clone();
        let (mut changes, mut version) = (Changes::default(), 0);
        for (x, y, turn, size) in moves {
            let before = texels.clearances.clone();
            let mut place = Place { object: 1, before: Some(scene.object_bounds(1)), after: None };
            scene.objects[1].transform = Affine3A::from_scale_rotation_translation(
                Vec3::splat(size),
                Quat::from_rotation_y(turn),
                Vec3::new(x, y, 0.0),
            );
            place.after = Some(scene.object_bounds(1));
            let mut changed = Changed { places: vec![place], near: Vec::new(), reach: clearances.reach() };
            bvh = bvh.moved(&scene, &[1]);
            let boxes = changed.boxes();
            let (replaced, near) = clearances.update(&scene, &bvh, &mut texels, &[1], &boxes);
            changed.near = near;
            version += 1;
            changes.begin(version, changed);
            let mut fresh = texels.clone();
            Clearances::new(&scene, &SceneBvh::build(&scene), &mut fresh, 10.0);
            prop_assert_eq!(&texels.clearances, &fresh.clearances);
            let entries = |tile: u32| tile as usize * Texel::TILE..(tile as usize + 1) * Texel::TILE;
            for tile in texels.tiles[0].clone() {
                let differs = entries(tile).any(|i| before[i] != fresh.clearances[i]);
                prop_assert_eq!(replaced.contains(&tile), differs);
            }
            // Whatever lies in between.
            for since in [0, version - 1] {
                let then = if since == 0 { &first } else { &before };
                let differ = changes.between(since, version);
                for entry in texels.tiles[0].clone().flat_map(entries) {
                    let here = world(&scene, &texels.list[entry]);
                    let held = differ.lookups.iter().any(|r| {
                        let away = (here - Vec3::from(r.center)).abs();
                        away.cmple(Vec3::from(r.extent)).all()
                    });
                    prop_assert!(held || then[entry] == fresh.clearances[entry], "{} since {}", here, since);
                }
            }
        }
    }
}

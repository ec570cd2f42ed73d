//! Rays against the scene, held to a loop over all triangles.

use super::*;
use crate::scene::Mesh;
use crate::transport::sampling::{Sequence, sphere};
use crate::transport::testing::{add_quads, box_quads, cornell, material, quad, room};
use glam::Affine3A;

/// Every triangle of every object, the slow way.
fn brute_force(scene: &Scene, origin: Vec3, direction: Vec3) -> Option<(u32, u32, f32)> {
    let mut best: Option<(u32, u32, f32)> = None;
    for (o, object) in scene.objects.iter().enumerate() {
        let mesh = &scene.meshes[object.mesh as usize];
        for (t, triangle) in mesh.triangles.iter().enumerate() {
            let vertices = triangle.map(|v| {
                object
                    .transform
                    .transform_point3a(mesh.positions[v as usize].into())
            });
            if let Some((d, _)) = intersect(
                &vertices,
                origin.into(),
                direction.into(),
                reciprocal(direction.into()),
            ) && best.is_none_or(|b| d < b.2)
            {
                best = Some((o as u32, t as u32, d));
            }
        }
    }
    best
}

fn rays(count: u32) -> impl Iterator<Item = (Vec3, Vec3)> {
    let sequence = Sequence::new(7, 0);
    (0..count).map(move |i| {
        let [a, b, c, d] = sequence.sample(i, 0);
        (
            Vec3::new(a, b, c) * 1.8 - 0.9,
            sphere([d, sequence.sample(i, 1)[0]]),
        )
    })
}

/// Two copies of a mirrored, scaled crate in one place: every hit on them is a tie.
fn with_ties() -> Scene {
    let mut scene = cornell();
    for _ in 0..2 {
        let crate_ = box_quads(Vec3::splat(-0.2), Vec3::splat(0.2), false);
        let object = add_quads(&mut scene, &crate_, material(Vec3::ONE, Vec3::ZERO, false));
        scene.objects[object as usize].transform =
            Affine3A::from_scale(Vec3::new(-1.0, 1.5, 1.0)) * Affine3A::from_rotation_y(0.3);
    }
    scene
}

#[test]
fn closest_hits_equal_brute_force_and_break_ties_by_index() {
    let scene = with_ties();
    let bvh = SceneBvh::build(&scene);
    let mut ties = 0;
    for (o, d) in rays(4000) {
        let expected = brute_force(&scene, o, d);
        let hit = bvh.closest(&scene, o, d, f32::INFINITY);
        assert_eq!(hit.map(|h| (h.object, h.triangle, h.t)), expected);
        assert_eq!(bvh.occluded(&scene, o, d, 100.0), hit.is_some());
        if let Some(h) = hit {
            assert!((o + d * h.t - h.position).length() < 1e-5);
            assert!(!bvh.occluded(&scene, o, d, h.t * 0.999));
            assert_ne!(h.object, 7, "the tie went to the later object");
            ties += u32::from(h.object == 6);
            // From outside, a crate shows its front, mirrored or not.
            assert!(h.object != 6 || h.front || o.length() < 0.5);
        }
    }
    assert!(ties > 50);
}

#[test]
fn rays_along_an_axis_hit_whatever_the_sign_of_their_zeros() {
    let scene = cornell();
    let bvh = SceneBvh::build(&scene);
    let zeros = [0.0f32, -0.0];
    for i in 0..6 {
        for (a, b) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let mut d = [zeros[a], zeros[b], 0.0];
            d[2] = if i % 2 == 0 { 1.0 } else { -1.0 };
            d.rotate_right(i / 2);
            let (o, d) = (Vec3::new(0.03, -0.41, 0.17), Vec3::from(d));
            let hit = bvh.closest(&scene, o, d, f32::INFINITY);
            assert_eq!(
                hit.map(|h| (h.object, h.triangle, h.t)),
                brute_force(&scene, o, d),
                "{d:?}"
            );
            assert_eq!(bvh.occluded(&scene, o, d, f32::INFINITY), hit.is_some());
        }
    }
}

#[test]
fn moving_objects_leaves_no_trace_of_the_tree() {
    let mut scene = with_ties();
    let crumbs = (0..20).flat_map(|i| {
        let at = Vec3::new(0.09 * i as f32 - 0.9, 0.8, -0.5);
        box_quads(at, at + 0.05, false)
    });
    let crumbs: Vec<_> = crumbs.collect();
    add_quads(&mut scene, &crumbs, material(Vec3::ONE, Vec3::ZERO, false));
    let before = SceneBvh::build(&scene);
    scene.objects[4].transform = Affine3A::from_translation(Vec3::new(0.3, 0.2, 0.5));
    scene.objects[6].transform = Affine3A::from_rotation_x(1.0);
    let moved = before.moved(&scene, &[4]).moved(&scene, &[6]);
    assert_eq!(moved.trees.len(), 2);
    equal(&scene, &moved);
    // One more, as large as the third, and one gone; then the first edits undone.
    let copy = scene.objects[6].clone();
    scene.objects.push(copy);
    scene.meshes.push(Mesh::default().into());
    scene.objects[7].mesh = scene.meshes.len() as u32 - 1;
    let chained = moved.moved(&scene, &[7]);
    assert_eq!(chained.trees.len(), 2);
    equal(&scene, &chained);
    assert_eq!(chained.moved(&scene, &[8]).trees.len(), 1);
    scene.objects.pop();
    equal(&scene, &chained.moved(&scene, &[4, 6]));
    equal(&scene, &before.moved(&scene, &[4, 6, 7]));
}

/// No ray tells the tree from a new one.
fn equal(scene: &Scene, bvh: &SceneBvh) {
    let built = SceneBvh::build(scene);
    assert_eq!(bvh.triangles(), built.triangles());
    for (o, d) in rays(3000) {
        assert_eq!(
            bvh.closest(scene, o, d, 9.0),
            built.closest(scene, o, d, 9.0)
        );
        assert_eq!(
            bvh.occluded(scene, o, d, 0.7),
            built.occluded(scene, o, d, 0.7)
        );
    }
}

#[test]
fn nothing_leaks_through_edges_and_corners() {
    let scene = room(0.5);
    let bvh = SceneBvh::build(&scene);
    for (o, d) in rays(20_000) {
        // Aim at the edges: rays whose target has one coordinate on an edge of the room, and at the diagonals.
        let target = (o + d).signum() * Vec3::new(1.0, 1.0, d.z.abs());
        for aim in [target, Vec3::new(d.x, d.x, 1.0)] {
            let aim = (aim - o).normalize();
            let hit = bvh
                .closest(&scene, o, aim, f32::INFINITY)
                .expect("the room is closed");
            let start = offset(hit.position, hit.normal);
            assert!(bvh.closest(&scene, start, -aim, f32::INFINITY).is_some());
            assert!(
                !bvh.occluded(&scene, start, hit.normal, 1e-4)
                    || hit.position.abs().min_element() > 0.999
            );
        }
    }
}

#[test]
fn hits_nearer_than_a_tenth_of_a_millimetre_count() {
    let mut scene = Scene::default();
    add_quads(
        &mut scene,
        &[quad(Vec3::ZERO, Vec3::X, Vec3::Y)],
        material(Vec3::ONE, Vec3::ZERO, false),
    );
    let bvh = SceneBvh::build(&scene);
    let hit = bvh
        .closest(&scene, Vec3::new(0.3, 0.4, 1e-5), Vec3::NEG_Z, 1.0)
        .expect("a hit");
    assert!((hit.t - 1e-5).abs() < 1e-9 && hit.front);
    assert!(
        bvh.closest(&scene, Vec3::new(0.3, 0.4, 1e-5), Vec3::Z, 1.0)
            .is_none()
    );
    assert!(
        SceneBvh::build(&Scene::default())
            .closest(&scene, Vec3::ZERO, Vec3::X, 1.0)
            .is_none()
    );
}

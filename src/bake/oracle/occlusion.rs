//! Leaving out what is hidden changes no bit: neither chunks that lie behind what was drawn before them, nor tiles that see
//! nothing of a light.

use glam::Vec3;

use super::{EVALUATION, Numbers, gpu, random_light, random_texels, run};
use crate::cluster::VirtualLight;
use crate::lightmap::texels::Texels;
use crate::lightmap::{Clearance, Texel};
use crate::scene::Scene;

/// Walls across the room, with gaps between them, and many small triangles before and behind them.
fn clutter(numbers: &mut Numbers) -> Vec<[Vec3; 3]> {
    let mut triangles = Vec::new();
    for i in 0..12 {
        let axis = i % 3;
        let mut corner = |u: f32, v: f32| {
            let mut at = [0.0; 3];
            at[axis] = i as f32 * 0.6 - 3.3 + 0.1 * numbers.next();
            at[(axis + 1) % 3] = u * (2.0 + numbers.next());
            at[(axis + 2) % 3] = v * (2.0 + numbers.next());
            Vec3::from(at)
        };
        let [a, b, c, d] = [
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ];
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    for _ in 0..4000 {
        let center = numbers.vector() * 3.0;
        triangles.push([0; 3].map(|_| center + numbers.vector() * 0.05));
    }
    triangles
}

/// Texels of which every second one is looked up aside, for something that would be near, and some have little room.
fn crowded(numbers: &mut Numbers) -> Texels {
    let list = random_texels(numbers, 300, 3.0);
    let clearances = list
        .iter()
        .map(|texel| {
            let (x, y) = Vec3::from(texel.face).any_orthonormal_pair();
            let push = if numbers.next() < 0.5 {
                x + y
            } else {
                Vec3::ZERO
            };
            Clearance {
                push: push.to_array(),
                near: 0.02 * numbers.next(),
                way: 0.1 * numbers.next(),
                room: if numbers.next() < 0.2 { 0.05 } else { 1e30 },
            }
        })
        .collect();
    Texels {
        tiles: std::iter::once(0..(list.len() / Texel::TILE) as u32).collect(),
        count: list.len() as u32,
        list,
        clearances,
        ..Texels::default()
    }
}

#[test]
fn what_is_hidden_is_left_out_and_changes_no_bit() {
    let gpu = gpu();
    let mut numbers = Numbers(9);
    let scene = Scene::of_triangles(&clutter(&mut numbers));
    let texels = crowded(&mut numbers);
    let lights: Vec<(VirtualLight, i32)> = (0..48)
        .map(|i| (random_light(&mut numbers, i % 2), 1))
        .collect();
    for epsilon in [0.0, 0.05] {
        let evaluation = super::Evaluation {
            epsilon,
            ..EVALUATION
        };
        let (all, every) = run(&gpu, &scene, &texels, &lights, evaluation, false);
        let (seen, fewer) = run(&gpu, &scene, &texels, &lights, evaluation, true);
        assert!(all == seen, "epsilon {epsilon}");
        assert!(all.iter().any(|units| *units != 0));
        // Otherwise nothing was tested.
        assert!(10 * fewer < 9 * every, "{fewer} of {every} pairs");
    }
}

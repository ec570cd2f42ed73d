//! Tiles that take the places of others, beside what a difference asks for.

use glam::Vec3;

use super::super::gpu;
use super::start;
use crate::bake::device::records::Parts;
use crate::bake::update::Sign;
use crate::bake::world::changes::{Changed, Place};
use crate::cluster::{Shape, VirtualLight};
use crate::lightmap::texels::Texels;
use crate::lightmap::{Clearance, Texel};
use crate::scene::{Bounds, Scene};

/// What stands near one end of a tile changes. All that a difference asks for is hidden there, by as much as the old receivers
/// need but not the new ones; the other end, beside that, is lit in both versions.
#[test]
fn a_tile_takes_the_place_of_another_beside_what_was_asked_for_too() {
    let gpu = gpu();
    let at = |x: f32, y: f32| Vec3::new(x, y, 1.0);
    let [a, b, c, d] = [
        at(-1.0, -0.06),
        at(0.13, -0.06),
        at(0.13, 0.06),
        at(-1.0, 0.06),
    ];
    let scene = Scene::of_triangles(&[[a, b, c], [a, c, d]]);
    let list: Vec<Texel> = (0..Texel::TILE)
        .map(|i| {
            let [column, row] = [i % 8, i / 8].map(|k| k as f32 / 3.5 - 1.0);
            Texel {
                position: [0.6 * column, 0.08 * row, 2.0],
                object: 0,
                normal: [0.0, 0.0, -1.0],
                face: [0.0, 0.0, -1.0],
                pixel: 0,
            }
        })
        .collect();
    let mut texels = Texels {
        tiles: std::iter::once(0..1).collect(),
        count: list.len() as u32,
        clearances: vec![Clearance::OPEN; list.len()],
        list,
        ..Texels::default()
    };
    let light = VirtualLight {
        shape: Shape::Disk { area: 0.01 },
        position: Vec3::ZERO,
        normal: Vec3::Z,
        surface: Vec3::Z,
        flux: Vec3::ONE,
        direct: false,
    };
    let lit = |texels: &Texels| {
        let mut map = start(&gpu, &scene, texels);
        map.set_occlusion(true);
        map.push(light.clone(), Sign::Add, 0).expect("add");
        map
    };
    let mut map = lit(&texels);
    let mut near = Bounds::EMPTY;
    for (texel, clearance) in texels.list.iter().zip(&mut texels.clearances) {
        if texel.position[0] < -0.4 {
            near = near.with(Vec3::from(texel.position));
            *clearance = Clearance {
                push: [0.0, 1.0, 0.0],
                near: 0.0,
                way: 0.1,
                room: 1e30,
            };
        }
    }
    // Something of which nothing is left but that it was near.
    let corner = Bounds {
        min: near.min,
        max: near.min,
    };
    let changed = Changed {
        places: vec![Place {
            object: 1,
            before: Some(corner),
            after: None,
        }],
        near: vec![near.max],
        reach: 10.0,
    };
    let version = map
        .change(&scene, &texels, &[], &[0], changed)
        .expect("a change");
    assert!(
        map.push_difference(Parts::ALL, &light, 0, version)
            .expect("update"),
        "the light misses what changed"
    );
    let sums = map.sums().expect("read-back");
    assert!(sums.iter().any(|s| *s != 0), "nothing is lit");
    assert!(sums == lit(&texels).sums().expect("read-back"));
}

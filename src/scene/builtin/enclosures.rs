//! Two enclosures whose irradiance is known in closed form at every point: the integrating sphere and the furnace.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{
    super::Document,
    build::{Builder, Glow},
    shape::Shape,
};

/// A sphere of radius 1 m seen from inside, with a point light of 100 cd in its centre.
///
/// Every bounce spreads evenly over a sphere, so the irradiance is `phi / (A (1 - albedo))` everywhere, with `phi = 4 pi 100 lm`
/// and `A` the area. The sphere is an icosphere of 20,480 triangles; its area is 12.5626 m², 0.03 % below 4 pi.
pub(super) fn integrating_sphere(albedo: f32) -> Document {
    let mut build = Builder::new("integrating-sphere");
    let material = build.material("coating", [albedo; 3]);
    build.object("sphere", &icosphere(5).inverted(), material);
    build.point(
        "lamp",
        Vec3::ZERO,
        Glow {
            color: [1.0; 3],
            intensity: 100.0,
        },
    );
    build.camera("camera", Vec3::new(0.0, 0.0, 0.9), Vec3::ZERO, 1.2);
    build.finish()
}

/// A closed cube of 2 m whose walls all emit 1 cd/m²: the radiance is the same everywhere and in every direction, so the
/// irradiance is `pi / (1 - albedo)` lux everywhere.
pub(super) fn furnace(albedo: f32) -> Document {
    let mut build = Builder::new("furnace");
    let material = build.emitter("wall", [albedo; 3], [1.0; 3], 1.0);
    let mut room = Shape::default();
    room.standing_box(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
    room.polygon(
        &[
            [-1.0, 0.0, -1.0],
            [1.0, 0.0, -1.0],
            [1.0, 0.0, 1.0],
            [-1.0, 0.0, 1.0],
        ]
        .map(Vec3::from),
    );
    build.object("room", &room.inverted(), material);
    build.camera(
        "camera",
        Vec3::new(0.0, 1.0, 0.9),
        Vec3::new(0.0, 1.0, 0.0),
        1.2,
    );
    build.finish()
}

/// A unit sphere of 20 * 4^`levels` triangles of nearly equal size, its vertices shared and its normals smooth.
pub(crate) fn icosphere(levels: u32) -> Shape {
    let golden = (1.0 + 5f32.sqrt()) / 2.0;
    let mut positions: Vec<Vec3> = Vec::new();
    for (a, b) in [
        (1.0, golden),
        (-1.0, golden),
        (1.0, -golden),
        (-1.0, -golden),
    ] {
        positions.extend(
            [
                Vec3::new(0.0, a, b),
                Vec3::new(a, b, 0.0),
                Vec3::new(b, 0.0, a),
            ]
            .map(Vec3::normalize),
        );
    }
    // The faces are the triples of mutually nearest corners.
    let near = |a: usize, b: usize| a != b && positions[a].distance(positions[b]) < 1.1;
    let mut triangles = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in (b + 1..12).filter(|c| near(a, b) && near(b, *c) && near(*c, a)) {
                let outward = (positions[b] - positions[a])
                    .cross(positions[c] - positions[a])
                    .dot(positions[a])
                    > 0.0;
                triangles.push(if outward {
                    [a as u32, b as u32, c as u32]
                } else {
                    [a as u32, c as u32, b as u32]
                });
            }
        }
    }
    for _ in 0..levels {
        let mut middles = BTreeMap::new();
        let mut middle = |a: u32, b: u32, positions: &mut Vec<Vec3>| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                positions.push((positions[a as usize] + positions[b as usize]).normalize());
                positions.len() as u32 - 1
            })
        };
        let mut finer = Vec::with_capacity(triangles.len() * 4);
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(a, b)| middle(a, b, &mut positions));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    Shape {
        normals: positions.clone(),
        positions,
        uvs: Vec::new(),
        triangles,
    }
}

//! The office in the corner of the warehouse.

use glam::{Quat, Vec3};

use super::{HALF, materials::Materials};
use crate::scene::builtin::{
    build::{Builder, turned},
    masonry::{Opening, wall},
    shape::Shape,
};

/// A room of 9 m x 5 m in the corner at +X +Z, with windows to the hall and two lit panels.
pub(super) fn office(build: &mut Builder, m: &Materials) {
    let (low, high) = (
        Vec3::new(HALF[0] - 9.5, 0.0, HALF[1] - 5.5),
        Vec3::new(HALF[0] - 0.5, 3.2, HALF[1] - 0.5),
    );
    let windows: Vec<Opening> = [3.0f32, 5.0, 7.0]
        .iter()
        .map(|u| Opening {
            low: [*u, 1.0],
            high: [u + 1.6, 2.3],
            arched: false,
        })
        .collect();
    let mut openings = vec![Opening {
        low: [0.8, 0.0],
        high: [1.9, 2.15],
        arched: false,
    }];
    openings.extend(windows);
    // Seen from the hall: the long wall faces -Z, its left end at +X; the short one faces -X.
    for (name, width, at, degrees, openings) in [
        (
            "office front",
            9.0,
            Vec3::new(high.x, 0.0, low.z),
            180.0,
            &openings[..],
        ),
        (
            "office side",
            5.0,
            Vec3::new(low.x, 0.0, low.z),
            -90.0,
            &[][..],
        ),
    ] {
        let mesh = build.mesh(
            name,
            &[(&wall(width, 3.2, 0.15, openings, Some(2.9)), m.plaster)],
        );
        build.place(name, mesh, at, turned(degrees), Vec3::ONE);
    }
    let mut shell = Shape::default();
    let (x, z) = (Vec3::X * 9.0, Vec3::Z * 5.0);
    // Inside of the walls towards the hall's own, ceiling, outside of these walls, and the flat roof.
    shell.rectangle(Vec3::new(high.x - 0.1, 0.0, low.z), z, Vec3::Y * 2.9);
    shell.rectangle(Vec3::new(high.x, 0.0, high.z - 0.1), -x, Vec3::Y * 2.9);
    shell.rectangle(low + Vec3::Y * 2.9, x, z);
    shell.rectangle(low + Vec3::Y * 3.2 + z, x, -z);
    shell.rectangle(high - Vec3::Y * 3.2, -z, Vec3::Y * 3.2);
    shell.rectangle(Vec3::new(low.x, 0.0, high.z), x, Vec3::Y * 3.2);
    build.object("office shell", &shell, m.plaster);
    let mut light = Shape::default();
    light.rectangle(Vec3::new(-0.6, 0.0, -0.3), Vec3::X * 1.2, Vec3::Z * 0.6);
    let light = build.mesh("office panel", &[(&light, m.panel)]);
    let mut desk = Shape::default();
    desk.block(Vec3::new(-0.8, 0.71, -0.4), Vec3::new(0.8, 0.75, 0.4));
    for (x, z) in [(-0.75, -0.35), (0.7, -0.35), (-0.75, 0.3), (0.7, 0.3)] {
        desk.standing_box(Vec3::new(x, 0.0, z), Vec3::new(x + 0.05, 0.73, z + 0.05));
    }
    let mut screen = Shape::default();
    screen.block(Vec3::new(-0.3, 0.85, -0.16), Vec3::new(0.3, 1.2, -0.13));
    screen.standing_box(Vec3::new(-0.1, 0.752, -0.2), Vec3::new(0.1, 0.84, -0.1));
    let desk = build.mesh(
        "desk",
        &[(&desk.textured(0.8), m.pallet), (&screen, m.black)],
    );
    for side in [2.4f32, 6.4] {
        build.place(
            "office panel",
            light,
            Vec3::new(low.x + side, 2.85, low.z + 2.5),
            Quat::IDENTITY,
            Vec3::ONE,
        );
        build.place(
            "desk",
            desk,
            Vec3::new(low.x + side, 0.0, low.z + 2.2),
            Quat::IDENTITY,
            Vec3::ONE,
        );
    }
}

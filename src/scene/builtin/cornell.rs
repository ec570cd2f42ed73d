//! The Cornell box (Goral et al. 1984; Cornell University's 1998 data for the albedos), scaled to a 2 m cube with an open front.

use glam::{Affine3A, Vec3};

use super::{
    super::Document,
    build::{Builder, turned},
    shape::Shape,
};

/// Floor, ceiling and walls face inward and are an object each; the lamp is 0.5 m x 0.5 m, 2 cm below the ceiling, and faces down.
pub(super) fn cornell() -> Document {
    let mut build = Builder::new("cornell");
    let wall = build.material("wall", [0.73, 0.73, 0.73]);
    let red = build.material("red", [0.63, 0.065, 0.05]);
    let green = build.material("green", [0.14, 0.45, 0.091]);
    // Radiance in the classic 17 : 12 : 4, about that of a real frosted panel.
    let lamp = build.emitter(
        "lamp",
        [0.78, 0.78, 0.78],
        [1.0, 12.0 / 17.0, 4.0 / 17.0],
        5100.0,
    );
    let [left, right, low, high, back, front] = [-1.0, 1.0, 0.0, 2.0, -1.0, 1.0];
    let quad = |corners: [[f32; 3]; 4]| {
        let mut shape = Shape::default();
        shape.polygon(&corners.map(Vec3::from));
        shape
    };
    build.object(
        "floor",
        &quad([
            [left, low, front],
            [right, low, front],
            [right, low, back],
            [left, low, back],
        ]),
        wall,
    );
    build.object(
        "ceiling",
        &quad([
            [left, high, back],
            [right, high, back],
            [right, high, front],
            [left, high, front],
        ]),
        wall,
    );
    build.object(
        "back.wall",
        &quad([
            [left, low, back],
            [right, low, back],
            [right, high, back],
            [left, high, back],
        ]),
        wall,
    );
    build.object(
        "left.wall",
        &quad([
            [left, low, front],
            [left, low, back],
            [left, high, back],
            [left, high, front],
        ]),
        red,
    );
    build.object(
        "right.wall",
        &quad([
            [right, low, back],
            [right, low, front],
            [right, high, front],
            [right, high, back],
        ]),
        green,
    );
    // The boxes' places are those of the original, which is 0.556 m wide and seen along +Z.
    for (name, height, center, degrees) in [
        ("small.box", 0.6, [0.33, 0.39], -18.0f32),
        ("tall.box", 1.2, [-0.33, -0.27], 17.0),
    ] {
        let mut shape = Shape::default();
        shape.standing_box(Vec3::new(-0.3, 0.0, -0.3), Vec3::new(0.3, height, 0.3));
        let mesh = build.mesh(name, &[(&shape, wall)]);
        build.place(
            name,
            mesh,
            Vec3::new(center[0], low, center[1]),
            turned(degrees),
            Vec3::ONE,
        );
    }
    let panel = quad([
        [-0.25, 0.0, -0.25],
        [0.25, 0.0, -0.25],
        [0.25, 0.0, 0.25],
        [-0.25, 0.0, 0.25],
    ]);
    build.object(
        "lamp",
        &panel.transformed(Affine3A::from_translation(Vec3::new(0.0, high - 0.02, 0.0))),
        lamp,
    );
    build.camera(
        "camera",
        Vec3::new(0.0, 1.0, 4.85),
        Vec3::new(0.0, 1.0, 0.0),
        0.5,
    );
    build.finish()
}

//! Street lamps, benches, bollards and market stalls.

use glam::{Affine3A, Quat, Vec3};

use super::materials::Materials;
use crate::scene::builtin::{
    build::{Builder, chance, turned},
    enclosures::icosphere,
    shape::Shape,
    turning::{cos, curve, lathe, sin},
};

/// Lamps, benches, bollards and market stalls.
pub(super) fn furniture(build: &mut Builder, m: &Materials) {
    let post = lathe(
        &curve(
            &[
                [0.24, 0.0],
                [0.22, 0.25],
                [0.1, 0.35],
                [0.07, 0.9],
                [0.06, 2.2],
                [0.055, 3.2],
                [0.1, 3.3],
                [0.12, 3.42],
            ],
            2,
        ),
        16,
    );
    let cap = lathe(&[[0.0, 3.82], [0.13, 3.82], [0.05, 3.95], [0.0, 4.05]], 16);
    let mut iron = post;
    iron.append(&cap);
    let globe = icosphere(2).transformed(Affine3A::from_scale_rotation_translation(
        Vec3::splat(0.2),
        Quat::IDENTITY,
        Vec3::Y * 3.62,
    ));
    let lamp = build.mesh("street lamp", &[(&iron, m.iron), (&globe, m.globe)]);
    for n in 0..12 {
        let angle = (n as f32 * 30.0 + 15.0).to_radians();
        build.place(
            "street lamp",
            lamp,
            Vec3::new(16.5 * cos(angle), 0.0, 13.5 * sin(angle)),
            Quat::IDENTITY,
            Vec3::ONE,
        );
    }
    let mut bench = Shape::default();
    for i in 0..4 {
        bench.block(
            Vec3::new(-0.9, 0.42, -0.25 + 0.12 * i as f32),
            Vec3::new(0.9, 0.46, -0.15 + 0.12 * i as f32),
        );
    }
    for i in 0..3 {
        bench.block(
            Vec3::new(-0.9, 0.55 + 0.13 * i as f32, -0.32),
            Vec3::new(0.9, 0.65 + 0.13 * i as f32, -0.28),
        );
    }
    let mut legs = Shape::default();
    for x in [-0.7, 0.64] {
        legs.standing_box(Vec3::new(x, 0.0, -0.25), Vec3::new(x + 0.06, 0.44, -0.19));
        legs.standing_box(Vec3::new(x, 0.0, 0.12), Vec3::new(x + 0.06, 0.44, 0.18));
    }
    let bench = build.mesh("bench", &[(&bench.textured(0.6), m.wood), (&legs, m.iron)]);
    let bollard = build.mesh(
        "bollard",
        &[(
            &lathe(
                &curve(
                    &[
                        [0.14, 0.0],
                        [0.13, 0.1],
                        [0.08, 0.16],
                        [0.08, 0.65],
                        [0.11, 0.72],
                        [0.07, 0.84],
                        [0.0, 0.88],
                    ],
                    2,
                ),
                16,
            ),
            m.iron,
        )],
    );
    for n in 0..8 {
        let angle = (n as f32 * 45.0 + 22.5).to_radians();
        let out = Vec3::new(6.2 * cos(angle), 0.0, 6.2 * sin(angle));
        build.place(
            "bench",
            bench,
            out,
            turned(90.0 - n as f32 * 45.0 - 22.5),
            Vec3::ONE,
        );
        build.place(
            "bollard",
            bollard,
            Vec3::new(-19.5, 0.0, -14.0 + 4.0 * n as f32),
            Quat::IDENTITY,
            Vec3::ONE,
        );
        build.place(
            "bollard",
            bollard,
            Vec3::new(-14.0 + 4.0 * n as f32, 0.0, 16.2),
            Quat::IDENTITY,
            Vec3::ONE,
        );
    }
    stalls(build, m);
}

fn stalls(build: &mut Builder, m: &Materials) {
    let mut frame = Shape::default();
    for (x, z) in [(-1.4, -0.9), (1.34, -0.9), (-1.4, 0.84), (1.34, 0.84)] {
        frame.standing_box(Vec3::new(x, 0.0, z), Vec3::new(x + 0.06, 2.3, z + 0.06));
    }
    frame.block(Vec3::new(-1.33, 0.78, -0.83), Vec3::new(1.33, 0.84, 0.83));
    let mut canopy = Shape::default();
    for (z, up) in [
        (1.15, Vec3::new(0.0, 0.55, -1.15)),
        (-1.15, Vec3::new(0.0, 0.55, 1.15)),
    ] {
        let (corner, along) = if z > 0.0 {
            (Vec3::new(-1.6, 2.3, z), Vec3::X * 3.2)
        } else {
            (Vec3::new(1.6, 2.3, z), Vec3::NEG_X * 3.2)
        };
        canopy.grid(corner, along, up, [16, 4], |p| 0.1 * (p.y * p.y - p.y));
    }
    let mut goods = Shape::default();
    let fruit = icosphere(1);
    for n in 0..40u32 {
        let (x, z) = (
            (n % 8) as f32 * 0.2 - 0.72 + 0.03 * chance(50, n),
            (n / 8) as f32 * 0.2 - 0.5 + 0.03 * chance(51, n),
        );
        goods.append(
            &fruit
                .clone()
                .transformed(Affine3A::from_scale_rotation_translation(
                    Vec3::splat(0.08),
                    Quat::IDENTITY,
                    Vec3::new(x, 0.92, z),
                )),
        );
    }
    for (n, (x, z)) in [(-17.0, 6.0), (-17.0, -5.0), (8.5, -6.5), (11.5, 7.0)]
        .into_iter()
        .enumerate()
    {
        let mesh = build.mesh(
            "market stall",
            &[
                (&frame.clone().textured(0.6), m.wood),
                (&canopy.clone().textured(0.8), m.cloth[n % 2]),
                (&goods, m.fruit),
            ],
        );
        build.place(
            "market stall",
            mesh,
            Vec3::new(x, 0.0, z),
            turned(if n < 2 { 90.0 } else { 30.0 * n as f32 }),
            Vec3::ONE,
        );
    }
}

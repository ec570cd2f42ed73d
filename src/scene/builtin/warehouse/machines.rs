//! Fork-lift trucks, the conveyor, and empty pallets.

use glam::{Affine3A, Quat, Vec3};

use super::{
    goods::{carton, pallet},
    materials::Materials,
};
use crate::scene::builtin::{
    build::{Builder, chance, turned},
    shape::Shape,
    turning::{curve, lathe},
};

/// Fork-lift trucks and a roller conveyor.
pub(super) fn machines(build: &mut Builder, m: &Materials) {
    let (mut body, mut dark, mut metal) = (Shape::default(), Shape::default(), Shape::default());
    body.block(Vec3::new(-0.55, 0.3, -1.1), Vec3::new(0.55, 0.8, 0.7));
    body.block(Vec3::new(-0.5, 0.801, -1.05), Vec3::new(0.5, 1.05, -0.35));
    // The counterweight is round behind.
    body.append(
        &lathe(
            &curve(
                &[
                    [0.0, 0.25],
                    [0.5, 0.28],
                    [0.56, 0.5],
                    [0.54, 0.8],
                    [0.3, 1.0],
                    [0.0, 1.02],
                ],
                3,
            ),
            32,
        )
        .at(0.0, 0.0, -1.12),
    );
    dark.block(Vec3::new(-0.28, 1.051, -0.95), Vec3::new(0.28, 1.16, -0.4));
    dark.block(Vec3::new(-0.28, 1.17, -0.98), Vec3::new(0.28, 1.65, -0.88));
    for (x, z) in [(-0.5, -1.0), (0.5, -1.0), (-0.5, 0.55), (0.5, 0.55)] {
        metal.bar(
            Vec3::new(x, 0.75, z),
            Vec3::new(x * 0.9, 2.1, z * 0.8),
            0.07,
        );
    }
    for i in 0..7 {
        let z = -0.8 + 0.205 * i as f32;
        metal.bar(Vec3::new(-0.47, 2.11, z), Vec3::new(0.47, 2.11, z), 0.05);
    }
    for x in [-0.38, 0.38] {
        metal.bar(Vec3::new(x, 0.1, 0.85), Vec3::new(x, 2.6, 0.85), 0.1);
        metal.block(
            Vec3::new(x - 0.06, 0.12, 0.95),
            Vec3::new(x + 0.06, 0.17, 2.1),
        );
        metal.block(
            Vec3::new(x - 0.06, 0.171, 0.95),
            Vec3::new(x + 0.06, 0.7, 1.0),
        );
    }
    for y in [0.4, 1.4, 2.5] {
        metal.bar(Vec3::new(-0.32, y, 0.86), Vec3::new(0.32, y, 0.86), 0.06);
    }
    let tyre = curve(
        &[
            [0.12, -0.12],
            [0.28, -0.12],
            [0.33, -0.08],
            [0.33, 0.08],
            [0.28, 0.12],
            [0.12, 0.12],
            [0.0, 0.11],
        ],
        2,
    );
    let sideways = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    for (x, z) in [(-0.56, -0.85), (0.56, -0.85), (-0.56, 0.5), (0.56, 0.5)] {
        let wheel = lathe(&tyre, 20);
        let turn = if x < 0.0 {
            sideways
        } else {
            sideways.inverse()
        };
        dark.append(&wheel.transformed(Affine3A::from_rotation_translation(
            turn,
            Vec3::new(x, 0.335, z),
        )));
    }
    let truck = build.mesh(
        "fork-lift truck",
        &[(&body, m.yellow), (&dark, m.black), (&metal, m.steel)],
    );
    for (x, z, degrees) in [(-16.5, 6.5, 110.0), (3.0, -8.8, 90.0), (16.0, 6.0, -35.0)] {
        build.place(
            "fork-lift truck",
            truck,
            Vec3::new(x, 0.0, z),
            turned(degrees),
            Vec3::ONE,
        );
    }

    let (mut rail, mut rollers) = (Shape::default(), Shape::default());
    for z in [-0.42, 0.37] {
        rail.block(Vec3::new(-7.0, 0.6, z), Vec3::new(7.0, 0.75, z + 0.05));
        for i in 0..6 {
            let x = -6.8 + 2.68 * i as f32;
            rail.standing_box(Vec3::new(x, 0.0, z), Vec3::new(x + 0.06, 0.599, z + 0.05));
        }
    }
    let lying = Affine3A::from_quat(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
    let roller = lathe(
        &[[0.0, -0.36], [0.05, -0.36], [0.05, 0.36], [0.0, 0.36]],
        14,
    )
    .transformed(lying);
    for i in 0..70 {
        rollers.append(&roller.clone().at(-6.9 + 0.2 * i as f32, 0.71, 0.0));
    }
    let conveyor = build.mesh("conveyor", &[(&rail, m.blue), (&rollers, m.steel)]);
    build.place(
        "conveyor",
        conveyor,
        Vec3::new(3.0, 0.0, 12.0),
        Quat::IDENTITY,
        Vec3::ONE,
    );
    let (mut boxes, mut tape) = (Shape::default(), Shape::default());
    carton(
        &mut boxes,
        &mut tape,
        Vec3::new(-0.3, 0.0, -0.2),
        Vec3::new(0.6, 0.4, 0.4),
    );
    let parcel = build.mesh(
        "parcel",
        &[(&boxes.textured(0.4), m.carton), (&tape, m.tape)],
    );
    for i in 0..7u32 {
        let at = Vec3::new(-3.2 + 1.9 * i as f32 + 0.5 * chance(90, i), 0.762, 12.0);
        build.place(
            "parcel",
            parcel,
            at,
            turned(30.0 * chance(91, i) - 15.0),
            Vec3::ONE,
        );
    }
    let mut stack = Shape::default();
    for i in 0..9 {
        stack.append(&pallet().transformed(Affine3A::from_rotation_translation(
            turned(3.0 * chance(92, i) - 1.5),
            Vec3::Y * (0.146 * i as f32 + 0.002),
        )));
    }
    let stack = build.mesh("empty pallets", &[(&stack.textured(0.5), m.pallet)]);
    for (n, (x, z)) in [(-9.0, 15.5), (-7.2, 15.5), (13.5, 16.0)]
        .into_iter()
        .enumerate()
    {
        build.place(
            "empty pallets",
            stack,
            Vec3::new(x, 0.0, z),
            turned(5.0 * n as f32),
            Vec3::ONE,
        );
    }
}

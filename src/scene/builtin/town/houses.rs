//! The houses around the square, the town hall with its tower, shops and wall lanterns.

use glam::{Affine3A, Quat, Vec3};

use super::{
    house::{House, Plan},
    materials::Materials,
};
use crate::scene::builtin::{
    build::{Builder, Glow, turned},
    shape::Shape,
    turning::{cos, curve, lathe, sin},
};

pub(super) fn houses(build: &mut Builder, m: &Materials) {
    let plan = |width: f32, storeys: u32, bays: u32, roof: f32| Plan {
        width,
        depth: 9.0,
        storeys,
        bays,
        roof,
        arched: false,
    };
    // South, seen from its back by the default camera.
    for (n, (x, storeys)) in [(21.9, 3), (10.95, 2), (0.0, 3), (-10.95, 2)]
        .into_iter()
        .enumerate()
    {
        let house = House::new(&plan(10.88, storeys, 4, 3.0));
        let walls = if n == 2 { m.brick } else { m.stucco[n] };
        house.place(
            build,
            m,
            "south house",
            walls,
            Vec3::new(x, 0.0, 18.0),
            180.0,
        );
    }
    // East, with shops.
    for (n, (z, storeys)) in [(18.0, 3), (6.0, 4), (-6.0, 3)].into_iter().enumerate() {
        let house = House::new(&plan(11.9, storeys, 4, 2.6));
        let walls = [m.stucco[2], m.brick, m.stucco[0]][n];
        // Quarter turns: the front of the house faces -X.
        let at = Vec3::new(22.0, 0.0, z - 11.95);
        house.place(build, m, "east house", walls, at, -90.0);
        for bay in [0.5f32, 2.5] {
            let along = at + Vec3::Z * (2.975 * bay);
            shop(build, m, along, n);
        }
    }
    // North: the town hall between two houses.
    for (n, x) in [-21.9, 11.9].into_iter().enumerate() {
        let house = House::new(&plan(10.0, 3, 4, 3.0));
        house.place(
            build,
            m,
            "north house",
            [m.stucco[1], m.stucco[3]][n],
            Vec3::new(x, 0.0, -18.0),
            0.0,
        );
    }
    let hall = House::new(&Plan {
        width: 21.0,
        depth: 9.0,
        storeys: 3,
        bays: 7,
        roof: 3.4,
        arched: true,
    });
    hall.place(
        build,
        m,
        "town hall",
        m.stone,
        Vec3::new(-10.5, 0.0, -18.5),
        0.0,
    );
    tower(build, m);
    let mut lantern = shade();
    lantern.bar(
        Vec3::new(0.0, 0.25, 0.02),
        Vec3::new(0.0, 0.25, -0.95),
        0.03,
    );
    let lantern = build.mesh("lantern shade", &[(&lantern, m.iron)]);
    for (n, x) in [-20.5f32, -13.5, -9.0, -3.0, 3.0, 9.0, 13.5, 20.5]
        .into_iter()
        .enumerate()
    {
        let at = Vec3::new(x, 3.75, -17.6);
        let glow = Glow {
            color: [1.0, 0.72, 0.42],
            intensity: 320.0,
        };
        build.spot(
            &format!("wall lantern {n}"),
            [at, at + Vec3::new(0.0, -3.0, 0.8)],
            glow,
            [0.5, 1.1],
            None,
        );
        build.place(
            "lantern shade",
            lantern,
            at + Vec3::Y * 0.02,
            Quat::IDENTITY,
            Vec3::ONE,
        );
    }
}

/// A cone of sheet iron over a lamp at the origin, seen from both sides.
pub(super) fn shade() -> Shape {
    let mut shade = lathe(
        &curve(&[[0.3, 0.0], [0.26, 0.12], [0.1, 0.2], [0.03, 0.24]], 2),
        20,
    );
    shade.append(
        &lathe(
            &curve(&[[0.295, 0.0], [0.25, 0.11], [0.09, 0.19], [0.0, 0.2]], 2),
            20,
        )
        .inverted(),
    );
    shade
}

/// A clock tower on the town hall's roof.
fn tower(build: &mut Builder, m: &Materials) {
    let mut shape = Shape::default();
    shape.standing_box(Vec3::new(-2.2, 9.0, -25.2), Vec3::new(2.2, 19.0, -20.8));
    shape.block(Vec3::new(-2.5, 18.9, -25.5), Vec3::new(2.5, 19.5, -20.5));
    build.object("tower", &shape.textured(1.6), m.brick);
    let roof = lathe(&[[2.9, 19.5], [1.6, 21.5], [0.0, 26.0]], 4).transformed(
        Affine3A::from_translation(Vec3::new(0.0, 0.0, -23.0)) * Affine3A::from_quat(turned(45.0)),
    );
    build.object("tower roof", &roof, m.tiles);
    let upright = Affine3A::from_translation(Vec3::new(0.0, 16.5, -20.8))
        * Affine3A::from_quat(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
    let dial = lathe(
        &curve(
            &[
                [1.5, 0.0],
                [1.5, 0.08],
                [1.4, 0.12],
                [1.3, 0.06],
                [0.0, 0.05],
            ],
            2,
        ),
        48,
    );
    build.object("clock", &dial.transformed(upright), m.stucco[2]);
    let mut hands = Shape::default();
    for (degrees, length) in [(25.0f32, 1.1), (140.0, 0.75)] {
        let (s, c) = (sin(degrees.to_radians()), cos(degrees.to_radians()));
        let at = Vec3::new(0.0, 16.5, -20.68);
        hands.bar(at, at + Vec3::new(s * length, c * length, 0.0), 0.06);
    }
    build.object("clock hands", &hands, m.iron);
}

/// A lit window and an awning over it, on the east side; `at` is the middle of the bay on the ground.
fn shop(build: &mut Builder, m: &Materials, at: Vec3, n: usize) {
    let mut window = Shape::default();
    window.rectangle(Vec3::new(-0.95, 0.65, -0.08), Vec3::X * 1.9, Vec3::Y * 2.2);
    let mesh = build.mesh("shop window", &[(&window, m.shop)]);
    build.place("shop window", mesh, at, turned(-90.0), Vec3::ONE);
    let mut awning = Shape::default();
    awning.grid(
        Vec3::new(-1.6, 2.95, 1.5),
        Vec3::X * 3.2,
        Vec3::new(0.0, 0.62, -1.48),
        [16, 6],
        |p| 0.08 * (p.y - p.y * p.y),
    );
    awning.grid(
        Vec3::new(-1.6, 2.7, 1.5),
        Vec3::X * 3.2,
        Vec3::Y * 0.25,
        [32, 2],
        |p| 0.02 * sin(p.x * 60.0) * (1.0 - p.y),
    );
    let mesh = build.mesh("awning", &[(&awning.textured(0.8), m.cloth[n % 2])]);
    build.place("awning", mesh, at, turned(-90.0), Vec3::ONE);
}

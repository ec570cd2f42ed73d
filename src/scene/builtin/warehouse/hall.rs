//! The hall: floor, walls, docks, roof, trusses and high-bay lamps.

use glam::{Quat, Vec3};

use super::{HALF, materials::Materials};
use crate::scene::builtin::{
    build::{Builder, Glow, turned},
    masonry::{Opening, wall},
    shape::Shape,
    turning::{curve, lathe, sin},
};

const EAVES: f32 = 9.5;

const RIDGE: f32 = 12.0;

/// Floor in twelve pieces, ribbed walls that face inward, three docks in the wall at -X.
pub(super) fn hall(build: &mut Builder, m: &Materials) {
    let [x, z] = HALF;
    for i in 0..4 {
        for j in 0..3 {
            let mut floor = Shape::default();
            let size = Vec3::new(x / 2.0, 0.0, z / 1.5);
            floor.rectangle(
                Vec3::new(-x + size.x * i as f32, 0.0, -z + size.z * j as f32),
                Vec3::Z * size.z,
                Vec3::X * size.x,
            );
            build.object("floor", &floor.textured(4.0), m.concrete);
        }
    }
    let ribs = |width: f32| {
        let waves = (width / 0.4).round();
        // Flat troughs with raised ribs, as rolled steel has.
        let rib = move |u: f32| if (u * waves).fract() > 0.6 { 0.04 } else { 0.0 };
        (waves as u32 * 5, rib)
    };
    for (corner, along) in [
        (Vec3::new(-x, 2.0, -z), Vec3::X),
        (Vec3::new(x, 2.0, z), Vec3::NEG_X),
        (Vec3::new(x, 2.0, -z), Vec3::Z),
    ] {
        let width = 2.0 * if along.x != 0.0 { x } else { z };
        let (cells, rib) = ribs(width);
        let mut cladding = Shape::default();
        cladding.grid(
            corner,
            along * width,
            Vec3::Y * (EAVES - 2.0),
            [cells, 1],
            |p| rib(p.x + 1e-4),
        );
        build.object("cladding", &cladding, m.cladding);
        let mut plinth = Shape::default();
        plinth.rectangle(corner - Vec3::Y * 2.0, along * width, Vec3::Y * 2.0);
        build.object("plinth wall", &plinth, m.plaster);
    }
    // The wall at -X faces +X: quarter turn, its left end at +Z.
    let width = 2.0 * z;
    let docks: Vec<Opening> = [6.0f32, 14.0, 22.0]
        .iter()
        .map(|u| Opening {
            low: [*u, 0.0],
            high: [u + 4.0, 4.4],
            arched: false,
        })
        .collect();
    let mesh = build.mesh(
        "dock wall",
        &[(&wall(width, EAVES, 0.3, &docks, None), m.plaster)],
    );
    build.place(
        "dock wall",
        mesh,
        Vec3::new(-x, 0.0, z),
        turned(90.0),
        Vec3::ONE,
    );
    for dock in &docks {
        let mut door = Shape::default();
        let bulge = |v: f32| 0.03 * sin((v * 9.0).fract() * std::f32::consts::PI).max(0.0);
        door.grid(
            Vec3::new(dock.low[0], 0.0, -0.25),
            Vec3::X * 4.0,
            Vec3::Y * 4.4,
            [1, 54],
            |p| bulge(p.y),
        );
        let mut sill = Shape::default();
        sill.rectangle(
            Vec3::new(dock.low[0], 0.0, 0.0),
            Vec3::X * 4.0,
            Vec3::NEG_Z * 0.3,
        );
        let mesh = build.mesh("dock door", &[(&door, m.steel), (&sill, m.plaster)]);
        build.place(
            "dock door",
            mesh,
            Vec3::new(-x, 0.0, z),
            turned(90.0),
            Vec3::ONE,
        );
    }
    let post = build.mesh(
        "bollard",
        &[(
            &lathe(
                &curve(
                    &[
                        [0.11, 0.0],
                        [0.11, 0.5],
                        [0.11, 0.95],
                        [0.08, 1.05],
                        [0.0, 1.08],
                    ],
                    2,
                ),
                20,
            ),
            m.yellow,
        )],
    );
    for u in [5.6f32, 10.4, 13.6, 18.4, 21.6, 26.4] {
        build.place(
            "bollard",
            post,
            Vec3::new(-x + 0.7, 0.0, z - u),
            Quat::IDENTITY,
            Vec3::ONE,
        );
    }
    for u in [12.0f32, 20.0] {
        let at = Vec3::new(-x + 1.2, 6.5, z - u);
        let glow = Glow {
            color: [1.0, 0.95, 0.85],
            intensity: 4000.0,
        };
        build.spot(
            "dock spot",
            [at, Vec3::new(-x + 3.5, 0.0, z - u)],
            glow,
            [0.6, 0.9],
            None,
        );
    }
}

/// Two slopes and the gables above the eaves, trusses with their posts, and the high-bay lamps.
pub(super) fn roof(build: &mut Builder, m: &Materials) {
    let [x, z] = HALF;
    for side in [-1.0f32, 1.0] {
        let mut slope = Shape::default();
        let eaves = Vec3::new(-x * side, EAVES, z * side);
        slope.grid(
            eaves,
            Vec3::X * (2.0 * x * side),
            Vec3::new(0.0, RIDGE - EAVES, -z * side),
            [130, 1],
            |_| 0.0,
        );
        build.object("roof", &slope.inverted(), m.cladding);
        let mut gable = Shape::default();
        gable.polygon(&[
            Vec3::new(x * side, EAVES, -z * side),
            Vec3::new(x * side, EAVES, z * side),
            Vec3::new(x * side, RIDGE, 0.0),
        ]);
        build.object("gable", &gable, m.cladding);
    }
    let mut truss = Shape::default();
    let top = |t: f32| Vec3::new(0.0, RIDGE - 0.15 - (RIDGE - EAVES) * t.abs(), t * (z - 0.3));
    let low = |t: f32| Vec3::new(0.0, EAVES - 0.4 + 0.2 * (1.0 - t.abs()), t * (z - 0.3));
    const PANELS: i32 = 8;
    for side in [-1.0, 1.0] {
        // Not quite to the middle, where the two halves would touch.
        truss.bar(top(side), top(0.001 * side), 0.14);
        truss.bar(low(side), low(0.001 * side), 0.12);
    }
    for i in -PANELS..PANELS {
        let (a, b) = (i as f32 / PANELS as f32, (i + 1) as f32 / PANELS as f32);
        truss.bar(low(a), top(a), 0.07);
        truss.bar(
            if i < 0 { low(a) } else { top(a) },
            if i < 0 { top(b) } else { low(b) },
            0.06,
        );
    }
    for side in [-1.0, 1.0] {
        // An I-beam as a post, clear of the wall.
        for (from, to) in [
            ([-0.12, -0.12], [0.12, -0.09]),
            ([-0.12, 0.09], [0.12, 0.12]),
            ([-0.015, -0.1], [0.015, 0.1]),
        ] {
            let at = Vec3::new(0.0, 0.0, side * (z - 0.4));
            truss.standing_box(
                at + Vec3::new(from[0], 0.0, from[1]),
                at + Vec3::new(to[0], EAVES - 0.3, to[1]),
            );
        }
    }
    let truss = build.mesh("truss", &[(&truss, m.steel)]);
    for i in 0..9 {
        build.place(
            "truss",
            truss,
            Vec3::new(-24.0 + 6.0 * i as f32, 0.0, 0.0),
            Quat::IDENTITY,
            Vec3::ONE,
        );
    }
    let mut purlins = Shape::default();
    for i in 1..6 {
        for side in [-1.0, 1.0] {
            let t = side * (i as f32 / 6.0);
            let at = top(t) + Vec3::Y * 0.03;
            purlins.bar(at - Vec3::X * (x - 0.2), at + Vec3::X * (x - 0.2), 0.08);
        }
    }
    build.object("purlins", &purlins, m.steel);
    let mut housing = lathe(
        &curve(
            &[
                [0.36, 0.0],
                [0.34, 0.12],
                [0.2, 0.3],
                [0.16, 0.42],
                [0.0, 0.46],
            ],
            4,
        ),
        22,
    );
    housing.bar(Vec3::Y * 0.44, Vec3::Y * 1.3, 0.03);
    let disk = lathe(&[[0.0, 0.03], [0.3, 0.03], [0.36, 0.0]], 22);
    let lamp = build.mesh("high-bay lamp", &[(&housing, m.steel), (&disk, m.high_bay)]);
    for i in 0..5 {
        for j in 0..4 {
            let at = Vec3::new(-20.0 + 10.0 * i as f32, 8.3, [-15.0, -6.3, 2.5, 11.5][j]);
            build.place("high-bay lamp", lamp, at, Quat::IDENTITY, Vec3::ONE);
        }
    }
}

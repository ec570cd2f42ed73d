//! Pallets, what is on them, and the racks they stand in.

use glam::{Quat, Vec3};

use super::materials::Materials;
use crate::scene::builtin::{
    build::{Builder, chance, turned},
    enclosures::icosphere,
    shape::Shape,
    turning::{lathe, sin},
};

/// A rack: bays, metres a bay, levels, metres a level, depth.
const BAYS: u32 = 12;

const BAY: f32 = 2.8;

const LEVELS: u32 = 4;

const LEVEL: f32 = 1.9;

const DEPTH: f32 = 1.1;

/// A pallet of 1.2 m x 0.8 m, 14.4 cm high, its middle on the origin.
pub(super) fn pallet() -> Shape {
    let mut shape = Shape::default();
    for x in [-0.6, -0.0725, 0.455] {
        for z in [-0.4, -0.07, 0.26] {
            shape.standing_box(Vec3::new(x, 0.022, z), Vec3::new(x + 0.145, 0.1, z + 0.14));
        }
    }
    for z in [-0.4, -0.05, 0.3] {
        shape.block(Vec3::new(-0.6, 0.0, z), Vec3::new(0.6, 0.021, z + 0.1));
    }
    for x in [-0.6, -0.0725, 0.455] {
        shape.block(Vec3::new(x, 0.101, -0.4), Vec3::new(x + 0.145, 0.121, 0.4));
    }
    for i in 0..5 {
        let z = -0.4 + 0.175 * i as f32;
        shape.block(Vec3::new(-0.6, 0.122, z), Vec3::new(0.6, 0.144, z + 0.1));
    }
    shape
}

/// A closed carton with tape over its lid.
pub(super) fn carton(goods: &mut Shape, tape: &mut Shape, low: Vec3, size: Vec3) {
    goods.standing_box(low, low + size);
    let lid = low + Vec3::Y * (size.y + 0.002);
    tape.rectangle(
        lid + Vec3::new(0.0, 0.0, size.z * 0.58),
        Vec3::X * size.x,
        -Vec3::Z * size.z * 0.16,
    );
    for (x, out, along) in [
        (-0.002, Vec3::NEG_X, Vec3::Z),
        (size.x + 0.002, Vec3::X, Vec3::NEG_Z),
    ] {
        let from = low
            + Vec3::new(
                x,
                size.y * 0.8,
                size.z * if out.x < 0.0 { 0.42 } else { 0.58 },
            );
        tape.rectangle(from, along * size.z * 0.16, Vec3::Y * size.y * 0.2);
    }
}

/// A loaded pallet; the goods stay below 1.5 m.
fn load(build: &mut Builder, m: &Materials, kind: usize) -> usize {
    let (mut goods, mut tape) = (Shape::default(), Shape::default());
    const DECK: f32 = 0.144;
    let material = match kind {
        0 | 1 => {
            let (nx, ny, nz) = if kind == 0 { (3, 3, 2) } else { (3, 4, 3) };
            let size = Vec3::new(1.14 / nx as f32, 1.2 / ny as f32, 0.76 / nz as f32);
            for i in 0..nx * ny * nz {
                let (x, y, z) = (i % nx, i / nx / nz, i / nx % nz);
                // The top layer is not full.
                if y == ny - 1 && chance(70 + kind as u32, i as u32) < 0.3 {
                    continue;
                }
                let low = Vec3::new(
                    -0.57 + size.x * x as f32,
                    DECK + size.y * y as f32,
                    -0.38 + size.z * z as f32,
                );
                // A little apart, but standing on each other: no gap below.
                carton(
                    &mut goods,
                    &mut tape,
                    low + Vec3::new(0.006, 0.0, 0.006),
                    size - Vec3::new(0.012, 0.0, 0.012),
                );
            }
            m.carton
        }
        2 => {
            let rings = [
                [0.27, 0.0],
                [0.27, 0.28],
                [0.285, 0.3],
                [0.27, 0.32],
                [0.27, 0.58],
                [0.285, 0.6],
                [0.27, 0.62],
                [0.28, 0.88],
                [0.0, 0.87],
            ];
            for (x, z) in [(-0.3, -0.1), (0.28, 0.08)] {
                goods.append(&lathe(&rings, 16).at(x, DECK, z));
            }
            m.drum
        }
        3 => {
            for layer in 0..4 {
                for n in 0..2 {
                    let at = Vec3::new(
                        -0.29 + 0.58 * n as f32,
                        DECK + 0.1 + 0.18 * layer as f32,
                        0.01 * (layer % 2) as f32,
                    );
                    let round = |v: f32| v.signum() * v.abs().sqrt();
                    let sack = icosphere(1).bent(|p, _| {
                        Vec3::new(0.28 * round(p.x), 0.1 * p.y, 0.38 * round(p.z))
                            * (1.0 + 0.03 * sin(9.0 * p.x + n as f32))
                    });
                    goods.append(&sack.at(at.x, at.y, at.z));
                }
            }
            m.sack
        }
        4 => {
            // A crate of boards on four sides.
            for i in 0..5 {
                let y = DECK + 0.003 + 0.22 * i as f32;
                for z in [-0.4, 0.375] {
                    goods.block(Vec3::new(-0.58, y, z), Vec3::new(0.58, y + 0.2, z + 0.025));
                }
                for x in [-0.58, 0.555] {
                    goods.block(Vec3::new(x, y, -0.37), Vec3::new(x + 0.025, y + 0.2, 0.37));
                }
            }
            for (x, z) in [(-0.55, -0.37), (0.5, -0.37), (-0.55, 0.32), (0.5, 0.32)] {
                goods.standing_box(
                    Vec3::new(x, DECK, z),
                    Vec3::new(x + 0.05, DECK + 1.1, z + 0.05),
                );
            }
            goods.standing_box(
                Vec3::new(-0.54, DECK, -0.31),
                Vec3::new(0.54, DECK + 0.9, 0.31),
            );
            m.pallet
        }
        _ => {
            // Wrapped in film: a soft block.
            let soft = icosphere(2).bent(|p, _| {
                let round = |v: f32| v.signum() * v.abs().powf(0.35);
                Vec3::new(
                    0.57 * round(p.x),
                    0.55 * round(p.y) + DECK + 0.56,
                    0.38 * round(p.z),
                ) + p * 0.012 * sin(23.0 * p.y + 7.0 * p.x)
            });
            goods.append(&soft);
            m.film
        }
    };
    build.mesh(
        "load",
        &[
            (&pallet().textured(0.5), m.pallet),
            (&goods.textured(0.4), material),
            (&tape, m.tape),
        ],
    )
}

/// Six rows of racks, the inner ones back to back, along X.
pub(super) fn racks(build: &mut Builder, m: &Materials) {
    let mut frame = Shape::default();
    let height = LEVEL * (LEVELS - 1) as f32 + 1.5;
    for z in [0.0, DEPTH - 0.1] {
        frame.standing_box(Vec3::new(-0.05, 0.02, z), Vec3::new(0.05, height, z + 0.1));
        frame.standing_box(
            Vec3::new(-0.09, 0.0, z - 0.02),
            Vec3::new(0.09, 0.019, z + 0.12),
        );
    }
    for i in 0..8 {
        let y = 0.3 + 0.8 * i as f32;
        let (from, to) = if i % 2 == 0 {
            (0.1, DEPTH - 0.1)
        } else {
            (DEPTH - 0.1, 0.1)
        };
        frame.bar(Vec3::new(0.0, y, from), Vec3::new(0.0, y + 0.75, to), 0.04);
    }
    let frame = build.mesh("rack frame", &[(&frame, m.blue)]);
    let (mut beams, mut deck) = (Shape::default(), Shape::default());
    for level in 1..LEVELS {
        let y = LEVEL * level as f32;
        for z in [0.005, DEPTH - 0.055] {
            beams.block(
                Vec3::new(0.052, y - 0.12, z),
                Vec3::new(BAY - 0.052, y, z + 0.05),
            );
        }
        for i in 0..6 {
            let x = 0.25 + 0.43 * i as f32;
            deck.block(
                Vec3::new(x, y - 0.06, 0.06),
                Vec3::new(x + 0.14, y - 0.02, DEPTH - 0.06),
            );
        }
    }
    let beams = build.mesh("rack beams", &[(&beams, m.orange), (&deck, m.steel)]);
    let loads: Vec<usize> = (0..6).map(|kind| load(build, m, kind)).collect();
    for (row, z) in [-17.8f32, -13.0, -11.5, -6.0, -4.5, 1.0]
        .into_iter()
        .enumerate()
    {
        let x = -14.0;
        for bay in 0..=BAYS {
            build.place(
                "rack frame",
                frame,
                Vec3::new(x + BAY * bay as f32, 0.0, z),
                Quat::IDENTITY,
                Vec3::ONE,
            );
        }
        for bay in 0..BAYS {
            let corner = Vec3::new(x + BAY * bay as f32, 0.0, z);
            build.place("rack beams", beams, corner, Quat::IDENTITY, Vec3::ONE);
            for slot in 0..2 * LEVELS {
                let (level, side) = (slot / 2, slot % 2);
                let id = (row as u32 * BAYS + bay) * 2 * LEVELS + slot;
                if chance(80, id) < 0.3 {
                    continue;
                }
                let kind = (chance(81, id) * 5.999) as usize;
                let at = corner
                    + Vec3::new(
                        0.72 + 1.36 * side as f32,
                        LEVEL * level as f32 + 0.001,
                        DEPTH / 2.0,
                    );
                let degrees =
                    4.0 * chance(82, id) - 2.0 + if chance(83, id) < 0.5 { 180.0 } else { 0.0 };
                build.place("load", loads[kind], at, turned(degrees), Vec3::ONE);
            }
        }
    }
    // What has just come in stands by the docks.
    for n in 0..9u32 {
        let at = Vec3::new(
            -20.5 + 1.9 * (n % 3) as f32,
            0.002,
            9.0 + 2.1 * (n / 3) as f32,
        );
        build.place(
            "load",
            loads[n as usize % 6],
            at,
            turned(90.0 + 10.0 * chance(84, n)),
            Vec3::ONE,
        );
    }
}

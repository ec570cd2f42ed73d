//! Trees and potted bushes.

use glam::Vec3;

use super::materials::Materials;
use crate::scene::builtin::{
    build::{Builder, chance, turned},
    enclosures::icosphere,
    shape::Shape,
    turning::{curve, lathe, sin, tube},
};

pub(super) fn greenery(build: &mut Builder, m: &Materials) {
    let crown = |seed: u32| {
        let mut shape = Shape::default();
        for blob in 0..4u32 {
            let k = seed * 4 + blob;
            let size = 1.1 + 0.5 * chance(41, k);
            let at = Vec3::new(
                1.6 * chance(42, k) - 0.8,
                3.6 + 1.0 * blob as f32 * 0.6,
                1.6 * chance(43, k) - 0.8,
            );
            shape.append(
                &icosphere(3)
                    .bent(|p, n| {
                        p * size
                            + n * 0.14
                                * (sin(9.0 * p.x + k as f32) + sin(11.0 * p.y) + sin(10.0 * p.z))
                    })
                    .at(at.x, at.y, at.z),
            );
        }
        shape
    };
    let trunk: Vec<Vec3> = curve(
        &[
            [0.0, -0.1, 0.0],
            [0.06, 0.4, 0.02],
            [-0.04, 1.6, 0.05],
            [0.05, 3.4, 0.0],
        ],
        4,
    )
    .into_iter()
    .map(Vec3::from)
    .collect();
    let radii: Vec<f32> = (0..trunk.len())
        .map(|i| 0.2 - 0.007 * i as f32 + if i == 0 { 0.12 } else { 0.0 })
        .collect();
    let trunk = tube(&trunk, &radii, 14, false);
    let meshes: Vec<usize> = (0..2)
        .map(|seed| build.mesh("tree", &[(&trunk, m.bark), (&crown(seed), m.leaves)]))
        .collect();
    for (n, (x, z)) in [
        (-13.0, -11.0),
        (-13.0, 0.0),
        (-13.0, 11.0),
        (13.0, -11.0),
        (13.0, 0.5),
        (6.5, 12.5),
        (-6.5, 12.5),
        (4.5, -12.5),
    ]
    .into_iter()
    .enumerate()
    {
        build.place(
            "tree",
            meshes[n % 2],
            Vec3::new(x, 0.0, z),
            turned(77.0 * n as f32),
            Vec3::ONE,
        );
    }
    let pot = lathe(
        &curve(
            &[
                [0.2, 0.0],
                [0.3, 0.4],
                [0.34, 0.45],
                [0.3, 0.46],
                [0.27, 0.38],
                [0.0, 0.36],
            ],
            2,
        ),
        20,
    );
    let bush = icosphere(2)
        .bent(|p, n| p * 0.36 + n * 0.05 * (sin(9.0 * p.x) + sin(8.0 * p.z + 2.0 * p.y)))
        .at(0.0, 0.62, 0.0);
    let pot = build.mesh("potted bush", &[(&pot, m.clay), (&bush, m.leaves)]);
    for n in 0..10 {
        let (x, z) = if n < 6 {
            (-8.5 + 3.4 * n as f32, -17.2)
        } else {
            (20.6, -14.4 + 8.0 * (n - 6) as f32)
        };
        build.place(
            "potted bush",
            pot,
            Vec3::new(x, 0.0, z),
            turned(50.0 * n as f32),
            Vec3::ONE,
        );
    }
}

//! The market hall on the west side of the square, and the fountain in its middle.

use glam::{Affine3A, Quat, Vec3};

use super::{house::attached, houses::shade, materials::Materials};
use crate::scene::builtin::{
    build::{Builder, Glow, turned},
    masonry::{Opening, wall},
    sculpture::bust,
    shape::Shape,
    turning::{curve, lathe, tube},
};

/// The market hall on the west side: arches behind columns, with pendants inside.
pub(super) fn colonnade(build: &mut Builder, m: &Materials) {
    let arches: Vec<Opening> = (0..9)
        .map(|n| 0.5 + 4.0 * n as f32)
        .map(|u| Opening {
            low: [u, 0.0],
            high: [u + 3.0, 4.8],
            arched: true,
        })
        .collect();
    let front = wall(36.0, 7.0, 0.6, &arches, Some(6.2));
    let mesh = build.mesh("arcade", &[(&front, m.stone)]);
    build.place(
        "arcade",
        mesh,
        Vec3::new(-22.0, 0.0, 18.0),
        turned(90.0),
        Vec3::ONE,
    );

    let mut rest = Shape::default();
    let (low, high) = (Vec3::new(-28.0, 0.0, -18.0), Vec3::new(-22.6, 6.2, 18.0));
    rest.rectangle(low + Vec3::Z * 36.0, Vec3::NEG_Z * 36.0, Vec3::Y * 6.2);
    rest.rectangle(low, Vec3::X * 5.4, Vec3::Y * 6.2);
    rest.rectangle(high - Vec3::Y * 6.2, Vec3::NEG_X * 5.4, Vec3::Y * 6.2);
    rest.rectangle(low + Vec3::Y * 6.2, Vec3::X * 5.4, Vec3::Z * 36.0);
    rest.rectangle(
        Vec3::new(-28.2, 7.0, 18.2),
        Vec3::X * 6.2,
        Vec3::NEG_Z * 36.4,
    );
    // The outside, seen from the streets and by the sun.
    rest.rectangle(Vec3::new(-28.2, 0.0, 18.2), Vec3::X * 6.2, Vec3::Y * 7.0);
    rest.rectangle(
        Vec3::new(-22.0, 0.0, -18.2),
        Vec3::NEG_X * 6.2,
        Vec3::Y * 7.0,
    );
    rest.rectangle(Vec3::new(-28.2, 0.0, -18.2), Vec3::Z * 36.4, Vec3::Y * 7.0);
    for z in [-18.0, 18.2] {
        rest.rectangle(Vec3::new(-22.0, 0.0, z), Vec3::NEG_Z * 0.2, Vec3::Y * 7.0);
    }
    build.object("market hall", &rest, m.stucco[0]);
    let mut frieze = Shape::default();
    attached(
        &mut frieze,
        Vec3::new(0.05, 5.29, 0.0),
        Vec3::new(35.95, 5.8, 1.0),
    );
    attached(
        &mut frieze,
        Vec3::new(0.05, 6.6, 0.0),
        Vec3::new(35.95, 7.1, 0.5),
    );
    let mesh = build.mesh("entablature", &[(&frieze, m.stone)]);
    build.place(
        "entablature",
        mesh,
        Vec3::new(-22.0, 0.0, 18.0),
        turned(90.0),
        Vec3::ONE,
    );

    let mut profile = vec![[0.42, 0.0], [0.42, 0.15]];
    profile.extend(curve(
        &[[0.4, 0.15], [0.43, 0.22], [0.35, 0.3], [0.33, 0.36]],
        3,
    ));
    profile.extend(
        (0..=10)
            .map(|i| i as f32 / 10.0)
            .map(|t| [0.32 - 0.05 * t * t, 0.4 + 4.3 * t]),
    );
    profile.extend(curve(
        &[[0.27, 4.75], [0.3, 4.9], [0.4, 5.1], [0.42, 5.2]],
        3,
    ));
    profile.push([0.42, 5.3]);
    let column = build.mesh("column", &[(&lathe(&profile, 30), m.stone)]);
    for n in 0..10 {
        build.place(
            "column",
            column,
            Vec3::new(-21.5, 0.0, 18.0 - 4.0 * n as f32),
            Quat::IDENTITY,
            Vec3::ONE,
        );
    }
    let mut shade = shade();
    shade.append(&tube(&[Vec3::Y * 0.24, Vec3::Y * 1.9], &[0.015], 6, false));
    let shade = build.mesh("pendant", &[(&shade, m.iron)]);
    for n in 0..8 {
        let at = Vec3::new(-25.3, 4.2, 14.0 - 4.0 * n as f32);
        build.place("pendant", shade, at, Quat::IDENTITY, Vec3::ONE);
        build.point(
            "pendant lamp",
            at + Vec3::Y * 0.03,
            Glow {
                color: [1.0, 0.74, 0.45],
                intensity: 220.0,
            },
        );
    }
}

pub(super) fn fountain(build: &mut Builder, m: &Materials) {
    let rim = [
        [4.2, 0.0],
        [4.2, 0.18],
        [3.9, 0.2],
        [3.8, 0.35],
        [3.75, 0.6],
        [3.95, 0.7],
        [3.95, 0.82],
        [3.6, 0.84],
        [3.5, 0.7],
        [3.4, 0.42],
    ];
    build.object("fountain basin", &lathe(&curve(&rim, 4), 56), m.stone);
    build.object(
        "fountain water",
        &lathe(&[[3.45, 0.5], [0.0, 0.5]], 72),
        m.water,
    );
    let stem = [
        [0.9, 0.3],
        [0.8, 0.7],
        [0.4, 0.9],
        [0.32, 1.5],
        [0.5, 1.75],
        [1.4, 2.0],
        [1.9, 2.25],
        [1.88, 2.32],
        [1.7, 2.26],
        [1.0, 2.1],
        [0.3, 2.1],
        [0.26, 2.7],
        [0.42, 2.9],
        [0.4, 2.96],
        [0.0, 2.96],
    ];
    build.object("fountain stem", &lathe(&curve(&stem, 4), 48), m.stone);
    let figure = bust_of_a_founder();
    build.object("founder", &figure.at(0.0, 2.96, 0.0), m.bronze);
}

/// The museum's bust, twice its size, turned to the camera.
fn bust_of_a_founder() -> Shape {
    let turn = turned(40.0);
    bust(1, 3).transformed(Affine3A::from_scale_rotation_translation(
        Vec3::splat(2.2),
        turn,
        Vec3::ZERO,
    ))
}

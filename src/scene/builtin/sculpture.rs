//! What stands in the museum: vases, busts, free forms, a skeleton. All stand on y = 0 and are a metre or so tall.

use glam::{Affine3A, Quat, Vec3};

use super::{
    enclosures::icosphere,
    shape::Shape,
    turning::{cos, curve, lathe, sin, tube},
};

/// A vase: a smooth profile of (radius, height), its lip turned in.
pub(super) fn vase(kind: usize, segments: u32) -> Shape {
    let profile: &[[f32; 2]] = match kind {
        0 => &[
            [0.1, 0.0],
            [0.13, 0.04],
            [0.24, 0.3],
            [0.22, 0.5],
            [0.09, 0.66],
            [0.12, 0.76],
            [0.15, 0.8],
            [0.13, 0.8],
            [0.08, 0.7],
            [0.0, 0.66],
        ],
        1 => &[
            [0.12, 0.0],
            [0.09, 0.06],
            [0.07, 0.12],
            [0.2, 0.3],
            [0.27, 0.46],
            [0.26, 0.52],
            [0.23, 0.5],
            [0.1, 0.34],
            [0.0, 0.3],
        ],
        _ => &[
            [0.07, 0.0],
            [0.05, 0.03],
            [0.19, 0.36],
            [0.2, 0.52],
            [0.07, 0.7],
            [0.06, 0.84],
            [0.1, 0.9],
            [0.09, 0.91],
            [0.05, 0.84],
            [0.0, 0.8],
        ],
    };
    lathe(&curve(profile, 8), segments)
}

/// A small amphora with two handles, 35 cm tall.
pub(super) fn amphora() -> Shape {
    let body = [
        [0.03, 0.0],
        [0.05, 0.01],
        [0.1, 0.16],
        [0.09, 0.22],
        [0.035, 0.27],
        [0.04, 0.34],
        [0.05, 0.35],
        [0.03, 0.33],
        [0.0, 0.3],
    ];
    let mut shape = lathe(&curve(&body, 5), 48);
    for side in [-1.0, 1.0] {
        let path = [
            [0.03, 0.325, 0.0],
            [0.1, 0.32, 0.0],
            [0.12, 0.26, 0.0],
            [0.085, 0.2, 0.0],
        ]
        .map(|[x, y, z]: [f32; 3]| [side * x, y, z]);
        let path: Vec<Vec3> = curve(&path, 5).into_iter().map(Vec3::from).collect();
        shape.append(&tube(&path, &[0.008], 8, false));
    }
    shape
}

/// A head and shoulders, 60 cm tall, looking along +Z; the head has 20 * 4^`levels` triangles.
pub(super) fn bust(variant: u32, levels: u32) -> Shape {
    let v = variant as f32;
    let head = icosphere(levels).bent(|p, n| {
        // A bump of the given height and width around a direction.
        let bump = |x: f32, y: f32, z: f32, width: f32, height: f32| {
            let d = p.distance_squared(Vec3::new(x, y, z).normalize());
            n * height * f64::from(-d / (width * width)).exp() as f32
        };
        let mirrored = |x: f32, y: f32, z: f32, width: f32, height: f32| {
            bump(x, y, z, width, height) + bump(-x, y, z, width, height)
        };
        let curls = if p.y > 0.25 - 0.3 * p.z && p.z < 0.75 {
            0.035 * sin(19.0 * p.x + v) * sin(17.0 * p.y) * sin(18.0 * p.z + v)
        } else {
            0.0
        };
        let face = bump(0.0, -0.08, 1.0, 0.16, 0.2 + 0.03 * v)
            + bump(0.0, 0.08, 1.0, 0.13, 0.1)
            + mirrored(0.34, 0.16, 0.9, 0.17, -0.12)
            + mirrored(0.33, 0.32, 0.9, 0.2, 0.06)
            + bump(0.0, -0.42, 0.95, 0.2, 0.06)
            + bump(0.0, -0.75, 0.75, 0.3, 0.16)
            + mirrored(1.0, 0.0, -0.05, 0.2, 0.1);
        let narrow = 1.0 - 0.22 * (-p.y).max(0.0);
        (p * (1.0 + curls) + face) * Vec3::new(0.093 * narrow, 0.135, 0.115) + Vec3::Y * 0.46
    });
    let body = [
        [0.09, 0.0],
        [0.1, 0.02],
        [0.07, 0.05],
        [0.12, 0.12],
        [0.155, 0.2],
        [0.14, 0.25],
        [0.07, 0.29],
        [0.055, 0.33],
        [0.05, 0.4],
    ];
    let mut shape = lathe(&curve(&body, 5), 48).bent(|p, _| {
        let broad = 1.0 + 0.75 * (-((p.y - 0.2) / 0.09).powi(2) * 1.0).exp();
        Vec3::new(p.x * broad, p.y, p.z * (0.6 + 0.4 * broad.recip()))
    });
    shape.append(&head);
    shape
}

/// A smooth free form of the kind that Arp and Moore made.
pub(super) fn free_form(variant: u32) -> Shape {
    let v = variant as f32;
    icosphere(5).bent(|p, _| {
        let swell = 1.0
            + 0.28 * sin(2.3 * p.x + 1.7 * p.y + v)
            + 0.22 * sin(3.1 * p.y - 2.0 * p.z + 2.0 * v)
            + 0.12 * sin(4.7 * p.z + 3.0 * p.x);
        // Flattened below, so that it stands.
        let q = p * swell * Vec3::new(0.26, 0.42, 0.24);
        Vec3::new(q.x, q.y.max(-0.36) + 0.36 - 0.001 * p.y, q.z)
    })
}

/// A trefoil knot on a small block.
pub(super) fn knot(steps: u32) -> Shape {
    let path: Vec<Vec3> = (0..steps)
        .map(|i| {
            let t = i as f32 / steps as f32 * std::f32::consts::TAU;
            let r = 0.2 + 0.09 * cos(3.0 * t);
            Vec3::new(
                r * cos(2.0 * t),
                r * sin(2.0 * t) + 0.46,
                0.1 * sin(3.0 * t),
            )
        })
        .collect();
    let mut shape = tube(&path, &[0.045], 24, true);
    shape.standing_box(Vec3::new(-0.15, 0.0, -0.1), Vec3::new(0.15, 0.14, 0.1));
    shape
}

/// The centrepiece: a sphere of 1.1 m radius, ribbed like a shell.
pub(super) fn shell() -> Shape {
    icosphere(6).bent(|p, n| {
        let angle = f64::from(p.z).atan2(f64::from(p.x)) as f32;
        let ribs = 0.05 * sin(14.0 * angle + 9.0 * p.y) * (1.0 - p.y * p.y);
        let swirl = 0.06 * sin(6.0 * p.y + 2.0 * angle);
        (n * (1.1 + ribs + swirl * (1.0 - p.y * p.y))) + Vec3::Y * 1.05
    })
}

/// A fluted column of the given height with base and capital, 45 cm in radius.
pub(super) fn column(height: f32) -> Shape {
    let top = height - 0.6;
    let mut profile = vec![[0.62, 0.0], [0.62, 0.12], [0.6, 0.12]];
    profile.extend(curve(
        &[
            [0.6, 0.12],
            [0.63, 0.18],
            [0.55, 0.26],
            [0.56, 0.33],
            [0.5, 0.4],
        ],
        3,
    ));
    profile.extend((0..=20).map(|i| {
        let t = i as f32 / 20.0;
        [0.45 - 0.06 * t * t, 0.45 + (top - 0.45) * t]
    }));
    profile.extend(curve(
        &[
            [0.42, top + 0.05],
            [0.4, top + 0.12],
            [0.5, top + 0.3],
            [0.58, top + 0.42],
        ],
        3,
    ));
    profile.extend([[0.66, top + 0.42], [0.66, height]]);
    lathe(&profile, 96).bent(|p, _| {
        let angle = f64::from(p.z).atan2(f64::from(p.x)) as f32;
        let fluted = p.y > 0.45 && p.y < top;
        let depth = if fluted {
            0.03 * (cos(24.0 * angle) - 1.0)
        } else {
            0.0
        };
        let r = p.x.hypot(p.z);
        Vec3::new(p.x * (1.0 + depth / r), p.y, p.z * (1.0 + depth / r))
    })
}

/// The skeleton of a long-necked dinosaur, 9 m along X, its head at +X.
pub(super) fn skeleton() -> Shape {
    let mut shape = Shape::default();
    let spine: Vec<Vec3> = curve(
        &[
            [-4.5, 0.5, 0.3],
            [-3.2, 1.0, 0.15],
            [-1.6, 1.8, 0.0],
            [0.0, 2.2, 0.0],
            [1.3, 2.1, 0.0],
            [2.4, 2.7, 0.0],
            [3.4, 3.6, 0.1],
            [4.2, 3.8, 0.25],
        ],
        9,
    )
    .into_iter()
    .map(Vec3::from)
    .collect();
    let bone = icosphere(2);
    for (i, joint) in spine.iter().enumerate() {
        let along = spine[(i + 1).min(spine.len() - 1)] - spine[i.saturating_sub(1)];
        let turn = Quat::from_rotation_arc(Vec3::X, along.normalize());
        let body = 1.0 - ((i as f32 - 30.0) / 34.0).abs();
        let size = 0.05 + 0.07 * body.max(0.0);
        shape.append(
            &bone
                .clone()
                .transformed(Affine3A::from_scale_rotation_translation(
                    Vec3::new(0.8, 1.0, 1.0) * size,
                    turn,
                    *joint,
                )),
        );
        let spike = [*joint, *joint + Vec3::Y * (size * 2.6)];
        shape.append(&tube(&spike, &[size * 0.4, size * 0.12], 6, false));
        if (19..=37).contains(&i) {
            let drop = 1.05 * (1.0 - ((i as f32 - 28.0) / 12.0).powi(2)) + 0.15;
            for side in [-1.0, 1.0] {
                let rib = [
                    [0.0, 0.0, 0.0],
                    [0.02, -0.1 * drop, 0.42 * drop],
                    [0.05, -0.6 * drop, 0.55 * drop],
                    [0.1, -1.05 * drop, 0.28 * drop],
                ];
                let path: Vec<Vec3> = curve(&rib, 5)
                    .into_iter()
                    .map(|[x, y, z]| *joint + Vec3::new(x, y, z * side))
                    .collect();
                let radii: Vec<f32> = (0..path.len())
                    .map(|i| 0.036 * (1.0 - (i as f32 / 15.2).powi(6)))
                    .collect();
                shape.append(&tube(&path, &radii, 8, false));
            }
        }
    }
    let mut limb = |points: &[[f32; 3]]| {
        for joint in points {
            shape.append(
                &bone
                    .clone()
                    .transformed(Affine3A::from_scale_rotation_translation(
                        Vec3::splat(0.115),
                        Quat::IDENTITY,
                        Vec3::from(*joint),
                    )),
            );
        }
        for pair in points.windows(2) {
            let path: Vec<Vec3> = curve(pair, 8).into_iter().map(Vec3::from).collect();
            // Thick at the joints, thin between them.
            let radii: Vec<f32> = (0..path.len())
                .map(|i| 0.05 + 0.05 * (i as f32 / 4.0 - 1.0).powi(2))
                .collect();
            shape.append(&tube(&path, &radii, 12, false));
        }
    };
    for side in [-1.0, 1.0] {
        limb(&[
            [-0.9, 1.9, 0.3 * side],
            [-0.5, 1.1, 0.55 * side],
            [-0.9, 0.5, 0.55 * side],
            [-0.8, 0.0, 0.55 * side],
        ]);
        limb(&[
            [1.5, 1.9, 0.4 * side],
            [1.2, 1.15, 0.55 * side],
            [1.55, 0.5, 0.55 * side],
            [1.5, 0.0, 0.55 * side],
        ]);
    }
    let skull = icosphere(4).bent(|p, n| {
        let sockets = [-1.0, 1.0].map(|side| {
            f64::from(-p.distance_squared(Vec3::new(-0.1, 0.5, 0.85 * side).normalize()) / 0.06)
                .exp() as f32
        });
        let snout = 0.55 + 0.45 * (0.5 - 0.5 * p.x);
        (p - n * 0.35 * (sockets[0] + sockets[1])) * Vec3::new(0.42, 0.17 * snout, 0.16 * snout)
            + Vec3::new(4.5, 3.75, 0.27)
    });
    shape.append(&skull);
    shape
}

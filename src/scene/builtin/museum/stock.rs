//! The meshes that many nodes of the museum share, and the materials.

use glam::{Affine3A, Quat, Vec2, Vec3};

use super::HALL_HEIGHT;
use crate::scene::builtin::{
    build::{Builder, chance},
    sculpture::{amphora, bust, column, free_form, knot, vase},
    shape::Shape,
    turning::{curve, lathe, sin, tube},
};

/// The meshes that many nodes share, and the materials.
pub(super) struct Stock {
    pub paint: [usize; 3],
    pub plaster: usize,
    pub parquet: usize,
    pub marble: usize,
    pub white: usize,
    pub wood: usize,
    /// Each with the name of its kind.
    pub sculptures: Vec<(&'static str, usize)>,
    pub plinth: usize,
    pub paintings: Vec<usize>,
    pub fixture: usize,
    pub panel: usize,
    pub showcase: usize,
    pub amphora: usize,
    pub bench: usize,
    pub stanchion: usize,
    pub rope: usize,
    pub column: usize,
}

impl Stock {
    pub fn new(build: &mut Builder) -> Self {
        let stone = build.material("limestone", [0.62, 0.58, 0.5]);
        let white = build.material("white marble", [0.78, 0.77, 0.74]);
        let bronze = build.material("bronze", [0.3, 0.2, 0.11]);
        let clay = build.material("terracotta", [0.55, 0.24, 0.13]);
        let glaze = build.material("blue glaze", [0.12, 0.22, 0.45]);
        let black = build.material("black metal", [0.05, 0.05, 0.05]);
        let gold = build.material("gilding", [0.62, 0.45, 0.18]);
        let red = build.material("red rope", [0.5, 0.03, 0.04]);
        let wood = build.material("oak", [0.36, 0.22, 0.12]);
        let parquet = build.textured("parquet", 64, |x, y| {
            // Blocks of eight boards, each block laid across its neighbours.
            let (across, along) = if (x / 32 + y / 32) % 2 == 0 {
                (x, y)
            } else {
                (y, x)
            };
            let board = across / 8 + 8 * (x / 32 + 2 * (y / 32));
            let grain = (chance(1, board) * 50.0 + chance(2, along + 64 * board) * 12.0) as u8;
            if across % 8 == 0 {
                [96, 62, 38]
            } else {
                [150 + grain, 104 + grain, 66 + grain / 2]
            }
        });
        let marble = build.textured("marble tiles", 64, |x, y| {
            let vein = (chance(3, x / 2 + 32 * (y / 2)) * 14.0) as u8;
            if (x / 32 + y / 32) % 2 == 0 {
                [212 + vein, 208 + vein, 198 + vein]
            } else {
                [86 + vein, 82 + vein, 84 + vein]
            }
        });
        let lamp = build.emitter("ceiling light", [0.8; 3], [1.0, 0.93, 0.82], 1500.0);
        let case_lamp = build.emitter("showcase light", [0.8; 3], [1.0, 0.97, 0.92], 600.0);

        let mut sculptures = Vec::new();
        for kind in 0..3 {
            sculptures.push((
                "vase",
                build.mesh("vase", &[(&vase(kind, 91), [clay, glaze, clay][kind])]),
            ));
        }
        for kind in 0..2 {
            sculptures.push((
                "bust",
                build.mesh("bust", &[(&bust(kind, 5), [white, bronze][kind as usize])]),
            ));
        }
        for kind in 0..2 {
            sculptures.push((
                "free form",
                build.mesh(
                    "free form",
                    &[(&free_form(kind), [bronze, white][kind as usize])],
                ),
            ));
        }
        sculptures.push(("knot", build.mesh("knot", &[(&knot(256), bronze)])));

        let mut plinth = Shape::default();
        plinth.standing_box(Vec3::new(-0.32, 0.0, -0.32), Vec3::new(0.32, 1.0, 0.32));
        let paintings = (0..6).map(|kind| painting(build, gold, kind)).collect();
        let can = lathe(
            &[
                [0.0, 0.02],
                [0.05, 0.02],
                [0.055, 0.13],
                [0.04, 0.17],
                [0.0, 0.18],
            ],
            24,
        );
        let to_back = Affine3A::from_quat(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
        let mut housing = Shape::default();
        housing.standing_box(Vec3::new(-0.6, 0.0, -0.3), Vec3::new(0.6, 0.06, 0.3));
        let mut light = Shape::default();
        light.rectangle(Vec3::new(-0.6, 0.0, -0.3), Vec3::X * 1.2, Vec3::Z * 0.6);
        let mut bench = Shape::default();
        bench.block(Vec3::new(-0.9, 0.4, -0.25), Vec3::new(0.9, 0.48, 0.25));
        for (x, z) in [(-0.8, -0.18), (0.74, -0.18), (-0.8, 0.12), (0.74, 0.12)] {
            bench.standing_box(Vec3::new(x, 0.0, z), Vec3::new(x + 0.06, 0.44, z + 0.06));
        }
        let post = lathe(
            &curve(
                &[
                    [0.16, 0.0],
                    [0.15, 0.02],
                    [0.03, 0.05],
                    [0.025, 0.5],
                    [0.03, 0.9],
                    [0.05, 0.95],
                    [0.0, 1.0],
                ],
                3,
            ),
            24,
        );
        let sag: Vec<Vec3> = (0..=16)
            .map(|i| i as f32 / 16.0)
            .map(|t| Vec3::new(t * 1.4, 0.85 - t * (1.0 - t), 0.0))
            .collect();
        let (case, case_light) = showcase();
        Self {
            paint: [[0.42, 0.12, 0.1], [0.16, 0.27, 0.2], [0.66, 0.6, 0.48]]
                .map(|albedo| build.material("wall paint", albedo)),
            plaster: build.material("plaster", [0.8, 0.79, 0.76]),
            parquet,
            marble,
            white,
            wood,
            sculptures,
            plinth: build.mesh("plinth", &[(&plinth, stone)]),
            paintings,
            fixture: build.mesh("spot fixture", &[(&can.transformed(to_back), black)]),
            panel: build.mesh("ceiling panel", &[(&housing, black), (&light, lamp)]),
            showcase: build.mesh("showcase", &[(&case, wood), (&case_light, case_lamp)]),
            amphora: build.mesh("amphora", &[(&amphora(), clay)]),
            bench: build.mesh("bench", &[(&bench, wood)]),
            stanchion: build.mesh("stanchion", &[(&post, gold)]),
            rope: build.mesh("rope", &[(&tube(&sag, &[0.02], 8, false), red)]),
            column: build.mesh("column", &[(&column(HALL_HEIGHT), stone)]),
        }
    }
}

/// A framed picture, its back on z = 0 and its middle at the origin: 1.5 m x 1.1 m outside.
fn painting(build: &mut Builder, frame: usize, kind: u32) -> usize {
    let art = build.textured("painting", 32, |x, y| {
        let (u, v) = (x as f32 / 31.0, y as f32 / 31.0);
        let k = kind as f32;
        let (sky, land) = (
            [90.0 + 20.0 * k, 120.0 + 8.0 * k, 170.0 - 12.0 * k],
            [70.0 + 15.0 * k, 80.0 - 4.0 * k, 40.0 + 9.0 * k],
        );
        let hill = 0.55 + 0.15 * sin(u * (4.0 + k) + k) + 0.04 * sin(u * 23.0);
        let sun = Vec2::new(u - 0.2 - 0.1 * k, v - 0.25).length() < 0.1;
        let base = if sun {
            [235.0, 200.0, 120.0]
        } else if v < hill {
            sky
        } else {
            land
        };
        base.map(|c: f32| (c + 26.0 * (chance(kind + 10, x + 32 * y) - 0.5)) as u8)
    });
    let mut shape = Shape::default();
    let rings = [
        (0.0, 0.0),
        (0.0, 0.05),
        (0.05, 0.08),
        (0.09, 0.06),
        (0.12, 0.03),
    ];
    let corner = |(inset, z): (f32, f32), i: usize| {
        let (x, y) = (0.75 - inset, 0.55 - inset);
        Vec3::new([-x, x, x, -x][i % 4], [-y, -y, y, y][i % 4], z)
    };
    for pair in rings.windows(2) {
        for i in 0..4 {
            shape.polygon(&[
                corner(pair[0], i),
                corner(pair[0], i + 1),
                corner(pair[1], i + 1),
                corner(pair[1], i),
            ]);
        }
    }
    let mut canvas = Shape::default();
    canvas.polygon(&std::array::from_fn::<_, 4, _>(|i| corner(rings[4], i)));
    canvas.uvs = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]
        .map(Vec2::from)
        .to_vec();
    build.mesh("painting", &[(&shape, frame), (&canvas, art)])
}

/// A table with four posts and a lid that shines down on what lies on it. No glass: transport is diffuse.
fn showcase() -> (Shape, Shape) {
    let mut case = Shape::default();
    case.standing_box(Vec3::new(-0.75, 0.0, -0.4), Vec3::new(0.75, 0.9, 0.4));
    for (x, z) in [(-0.74, -0.39), (0.71, -0.39), (-0.74, 0.36), (0.71, 0.36)] {
        for (corner, along) in [
            (Vec3::new(x, 0.9, z), 0.0),
            (Vec3::new(x + 0.03, 0.9, z + 0.03), 1.0),
        ] {
            let side = if along == 0.0 { 0.03 } else { -0.03 };
            case.rectangle(corner, Vec3::Y * 0.6, Vec3::X * side);
            case.rectangle(corner, Vec3::Z * side, Vec3::Y * 0.6);
        }
    }
    case.standing_box(Vec3::new(-0.75, 1.5, -0.4), Vec3::new(0.75, 1.56, 0.4));
    let mut light = Shape::default();
    light.rectangle(Vec3::new(-0.75, 1.5, -0.4), Vec3::X * 1.5, Vec3::Z * 0.8);
    (case, light)
}

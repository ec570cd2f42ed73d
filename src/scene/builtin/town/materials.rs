//! What the town is made of.

use crate::scene::builtin::build::{Builder, chance};

pub(super) struct Materials {
    pub stucco: [usize; 4],
    pub brick: usize,
    pub stone: usize,
    pub paving: usize,
    pub tiles: usize,
    pub wood: usize,
    pub green: usize,
    pub glass: usize,
    pub shop: usize,
    pub iron: usize,
    pub globe: usize,
    pub bark: usize,
    pub leaves: usize,
    pub water: usize,
    pub bronze: usize,
    pub cloth: [usize; 2],
    pub fruit: usize,
    pub clay: usize,
}

impl Materials {
    pub fn new(build: &mut Builder) -> Self {
        let stucco = [
            [0.66, 0.52, 0.33],
            [0.62, 0.38, 0.28],
            [0.6, 0.6, 0.52],
            [0.48, 0.52, 0.56],
        ]
        .map(|albedo| build.material("stucco", albedo));
        let brick = build.textured("brick", 64, |x, y| {
            let row = y / 8;
            let shifted = x + 8 * (row % 2);
            let joint = y % 8 == 0 || shifted % 16 == 0;
            let shade = (chance(30, (shifted / 16) % 4 + 4 * row) * 46.0
                + chance(31, x + 64 * y) * 10.0) as u8;
            if joint {
                [186, 178, 164]
            } else {
                [136 + shade, 72 + shade / 2, 56 + shade / 3]
            }
        });
        let paving = build.textured("paving", 64, |x, y| {
            let row = y / 16;
            let shifted = x + 8 * (row % 2);
            let shade = (chance(32, (shifted / 16) % 4 + 4 * row) * 34.0
                + chance(33, x + 64 * y) * 14.0) as u8;
            if y % 16 == 0 || shifted % 16 == 0 {
                [92, 86, 78]
            } else {
                [140 + shade, 132 + shade, 120 + shade]
            }
        });
        let wood = build.textured("planks", 32, |x, y| {
            let grain = (chance(34, x / 8 + 8 * (y / 4)) * 30.0) as u8;
            if x % 8 == 0 {
                [58, 38, 24]
            } else {
                [112 + grain, 78 + grain, 50 + grain]
            }
        });
        let cloth = [[200, 40, 36], [40, 96, 150]].map(|stripe| {
            build.textured("awning cloth", 16, |x, _| {
                if x / 8 == 0 { stripe } else { [226, 220, 206] }
            })
        });
        cloth.iter().for_each(|cloth| build.both_sides(*cloth));
        Self {
            stucco,
            brick,
            stone: build.material("sandstone", [0.6, 0.53, 0.42]),
            paving,
            tiles: build.material("roof tiles", [0.45, 0.17, 0.1]),
            wood,
            green: build.material("shutter green", [0.1, 0.25, 0.16]),
            glass: build.material("window glass", [0.06, 0.07, 0.08]),
            shop: build.emitter("lit shop window", [0.3; 3], [1.0, 0.72, 0.4], 350.0),
            iron: build.material("cast iron", [0.05, 0.055, 0.05]),
            globe: build.emitter("lamp globe", [0.8; 3], [1.0, 0.78, 0.5], 4500.0),
            bark: build.material("bark", [0.2, 0.15, 0.1]),
            leaves: build.material("leaves", [0.12, 0.26, 0.06]),
            water: build.material("water", [0.12, 0.22, 0.25]),
            bronze: build.material("bronze", [0.22, 0.3, 0.22]),
            cloth,
            fruit: build.material("oranges", [0.75, 0.32, 0.04]),
            clay: build.material("terracotta", [0.55, 0.26, 0.14]),
        }
    }
}

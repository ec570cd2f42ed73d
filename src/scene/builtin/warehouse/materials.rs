//! What the warehouse is made of.

use crate::scene::builtin::build::{Builder, chance};

pub(super) struct Materials {
    pub concrete: usize,
    pub cladding: usize,
    pub steel: usize,
    pub blue: usize,
    pub orange: usize,
    pub yellow: usize,
    pub black: usize,
    pub pallet: usize,
    pub carton: usize,
    pub tape: usize,
    pub drum: usize,
    pub sack: usize,
    pub film: usize,
    pub plaster: usize,
    pub high_bay: usize,
    pub panel: usize,
}

impl Materials {
    pub fn new(build: &mut Builder) -> Self {
        Self {
            concrete: build.textured("concrete floor", 64, |x, y| {
                let grey =
                    128.0 + 16.0 * chance(60, x + 64 * y) + 10.0 * chance(61, x / 8 + 8 * (y / 8))
                        - if x == 0 || y == 0 { 36.0 } else { 0.0 };
                [grey as u8, grey as u8, (grey * 0.97) as u8]
            }),
            cladding: build.material("wall cladding", [0.55, 0.58, 0.6]),
            steel: build.material("galvanized steel", [0.45, 0.46, 0.47]),
            blue: build.material("blue uprights", [0.05, 0.13, 0.4]),
            orange: build.material("orange beams", [0.75, 0.24, 0.03]),
            yellow: build.material("yellow paint", [0.75, 0.5, 0.04]),
            black: build.material("rubber", [0.04, 0.04, 0.04]),
            pallet: build.textured("pallet wood", 32, |x, y| {
                let grain = (chance(62, x / 2 + 16 * (y / 16)) * 36.0) as u8;
                [158 + grain, 126 + grain, 86 + grain / 2]
            }),
            carton: build.textured("cardboard", 32, |x, y| {
                let print = (4..12).contains(&x) && (18..26).contains(&y) && (x + y) % 3 != 0;
                let flute = (chance(63, y) * 12.0) as u8;
                if print {
                    [70, 52, 40]
                } else {
                    [170 + flute, 126 + flute, 84 + flute / 2]
                }
            }),
            tape: build.material("tape", [0.5, 0.36, 0.2]),
            drum: build.material("blue drums", [0.04, 0.16, 0.45]),
            sack: build.material("paper sacks", [0.66, 0.6, 0.48]),
            film: build.material("wrapped goods", [0.62, 0.66, 0.68]),
            plaster: build.material("plaster", [0.76, 0.75, 0.7]),
            high_bay: build.emitter("high-bay lamp", [0.7; 3], [0.95, 0.98, 1.0], 32_000.0),
            panel: build.emitter("office panel", [0.8; 3], [1.0, 0.95, 0.86], 2500.0),
        }
    }
}

//! The walls of the museum, their doorways, and the paintings on them.

use glam::Vec3;

use super::{GRID, HALF, HALL_HEIGHT, ROOM_HEIGHT, stock::Stock};
use crate::scene::builtin::{
    build::{Builder, Glow, turned},
    masonry::{Opening, wall},
    shape::Shape,
};

/// A wall's transform: its left end (seen from its front), on the floor, and the direction it faces in quarter turns from +Z.
struct Face {
    left: Vec3,
    quarter: i32,
    width: f32,
    paint: usize,
}

impl Face {
    fn place(&self, build: &mut Builder, name: &str, shape: &Shape) {
        let mesh = build.mesh(name, &[(shape, self.paint)]);
        build.place(
            name,
            mesh,
            self.left,
            turned(90.0 * self.quarter as f32),
            Vec3::ONE,
        );
    }

    /// Hangs paintings at distances from the left end, each with its spot.
    fn hang(&self, build: &mut Builder, stock: &Stock, from_left: &[f32], seed: usize) {
        let rotation = turned(90.0 * self.quarter as f32);
        for (n, x) in from_left.iter().enumerate() {
            let at = self.left + rotation * Vec3::new(*x, 1.7, 0.0);
            let picture = stock.paintings[(seed * 5 + n * 7) % stock.paintings.len()];
            build.place("painting", picture, at, rotation, Vec3::ONE);
            let lamp = self.left + rotation * Vec3::new(*x, ROOM_HEIGHT - 0.6, 1.7);
            let glow = Glow {
                color: [1.0, 0.92, 0.8],
                intensity: 900.0,
            };
            build.spot(
                "painting spot",
                [lamp, at],
                glow,
                [0.22, 0.4],
                Some(stock.fixture),
            );
        }
    }
}

/// The outer walls, and those between rooms with their doorways.
pub(super) fn walls(build: &mut Builder, stock: &Stock) {
    for k in 0..3 {
        let (from, to) = (GRID[k] + HALF, GRID[k + 1] - HALF);
        let (low, high) = (GRID[0] + HALF, GRID[3] - HALF);
        let width = to - from;
        let paint = if k == 1 {
            stock.paint[2]
        } else {
            stock.paint[k / 2]
        };
        for (side, left) in [
            Vec3::new(from, 0.0, low),
            Vec3::new(low, 0.0, to),
            Vec3::new(to, 0.0, high),
            Vec3::new(high, 0.0, from),
        ]
        .into_iter()
        .enumerate()
        {
            let face = Face {
                left,
                quarter: side as i32,
                width,
                paint,
            };
            let entrance = k == 1 && side == 2;
            let doors = if entrance {
                vec![doorway(width, 3.0, 3.6, true)]
            } else {
                vec![]
            };
            face.place(
                build,
                "outer wall",
                &wall(width, ROOM_HEIGHT, 0.3, &doors, None),
            );
            if entrance {
                let mut leaf = Shape::default();
                leaf.rectangle(
                    Vec3::new(width / 2.0 - 1.5, 0.0, 0.0),
                    Vec3::X * 3.0,
                    Vec3::NEG_Z * 0.3,
                );
                for (x, z) in [(-1.5, -0.28), (0.02, -0.28)] {
                    leaf.rectangle(
                        Vec3::new(width / 2.0 + x, 0.0, z),
                        Vec3::X * 1.48,
                        Vec3::Y * 3.6,
                    );
                }
                Face {
                    paint: stock.wood,
                    ..face
                }
                .place(build, "entrance doors", &leaf);
                continue_pictures(
                    build,
                    stock,
                    &Face {
                        left,
                        quarter: 2,
                        width,
                        paint,
                    },
                    &[2.0, 4.3, width - 2.0],
                );
            } else {
                let places = [width * 0.2, width * 0.5, width * 0.8];
                continue_pictures(
                    build,
                    stock,
                    &Face {
                        left,
                        quarter: side as i32,
                        width,
                        paint,
                    },
                    &places,
                );
            }
        }
    }
    for line in 0..2 {
        for k in 0..3 {
            for along_x in [true, false] {
                partition(build, stock, line, k, along_x);
            }
        }
    }
}

fn continue_pictures(build: &mut Builder, stock: &Stock, face: &Face, places: &[f32]) {
    face.hang(
        build,
        stock,
        places,
        face.quarter as usize + face.width as usize,
    );
}

/// A doorway in the middle of a wall.
fn doorway(width: f32, opening: f32, height: f32, arched: bool) -> Opening {
    Opening {
        low: [(width - opening) / 2.0, 0.0],
        high: [(width + opening) / 2.0, height],
        arched,
    }
}

/// The wall on grid line `line` + 1, beside cell `k` of the other axis. It faces the hall, or else the larger coordinate.
fn partition(build: &mut Builder, stock: &Stock, line: usize, k: usize, along_x: bool) {
    let (from, to) = (GRID[k] + HALF, GRID[k + 1] - HALF);
    let plane = GRID[line + 1];
    let width = to - from;
    let beside_hall = k == 1;
    // Toward the hall that is the larger side of line 0 and the smaller of line 1.
    let forward = line == 0 || !beside_hall;
    let at = if forward { plane + HALF } else { plane - HALF };
    let (left, quarter) = match (along_x, forward) {
        (true, true) => (Vec3::new(from, 0.0, at), 0),
        (true, false) => (Vec3::new(to, 0.0, at), 2),
        (false, true) => (Vec3::new(at, 0.0, to), 1),
        (false, false) => (Vec3::new(at, 0.0, from), 3),
    };
    let (front, doors) = if beside_hall {
        (HALL_HEIGHT, doorway(width, 3.0, 4.0, true))
    } else {
        (ROOM_HEIGHT, doorway(width, 2.4, 3.2, false))
    };
    let face = Face {
        left,
        quarter,
        width,
        paint: stock.paint[if beside_hall { 2 } else { k / 2 }],
    };
    let mut threshold = Shape::default();
    threshold.rectangle(
        Vec3::new(doors.low[0], 0.0, 0.0),
        Vec3::X * (doors.high[0] - doors.low[0]),
        Vec3::NEG_Z * (2.0 * HALF),
    );
    let masonry = wall(width, front, 2.0 * HALF, &[doors], Some(ROOM_HEIGHT));
    let mesh = build.mesh("wall", &[(&masonry, face.paint), (&threshold, stock.wood)]);
    build.place(
        "wall",
        mesh,
        face.left,
        turned(90.0 * quarter as f32),
        Vec3::ONE,
    );
    if !beside_hall {
        // Two paintings towards the corner room and one towards the room between; which side that is depends on the line.
        let rotation = turned(90.0 * quarter as f32);
        let rear = Face {
            left: left + rotation * Vec3::new(width, 0.0, -2.0 * HALF),
            quarter: quarter + 2,
            width,
            paint: face.paint,
        };
        let (corner, between) = if line == 1 {
            (&face, &rear)
        } else {
            (&rear, &face)
        };
        corner.hang(build, stock, &[width * 0.18, width * 0.82], 3 + k);
        between.hang(build, stock, &[width * 0.82], 5 + k);
    }
}

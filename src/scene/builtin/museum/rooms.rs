//! Floors, ceilings and exhibits of the museum.

use glam::{Quat, Vec3};

use super::{GRID, HALF, HALL_HEIGHT, ROOM_HEIGHT, height, is_hall, stock::Stock};
use crate::scene::builtin::{
    build::{Builder, Glow, chance, turned},
    sculpture::{shell, skeleton},
    shape::Shape,
    turning::{cos, curve, lathe, sin},
};

/// Floor, ceiling, panels and exhibits of one room.
pub(super) fn room(build: &mut Builder, stock: &Stock, i: usize, j: usize) {
    let low = Vec3::new(GRID[i] + HALF, 0.0, GRID[j] + HALF);
    let size = Vec3::new(GRID[i + 1] - HALF, 0.0, GRID[j + 1] - HALF) - low;
    let name = format!("room {}{}", ["a", "b", "c"][i], j + 1);
    let mut floor = Shape::default();
    floor.rectangle(low, Vec3::Z * size.z, Vec3::X * size.x);
    let (material, repeat) = if is_hall(i, j) {
        (stock.marble, 2.0)
    } else {
        (stock.parquet, 1.5)
    };
    build.object(&format!("{name} floor"), &floor.textured(repeat), material);
    let mut ceiling = Shape::default();
    ceiling.rectangle(
        low + Vec3::Y * height(i, j),
        Vec3::X * size.x,
        Vec3::Z * size.z,
    );
    build.object(&format!("{name} ceiling"), &ceiling, stock.plaster);
    let middle = low + size / 2.0;
    if is_hall(i, j) {
        return;
    }
    for (x, z) in [
        (0.0, 0.0),
        (-0.28, -0.28),
        (0.28, -0.28),
        (-0.28, 0.28),
        (0.28, 0.28),
    ] {
        let at = middle + Vec3::new(x * size.x, ROOM_HEIGHT - 0.35, z * size.z);
        build.place("ceiling panel", stock.panel, at, Quat::IDENTITY, Vec3::ONE);
    }
    let corner = i != 1 && j != 1;
    if (i, j) == (1, 0) {
        exhibit_skeleton(build, stock, middle);
        return;
    }
    let places: &[(f32, f32)] = if corner {
        &[
            (-0.27, -0.2),
            (0.27, -0.2),
            (-0.27, 0.24),
            (0.27, 0.24),
            (0.0, -0.3),
        ]
    } else {
        &[(-0.3, -0.28), (0.3, -0.28), (-0.3, 0.28), (0.3, 0.28)]
    };
    for (n, (x, z)) in places.iter().enumerate() {
        let at = middle + Vec3::new(x * size.x, 0.0, z * size.z);
        exhibit(build, stock, 5 * i + 11 * j + n, at);
    }
    let side = if corner {
        Vec3::new(0.0, 0.0, 1.2)
    } else {
        Vec3::new(1.6, 0.0, 1.5)
    };
    exhibit_case(build, stock, middle + side);
    build.place(
        "bench",
        stock.bench,
        middle + Vec3::new(-2.0, 0.0, -0.6),
        turned(90.0),
        Vec3::ONE,
    );
}

/// A sculpture on its plinth under a spot.
fn exhibit(build: &mut Builder, stock: &Stock, n: usize, at: Vec3) {
    let (name, mesh) = stock.sculptures[n * 3 % stock.sculptures.len()];
    build.place("plinth", stock.plinth, at, Quat::IDENTITY, Vec3::ONE);
    build.place(
        name,
        mesh,
        at + Vec3::Y,
        turned(chance(20, n as u32) * 360.0),
        Vec3::ONE,
    );
    let angle = n as f32 * 2.4;
    let lamp = at + Vec3::new(1.6 * cos(angle), ROOM_HEIGHT - 0.6, 1.6 * sin(angle));
    let glow = Glow {
        color: [1.0, 0.9, 0.76],
        intensity: 1400.0,
    };
    build.spot(
        &format!("{name} spot"),
        [lamp, at + Vec3::Y * 1.4],
        glow,
        [0.2, 0.35],
        Some(stock.fixture),
    );
}

fn exhibit_case(build: &mut Builder, stock: &Stock, at: Vec3) {
    build.place("showcase", stock.showcase, at, Quat::IDENTITY, Vec3::ONE);
    for x in [-0.45, 0.0, 0.45] {
        build.place(
            "amphora",
            stock.amphora,
            at + Vec3::new(x, 0.9, 0.0),
            turned(70.0 * x + 20.0),
            Vec3::ONE,
        );
    }
}

/// The dinosaur on its platform, roped off, with four spots.
fn exhibit_skeleton(build: &mut Builder, stock: &Stock, middle: Vec3) {
    let mut platform = Shape::default();
    platform.standing_box(Vec3::new(-4.8, 0.0, -1.4), Vec3::new(4.8, 0.25, 1.4));
    let mesh = build.mesh("platform", &[(&platform, stock.wood)]);
    build.place("platform", mesh, middle, Quat::IDENTITY, Vec3::ONE);
    let bones = build.mesh("dinosaur", &[(&skeleton(), stock.white)]);
    build.place(
        "dinosaur",
        bones,
        middle + Vec3::Y * 0.25,
        Quat::IDENTITY,
        Vec3::ONE,
    );
    for n in 0..4 {
        let x = -4.5 + 3.0 * n as f32;
        let lamp = middle + Vec3::new(x, ROOM_HEIGHT - 0.5, if n % 2 == 0 { 2.6 } else { -2.6 });
        let glow = Glow {
            color: [1.0, 0.9, 0.76],
            intensity: 1800.0,
        };
        build.spot(
            "dinosaur spot",
            [lamp, middle + Vec3::new(x * 0.8, 1.6, 0.0)],
            glow,
            [0.3, 0.5],
            Some(stock.fixture),
        );
    }
    for n in 0..8 {
        let at = middle + Vec3::new(-4.9 + 1.4 * n as f32, 0.0, 2.2);
        build.place("stanchion", stock.stanchion, at, Quat::IDENTITY, Vec3::ONE);
        if n < 7 {
            build.place("rope", stock.rope, at, Quat::IDENTITY, Vec3::ONE);
        }
    }
    exhibit_case(build, stock, middle + Vec3::new(0.0, 0.0, 3.6));
}

/// Columns around the shell in the middle, sculptures in the corners.
pub(super) fn hall(build: &mut Builder, stock: &Stock) {
    for n in 0..12 {
        // 15 degrees off the axes, so that no column stands in a doorway.
        let angle = (n as f32 * 30.0 + 15.0).to_radians();
        let at = Vec3::new(5.4 * cos(angle), 0.0, 5.4 * sin(angle));
        build.place("column", stock.column, at, Quat::IDENTITY, Vec3::ONE);
        let panel = Vec3::new(3.6 * cos(angle), HALL_HEIGHT - 0.5, 3.6 * sin(angle));
        build.place(
            "ceiling panel",
            stock.panel,
            panel,
            turned(-15.0 - 30.0 * n as f32),
            Vec3::ONE,
        );
        let post = Vec3::new(2.7 * cos(angle), 0.0, 2.7 * sin(angle));
        build.place(
            "stanchion",
            stock.stanchion,
            post,
            Quat::IDENTITY,
            Vec3::ONE,
        );
        // From this post to the next: 1.4 m at a radius of 2.7 m.
        build.place(
            "rope",
            stock.rope,
            post,
            turned(-(n as f32 * 30.0 + 15.0) - 105.0),
            Vec3::ONE,
        );
    }
    let base = lathe(
        &curve(
            &[
                [1.5, 0.0],
                [1.48, 0.12],
                [1.1, 0.2],
                [1.0, 0.5],
                [0.9, 0.7],
                [0.6, 0.74],
                [0.0, 0.75],
            ],
            4,
        ),
        96,
    );
    build.object("shell base", &base, stock.white);
    build.object("shell", &shell().at(0.0, 0.7, 0.0), stock.white);
    for n in 0..4 {
        let angle = (n as f32 * 90.0 + 30.0).to_radians();
        let lamp = Vec3::new(4.2 * cos(angle), HALL_HEIGHT - 1.0, 4.2 * sin(angle));
        let glow = Glow {
            color: [1.0, 0.92, 0.8],
            intensity: 6000.0,
        };
        build.spot(
            "shell spot",
            [lamp, Vec3::new(0.0, 1.7, 0.0)],
            glow,
            [0.2, 0.35],
            Some(stock.fixture),
        );
        let (x, z) = ([-6.8, 6.8, 6.8, -6.8][n], [-6.8, -6.8, 6.8, 6.8][n]);
        exhibit(build, stock, 3 * n + 1, Vec3::new(x, 0.0, z));
    }
}

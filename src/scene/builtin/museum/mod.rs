//! A museum of nine rooms around a hall of columns: paintings, busts, vases, showcases and a dinosaur, under spots and panels.

mod rooms;
mod stock;
mod walls;

use glam::Vec3;

use self::{
    rooms::{hall, room},
    stock::Stock,
    walls::walls,
};
use crate::scene::Document;
use crate::scene::builtin::build::Builder;

/// Where the walls' middle planes are, along X and along Z.
const GRID: [f32; 4] = [-20.0, -8.0, 8.0, 20.0];

/// Half a wall's thickness.
const HALF: f32 = 0.2;

const HALL_HEIGHT: f32 = 8.0;

const ROOM_HEIGHT: f32 = 5.0;

/// 1.01 million triangles and 164 lights: 60 spots on paintings, 44 on sculptures, 8 lit showcases, 52 ceiling panels.
pub(super) fn museum() -> Document {
    let mut build = Builder::new("museum");
    let stock = Stock::new(&mut build);
    for i in 0..3 {
        for j in 0..3 {
            room(&mut build, &stock, i, j);
        }
    }
    walls(&mut build, &stock);
    hall(&mut build, &stock);
    build.camera(
        "camera",
        Vec3::new(7.3, 2.1, 4.6),
        Vec3::new(-4.0, 1.7, -3.4),
        1.15,
    );
    build.finish()
}

fn is_hall(i: usize, j: usize) -> bool {
    i == 1 && j == 1
}

fn height(i: usize, j: usize) -> f32 {
    if is_hall(i, j) {
        HALL_HEIGHT
    } else {
        ROOM_HEIGHT
    }
}

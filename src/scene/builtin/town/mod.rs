//! A town square at dusk: houses with shops, a town hall, a colonnade, a fountain, trees, stalls and street lamps.

mod colonnade;
mod furniture;
mod greenery;
mod house;
mod houses;
mod materials;

use glam::Vec3;

use self::materials::Materials;
use crate::scene::Document;
use crate::scene::builtin::{
    build::{Builder, Glow},
    shape::Shape,
};

/// 175 thousand triangles and 35 lights: the sun, 12 street lamps, 6 shop windows, 8 pendants in the colonnade and 8 wall lanterns.
pub(super) fn town_square() -> Document {
    let mut build = Builder::new("town-square");
    let m = Materials::new(&mut build);
    ground(&mut build, &m);
    houses::houses(&mut build, &m);
    colonnade::colonnade(&mut build, &m);
    colonnade::fountain(&mut build, &m);
    greenery::greenery(&mut build, &m);
    furniture::furniture(&mut build, &m);
    build.sun(
        "sun",
        Vec3::new(0.62, -0.55, -0.5),
        Glow {
            color: [1.0, 0.68, 0.42],
            intensity: 900.0,
        },
    );
    build.camera(
        "camera",
        Vec3::new(15.5, 3.2, 14.5),
        Vec3::new(-6.0, 3.4, -8.0),
        1.05,
    );
    build.finish()
}

/// Paving in sixteen pieces, so that each has a sensible lightmap.
fn ground(build: &mut Builder, m: &Materials) {
    for i in 0..4 {
        for j in 0..4 {
            let mut shape = Shape::default();
            let corner = Vec3::new(-34.0 + 17.0 * i as f32, 0.0, -32.0 + 16.0 * j as f32);
            shape.rectangle(corner, Vec3::Z * 16.0, Vec3::X * 17.0);
            build.object("paving", &shape.textured(2.4), m.paving);
        }
    }
}

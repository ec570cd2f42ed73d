//! A warehouse: racks full of pallets, roof trusses, high-bay lamps, an office, a conveyor, docks and fork-lift trucks.

mod goods;
mod hall;
mod machines;
mod materials;
mod office;

use glam::Vec3;

use self::materials::Materials;
use crate::scene::Document;
use crate::scene::builtin::build::Builder;

/// Half the hall's width (X) and depth (Z), and its height at the walls, metres.
const HALF: [f32; 2] = [26.0, 19.0];

/// 349 thousand triangles and 24 lights: 20 high-bay lamps, 2 panels in the office, 2 spots at the docks.
pub(super) fn warehouse() -> Document {
    let mut build = Builder::new("warehouse");
    let m = Materials::new(&mut build);
    hall::hall(&mut build, &m);
    hall::roof(&mut build, &m);
    goods::racks(&mut build, &m);
    office::office(&mut build, &m);
    machines::machines(&mut build, &m);
    build.camera(
        "camera",
        Vec3::new(-22.5, 3.4, 15.5),
        Vec3::new(4.0, 3.2, -4.0),
        1.05,
    );
    build.finish()
}

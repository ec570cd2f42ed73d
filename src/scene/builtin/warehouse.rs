//! A warehouse: racks full of pallets, roof trusses, high-bay lamps, an office, a conveyor, docks and fork-lift trucks.

use glam::{Affine3A, Quat, Vec3};

use super::{
    super::Document,
    build::{Builder, Glow, chance, turned},
    enclosures::icosphere,
    shape::{Opening, Shape, curve, lathe, sin, wall},
};

/// Half the hall's width (X) and depth (Z), and its height at the walls, metres.
const HALF: [f32; 2] = [26.0, 19.0];
const EAVES: f32 = 9.5;
const RIDGE: f32 = 12.0;
/// A rack: bays, metres a bay, levels, metres a level, depth.
const BAYS: u32 = 12;
const BAY: f32 = 2.8;
const LEVELS: u32 = 4;
const LEVEL: f32 = 1.9;
const DEPTH: f32 = 1.1;

/// 349 thousand triangles and 24 lights: 20 high-bay lamps, 2 panels in the office, 2 spots at the docks.
pub(super) fn warehouse() -> Document {
    let mut build = Builder::new("warehouse");
    let m = Materials::new(&mut build);
    hall(&mut build, &m);
    roof(&mut build, &m);
    racks(&mut build, &m);
    office(&mut build, &m);
    machines(&mut build, &m);
    build.camera("camera", Vec3::new(-22.5, 3.4, 15.5), Vec3::new(4.0, 3.2, -4.0), 1.05);
    build.finish()
}

struct Materials {
    concrete: usize,
    cladding: usize,
    steel: usize,
    blue: usize,
    orange: usize,
    yellow: usize,
    black: usize,
    pallet: usize,
    carton: usize,
    tape: usize,
    drum: usize,
    sack: usize,
    film: usize,
    plaster: usize,
    high_bay: usize,
    panel: usize,
}

impl Materials {
    fn new(build: &mut Builder) -> Self {
        Self {
            concrete: build.textured("concrete floor", 64, |x, y| {
                let grey = 128.0 + 16.0 * chance(60, x + 64 * y) + 10.0 * chance(61, x / 8 + 8 * (y / 8)) - if x == 0 || y == 0 { 36.0 } else { 0.0 };
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
                if print { [70, 52, 40] } else { [170 + flute, 126 + flute, 84 + flute / 2] }
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

/// Floor in twelve pieces, ribbed walls that face inward, three docks in the wall at -X.
fn hall(build: &mut Builder, m: &Materials) {
    let [x, z] = HALF;
    for i in 0..4 {
        for j in 0..3 {
            let mut floor = Shape::default();
            let size = Vec3::new(x / 2.0, 0.0, z / 1.5);
            floor.rectangle(Vec3::new(-x + size.x * i as f32, 0.0, -z + size.z * j as f32), Vec3::Z * size.z, Vec3::X * size.x);
            build.object("floor", &floor.textured(4.0), m.concrete);
        }
    }
    let ribs = |width: f32| {
        let waves = (width / 0.4).round();
        // Flat troughs with raised ribs, as rolled steel has.
        let rib = move |u: f32| if (u * waves).fract() > 0.6 { 0.04 } else { 0.0 };
        (waves as u32 * 5, rib)
    };
    for (corner, along) in [(Vec3::new(-x, 2.0, -z), Vec3::X), (Vec3::new(x, 2.0, z), Vec3::NEG_X), (Vec3::new(x, 2.0, -z), Vec3::Z)] {
        let width = 2.0 * if along.x != 0.0 { x } else { z };
        let (cells, rib) = ribs(width);
        let mut cladding = Shape::default();
        cladding.grid(corner, along * width, Vec3::Y * (EAVES - 2.0), [cells, 1], |p| rib(p.x + 1e-4));
        build.object("cladding", &cladding, m.cladding);
        let mut plinth = Shape::default();
        plinth.rectangle(corner - Vec3::Y * 2.0, along * width, Vec3::Y * 2.0);
        build.object("plinth wall", &plinth, m.plaster);
    }
    // The wall at -X faces +X: quarter turn, its left end at +Z.
    let width = 2.0 * z;
    let docks: Vec<Opening> = [6.0f32, 14.0, 22.0].iter().map(|u| Opening { low: [*u, 0.0], high: [u + 4.0, 4.4], arched: false }).collect();
    let mesh = build.mesh("dock wall", &[(&wall(width, EAVES, 0.3, &docks, None), m.plaster)]);
    build.place("dock wall", mesh, Vec3::new(-x, 0.0, z), turned(90.0), Vec3::ONE);
    for dock in &docks {
        let mut door = Shape::default();
        let bulge = |v: f32| 0.03 * sin((v * 9.0).fract() * std::f32::consts::PI).max(0.0);
        door.grid(Vec3::new(dock.low[0], 0.0, -0.25), Vec3::X * 4.0, Vec3::Y * 4.4, [1, 54], |p| bulge(p.y));
        let mut sill = Shape::default();
        sill.rectangle(Vec3::new(dock.low[0], 0.0, 0.0), Vec3::X * 4.0, Vec3::NEG_Z * 0.3);
        let mesh = build.mesh("dock door", &[(&door, m.steel), (&sill, m.plaster)]);
        build.place("dock door", mesh, Vec3::new(-x, 0.0, z), turned(90.0), Vec3::ONE);
    }
    let post = build.mesh("bollard", &[(&lathe(&curve(&[[0.11, 0.0], [0.11, 0.5], [0.11, 0.95], [0.08, 1.05], [0.0, 1.08]], 2), 20), m.yellow)]);
    for u in [5.6f32, 10.4, 13.6, 18.4, 21.6, 26.4] {
        build.place("bollard", post, Vec3::new(-x + 0.7, 0.0, z - u), Quat::IDENTITY, Vec3::ONE);
    }
    for u in [12.0f32, 20.0] {
        let at = Vec3::new(-x + 1.2, 6.5, z - u);
        let glow = Glow { color: [1.0, 0.95, 0.85], intensity: 4000.0 };
        build.spot("dock spot", [at, Vec3::new(-x + 3.5, 0.0, z - u)], glow, [0.6, 0.9], None);
    }
}

/// Two slopes and the gables above the eaves, trusses with their posts, and the high-bay lamps.
fn roof(build: &mut Builder, m: &Materials) {
    let [x, z] = HALF;
    for side in [-1.0f32, 1.0] {
        let mut slope = Shape::default();
        let eaves = Vec3::new(-x * side, EAVES, z * side);
        slope.grid(eaves, Vec3::X * (2.0 * x * side), Vec3::new(0.0, RIDGE - EAVES, -z * side), [130, 1], |_| 0.0);
        build.object("roof", &slope.inverted(), m.cladding);
        let mut gable = Shape::default();
        gable.polygon(&[Vec3::new(x * side, EAVES, -z * side), Vec3::new(x * side, EAVES, z * side), Vec3::new(x * side, RIDGE, 0.0)]);
        build.object("gable", &gable, m.cladding);
    }
    let mut truss = Shape::default();
    let top = |t: f32| Vec3::new(0.0, RIDGE - 0.15 - (RIDGE - EAVES) * t.abs(), t * (z - 0.3));
    let low = |t: f32| Vec3::new(0.0, EAVES - 0.4 + 0.2 * (1.0 - t.abs()), t * (z - 0.3));
    const PANELS: i32 = 8;
    for side in [-1.0, 1.0] {
        // Not quite to the middle, where the two halves would touch.
        truss.bar(top(side), top(0.001 * side), 0.14);
        truss.bar(low(side), low(0.001 * side), 0.12);
    }
    for i in -PANELS..PANELS {
        let (a, b) = (i as f32 / PANELS as f32, (i + 1) as f32 / PANELS as f32);
        truss.bar(low(a), top(a), 0.07);
        truss.bar(if i < 0 { low(a) } else { top(a) }, if i < 0 { top(b) } else { low(b) }, 0.06);
    }
    for side in [-1.0, 1.0] {
        // An I-beam as a post, clear of the wall.
        for (from, to) in [([-0.12, -0.12], [0.12, -0.09]), ([-0.12, 0.09], [0.12, 0.12]), ([-0.015, -0.1], [0.015, 0.1])] {
            let at = Vec3::new(0.0, 0.0, side * (z - 0.4));
            truss.standing_box(at + Vec3::new(from[0], 0.0, from[1]), at + Vec3::new(to[0], EAVES - 0.3, to[1]));
        }
    }
    let truss = build.mesh("truss", &[(&truss, m.steel)]);
    for i in 0..9 {
        build.place("truss", truss, Vec3::new(-24.0 + 6.0 * i as f32, 0.0, 0.0), Quat::IDENTITY, Vec3::ONE);
    }
    let mut purlins = Shape::default();
    for i in 1..6 {
        for side in [-1.0, 1.0] {
            let t = side * (i as f32 / 6.0);
            let at = top(t) + Vec3::Y * 0.03;
            purlins.bar(at - Vec3::X * (x - 0.2), at + Vec3::X * (x - 0.2), 0.08);
        }
    }
    build.object("purlins", &purlins, m.steel);
    let mut housing = lathe(&curve(&[[0.36, 0.0], [0.34, 0.12], [0.2, 0.3], [0.16, 0.42], [0.0, 0.46]], 4), 22);
    housing.bar(Vec3::Y * 0.44, Vec3::Y * 1.3, 0.03);
    let disk = lathe(&[[0.0, 0.03], [0.3, 0.03], [0.36, 0.0]], 22);
    let lamp = build.mesh("high-bay lamp", &[(&housing, m.steel), (&disk, m.high_bay)]);
    for i in 0..5 {
        for j in 0..4 {
            let at = Vec3::new(-20.0 + 10.0 * i as f32, 8.3, [-15.0, -6.3, 2.5, 11.5][j]);
            build.place("high-bay lamp", lamp, at, Quat::IDENTITY, Vec3::ONE);
        }
    }
}

/// A pallet of 1.2 m x 0.8 m, 14.4 cm high, its middle on the origin.
fn pallet() -> Shape {
    let mut shape = Shape::default();
    for x in [-0.6, -0.0725, 0.455] {
        for z in [-0.4, -0.07, 0.26] {
            shape.standing_box(Vec3::new(x, 0.022, z), Vec3::new(x + 0.145, 0.1, z + 0.14));
        }
    }
    for z in [-0.4, -0.05, 0.3] {
        shape.block(Vec3::new(-0.6, 0.0, z), Vec3::new(0.6, 0.021, z + 0.1));
    }
    for x in [-0.6, -0.0725, 0.455] {
        shape.block(Vec3::new(x, 0.101, -0.4), Vec3::new(x + 0.145, 0.121, 0.4));
    }
    for i in 0..5 {
        let z = -0.4 + 0.175 * i as f32;
        shape.block(Vec3::new(-0.6, 0.122, z), Vec3::new(0.6, 0.144, z + 0.1));
    }
    shape
}

/// A closed carton with tape over its lid.
fn carton(goods: &mut Shape, tape: &mut Shape, low: Vec3, size: Vec3) {
    goods.standing_box(low, low + size);
    let lid = low + Vec3::Y * (size.y + 0.002);
    tape.rectangle(lid + Vec3::new(0.0, 0.0, size.z * 0.58), Vec3::X * size.x, -Vec3::Z * size.z * 0.16);
    for (x, out, along) in [(-0.002, Vec3::NEG_X, Vec3::Z), (size.x + 0.002, Vec3::X, Vec3::NEG_Z)] {
        let from = low + Vec3::new(x, size.y * 0.8, size.z * if out.x < 0.0 { 0.42 } else { 0.58 });
        tape.rectangle(from, along * size.z * 0.16, Vec3::Y * size.y * 0.2);
    }
}

/// A loaded pallet; the goods stay below 1.5 m.
fn load(build: &mut Builder, m: &Materials, kind: usize) -> usize {
    let (mut goods, mut tape) = (Shape::default(), Shape::default());
    const DECK: f32 = 0.144;
    let material = match kind {
        0 | 1 => {
            let (nx, ny, nz) = if kind == 0 { (3, 3, 2) } else { (3, 4, 3) };
            let size = Vec3::new(1.14 / nx as f32, 1.2 / ny as f32, 0.76 / nz as f32);
            for i in 0..nx * ny * nz {
                let (x, y, z) = (i % nx, i / nx / nz, i / nx % nz);
                // The top layer is not full.
                if y == ny - 1 && chance(70 + kind as u32, i as u32) < 0.3 {
                    continue;
                }
                let low = Vec3::new(-0.57 + size.x * x as f32, DECK + size.y * y as f32, -0.38 + size.z * z as f32);
                // A little apart, but standing on each other: no gap below.
                carton(&mut goods, &mut tape, low + Vec3::new(0.006, 0.0, 0.006), size - Vec3::new(0.012, 0.0, 0.012));
            }
            m.carton
        }
        2 => {
            let rings = [[0.27, 0.0], [0.27, 0.28], [0.285, 0.3], [0.27, 0.32], [0.27, 0.58], [0.285, 0.6], [0.27, 0.62], [0.28, 0.88], [0.0, 0.87]];
            for (x, z) in [(-0.3, -0.1), (0.28, 0.08)] {
                goods.append(&lathe(&rings, 16).at(x, DECK, z));
            }
            m.drum
        }
        3 => {
            for layer in 0..4 {
                for n in 0..2 {
                    let at = Vec3::new(-0.29 + 0.58 * n as f32, DECK + 0.1 + 0.18 * layer as f32, 0.01 * (layer % 2) as f32);
                    let round = |v: f32| v.signum() * v.abs().sqrt();
                    let sack = icosphere(1).bent(|p, _| Vec3::new(0.28 * round(p.x), 0.1 * p.y, 0.38 * round(p.z)) * (1.0 + 0.03 * sin(9.0 * p.x + n as f32)));
                    goods.append(&sack.at(at.x, at.y, at.z));
                }
            }
            m.sack
        }
        4 => {
            // A crate of boards on four sides.
            for i in 0..5 {
                let y = DECK + 0.003 + 0.22 * i as f32;
                for z in [-0.4, 0.375] {
                    goods.block(Vec3::new(-0.58, y, z), Vec3::new(0.58, y + 0.2, z + 0.025));
                }
                for x in [-0.58, 0.555] {
                    goods.block(Vec3::new(x, y, -0.37), Vec3::new(x + 0.025, y + 0.2, 0.37));
                }
            }
            for (x, z) in [(-0.55, -0.37), (0.5, -0.37), (-0.55, 0.32), (0.5, 0.32)] {
                goods.standing_box(Vec3::new(x, DECK, z), Vec3::new(x + 0.05, DECK + 1.1, z + 0.05));
            }
            goods.standing_box(Vec3::new(-0.54, DECK, -0.31), Vec3::new(0.54, DECK + 0.9, 0.31));
            m.pallet
        }
        _ => {
            // Wrapped in film: a soft block.
            let soft = icosphere(2).bent(|p, _| {
                let round = |v: f32| v.signum() * v.abs().powf(0.35);
                Vec3::new(0.57 * round(p.x), 0.55 * round(p.y) + DECK + 0.56, 0.38 * round(p.z)) + p * 0.012 * sin(23.0 * p.y + 7.0 * p.x)
            });
            goods.append(&soft);
            m.film
        }
    };
    build.mesh("load", &[(&pallet().textured(0.5), m.pallet), (&goods.textured(0.4), material), (&tape, m.tape)])
}

/// Six rows of racks, the inner ones back to back, along X.
fn racks(build: &mut Builder, m: &Materials) {
    let mut frame = Shape::default();
    let height = LEVEL * (LEVELS - 1) as f32 + 1.5;
    for z in [0.0, DEPTH - 0.1] {
        frame.standing_box(Vec3::new(-0.05, 0.02, z), Vec3::new(0.05, height, z + 0.1));
        frame.standing_box(Vec3::new(-0.09, 0.0, z - 0.02), Vec3::new(0.09, 0.019, z + 0.12));
    }
    for i in 0..8 {
        let y = 0.3 + 0.8 * i as f32;
        let (from, to) = if i % 2 == 0 { (0.1, DEPTH - 0.1) } else { (DEPTH - 0.1, 0.1) };
        frame.bar(Vec3::new(0.0, y, from), Vec3::new(0.0, y + 0.75, to), 0.04);
    }
    let frame = build.mesh("rack frame", &[(&frame, m.blue)]);
    let (mut beams, mut deck) = (Shape::default(), Shape::default());
    for level in 1..LEVELS {
        let y = LEVEL * level as f32;
        for z in [0.005, DEPTH - 0.055] {
            beams.block(Vec3::new(0.052, y - 0.12, z), Vec3::new(BAY - 0.052, y, z + 0.05));
        }
        for i in 0..6 {
            let x = 0.25 + 0.43 * i as f32;
            deck.block(Vec3::new(x, y - 0.06, 0.06), Vec3::new(x + 0.14, y - 0.02, DEPTH - 0.06));
        }
    }
    let beams = build.mesh("rack beams", &[(&beams, m.orange), (&deck, m.steel)]);
    let loads: Vec<usize> = (0..6).map(|kind| load(build, m, kind)).collect();
    for (row, z) in [-17.8f32, -13.0, -11.5, -6.0, -4.5, 1.0].into_iter().enumerate() {
        let x = -14.0;
        for bay in 0..=BAYS {
            build.place("rack frame", frame, Vec3::new(x + BAY * bay as f32, 0.0, z), Quat::IDENTITY, Vec3::ONE);
        }
        for bay in 0..BAYS {
            let corner = Vec3::new(x + BAY * bay as f32, 0.0, z);
            build.place("rack beams", beams, corner, Quat::IDENTITY, Vec3::ONE);
            for slot in 0..2 * LEVELS {
                let (level, side) = (slot / 2, slot % 2);
                let id = (row as u32 * BAYS + bay) * 2 * LEVELS + slot;
                if chance(80, id) < 0.3 {
                    continue;
                }
                let kind = (chance(81, id) * 5.999) as usize;
                let at = corner + Vec3::new(0.72 + 1.36 * side as f32, LEVEL * level as f32 + 0.001, DEPTH / 2.0);
                let degrees = 4.0 * chance(82, id) - 2.0 + if chance(83, id) < 0.5 { 180.0 } else { 0.0 };
                build.place("load", loads[kind], at, turned(degrees), Vec3::ONE);
            }
        }
    }
    // What has just come in stands by the docks.
    for n in 0..9u32 {
        let at = Vec3::new(-20.5 + 1.9 * (n % 3) as f32, 0.002, 9.0 + 2.1 * (n / 3) as f32);
        build.place("load", loads[n as usize % 6], at, turned(90.0 + 10.0 * chance(84, n)), Vec3::ONE);
    }
}

/// A room of 9 m x 5 m in the corner at +X +Z, with windows to the hall and two lit panels.
fn office(build: &mut Builder, m: &Materials) {
    let (low, high) = (Vec3::new(HALF[0] - 9.5, 0.0, HALF[1] - 5.5), Vec3::new(HALF[0] - 0.5, 3.2, HALF[1] - 0.5));
    let windows: Vec<Opening> = [3.0f32, 5.0, 7.0].iter().map(|u| Opening { low: [*u, 1.0], high: [u + 1.6, 2.3], arched: false }).collect();
    let mut openings = vec![Opening { low: [0.8, 0.0], high: [1.9, 2.15], arched: false }];
    openings.extend(windows);
    // Seen from the hall: the long wall faces -Z, its left end at +X; the short one faces -X.
    for (name, width, at, degrees, openings) in [
        ("office front", 9.0, Vec3::new(high.x, 0.0, low.z), 180.0, &openings[..]),
        ("office side", 5.0, Vec3::new(low.x, 0.0, low.z), -90.0, &[][..]),
    ] {
        let mesh = build.mesh(name, &[(&wall(width, 3.2, 0.15, openings, Some(2.9)), m.plaster)]);
        build.place(name, mesh, at, turned(degrees), Vec3::ONE);
    }
    let mut shell = Shape::default();
    let (x, z) = (Vec3::X * 9.0, Vec3::Z * 5.0);
    // Inside of the walls towards the hall's own, ceiling, outside of these walls, and the flat roof.
    shell.rectangle(Vec3::new(high.x - 0.1, 0.0, low.z), z, Vec3::Y * 2.9);
    shell.rectangle(Vec3::new(high.x, 0.0, high.z - 0.1), -x, Vec3::Y * 2.9);
    shell.rectangle(low + Vec3::Y * 2.9, x, z);
    shell.rectangle(low + Vec3::Y * 3.2 + z, x, -z);
    shell.rectangle(high - Vec3::Y * 3.2, -z, Vec3::Y * 3.2);
    shell.rectangle(Vec3::new(low.x, 0.0, high.z), x, Vec3::Y * 3.2);
    build.object("office shell", &shell, m.plaster);
    let mut light = Shape::default();
    light.rectangle(Vec3::new(-0.6, 0.0, -0.3), Vec3::X * 1.2, Vec3::Z * 0.6);
    let light = build.mesh("office panel", &[(&light, m.panel)]);
    let mut desk = Shape::default();
    desk.block(Vec3::new(-0.8, 0.71, -0.4), Vec3::new(0.8, 0.75, 0.4));
    for (x, z) in [(-0.75, -0.35), (0.7, -0.35), (-0.75, 0.3), (0.7, 0.3)] {
        desk.standing_box(Vec3::new(x, 0.0, z), Vec3::new(x + 0.05, 0.73, z + 0.05));
    }
    let mut screen = Shape::default();
    screen.block(Vec3::new(-0.3, 0.85, -0.16), Vec3::new(0.3, 1.2, -0.13));
    screen.standing_box(Vec3::new(-0.1, 0.752, -0.2), Vec3::new(0.1, 0.84, -0.1));
    let desk = build.mesh("desk", &[(&desk.textured(0.8), m.pallet), (&screen, m.black)]);
    for side in [2.4f32, 6.4] {
        build.place("office panel", light, Vec3::new(low.x + side, 2.85, low.z + 2.5), Quat::IDENTITY, Vec3::ONE);
        build.place("desk", desk, Vec3::new(low.x + side, 0.0, low.z + 2.2), Quat::IDENTITY, Vec3::ONE);
    }
}

/// Fork-lift trucks and a roller conveyor.
fn machines(build: &mut Builder, m: &Materials) {
    let (mut body, mut dark, mut metal) = (Shape::default(), Shape::default(), Shape::default());
    body.block(Vec3::new(-0.55, 0.3, -1.1), Vec3::new(0.55, 0.8, 0.7));
    body.block(Vec3::new(-0.5, 0.801, -1.05), Vec3::new(0.5, 1.05, -0.35));
    // The counterweight is round behind.
    body.append(&lathe(&curve(&[[0.0, 0.25], [0.5, 0.28], [0.56, 0.5], [0.54, 0.8], [0.3, 1.0], [0.0, 1.02]], 3), 32).at(0.0, 0.0, -1.12));
    dark.block(Vec3::new(-0.28, 1.051, -0.95), Vec3::new(0.28, 1.16, -0.4));
    dark.block(Vec3::new(-0.28, 1.17, -0.98), Vec3::new(0.28, 1.65, -0.88));
    for (x, z) in [(-0.5, -1.0), (0.5, -1.0), (-0.5, 0.55), (0.5, 0.55)] {
        metal.bar(Vec3::new(x, 0.75, z), Vec3::new(x * 0.9, 2.1, z * 0.8), 0.07);
    }
    for i in 0..7 {
        let z = -0.8 + 0.205 * i as f32;
        metal.bar(Vec3::new(-0.47, 2.11, z), Vec3::new(0.47, 2.11, z), 0.05);
    }
    for x in [-0.38, 0.38] {
        metal.bar(Vec3::new(x, 0.1, 0.85), Vec3::new(x, 2.6, 0.85), 0.1);
        metal.block(Vec3::new(x - 0.06, 0.12, 0.95), Vec3::new(x + 0.06, 0.17, 2.1));
        metal.block(Vec3::new(x - 0.06, 0.171, 0.95), Vec3::new(x + 0.06, 0.7, 1.0));
    }
    for y in [0.4, 1.4, 2.5] {
        metal.bar(Vec3::new(-0.32, y, 0.86), Vec3::new(0.32, y, 0.86), 0.06);
    }
    let tyre = curve(&[[0.12, -0.12], [0.28, -0.12], [0.33, -0.08], [0.33, 0.08], [0.28, 0.12], [0.12, 0.12], [0.0, 0.11]], 2);
    let sideways = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    for (x, z) in [(-0.56, -0.85), (0.56, -0.85), (-0.56, 0.5), (0.56, 0.5)] {
        let wheel = lathe(&tyre, 20);
        let turn = if x < 0.0 { sideways } else { sideways.inverse() };
        dark.append(&wheel.transformed(Affine3A::from_rotation_translation(turn, Vec3::new(x, 0.335, z))));
    }
    let truck = build.mesh("fork-lift truck", &[(&body, m.yellow), (&dark, m.black), (&metal, m.steel)]);
    for (x, z, degrees) in [(-16.5, 6.5, 110.0), (3.0, -8.8, 90.0), (16.0, 6.0, -35.0)] {
        build.place("fork-lift truck", truck, Vec3::new(x, 0.0, z), turned(degrees), Vec3::ONE);
    }

    let (mut rail, mut rollers) = (Shape::default(), Shape::default());
    for z in [-0.42, 0.37] {
        rail.block(Vec3::new(-7.0, 0.6, z), Vec3::new(7.0, 0.75, z + 0.05));
        for i in 0..6 {
            let x = -6.8 + 2.68 * i as f32;
            rail.standing_box(Vec3::new(x, 0.0, z), Vec3::new(x + 0.06, 0.599, z + 0.05));
        }
    }
    let lying = Affine3A::from_quat(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
    let roller = lathe(&[[0.0, -0.36], [0.05, -0.36], [0.05, 0.36], [0.0, 0.36]], 14).transformed(lying);
    for i in 0..70 {
        rollers.append(&roller.clone().at(-6.9 + 0.2 * i as f32, 0.71, 0.0));
    }
    let conveyor = build.mesh("conveyor", &[(&rail, m.blue), (&rollers, m.steel)]);
    build.place("conveyor", conveyor, Vec3::new(3.0, 0.0, 12.0), Quat::IDENTITY, Vec3::ONE);
    let (mut boxes, mut tape) = (Shape::default(), Shape::default());
    carton(&mut boxes, &mut tape, Vec3::new(-0.3, 0.0, -0.2), Vec3::new(0.6, 0.4, 0.4));
    let parcel = build.mesh("parcel", &[(&boxes.textured(0.4), m.carton), (&tape, m.tape)]);
    for i in 0..7u32 {
        let at = Vec3::new(-3.2 + 1.9 * i as f32 + 0.5 * chance(90, i), 0.762, 12.0);
        build.place("parcel", parcel, at, turned(30.0 * chance(91, i) - 15.0), Vec3::ONE);
    }
    let mut stack = Shape::default();
    for i in 0..9 {
        stack.append(&pallet().transformed(Affine3A::from_rotation_translation(turned(3.0 * chance(92, i) - 1.5), Vec3::Y * (0.146 * i as f32 + 0.002))));
    }
    let stack = build.mesh("empty pallets", &[(&stack.textured(0.5), m.pallet)]);
    for (n, (x, z)) in [(-9.0, 15.5), (-7.2, 15.5), (13.5, 16.0)].into_iter().enumerate() {
        build.place("empty pallets", stack, Vec3::new(x, 0.0, z), turned(5.0 * n as f32), Vec3::ONE);
    }
}

//! A museum of nine rooms around a hall of columns: paintings, busts, vases, showcases and a dinosaur, under spots and panels.

use glam::{Quat, Vec2, Vec3};

use super::{
    super::Document,
    build::{Builder, Glow, chance, turned},
    sculpture::{amphora, bust, column, free_form, knot, shell, skeleton, vase},
    shape::{Opening, Shape, cos, curve, lathe, sin, tube, wall},
};

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
    build.camera("camera", Vec3::new(7.3, 2.1, 4.6), Vec3::new(-4.0, 1.7, -3.4), 1.15);
    build.finish()
}

/// The meshes that many nodes share, and the materials.
struct Stock {
    paint: [usize; 3],
    plaster: usize,
    parquet: usize,
    marble: usize,
    white: usize,
    wood: usize,
    /// Each with the name of its kind.
    sculptures: Vec<(&'static str, usize)>,
    plinth: usize,
    paintings: Vec<usize>,
    fixture: usize,
    panel: usize,
    showcase: usize,
    amphora: usize,
    bench: usize,
    stanchion: usize,
    rope: usize,
    column: usize,
}

impl Stock {
    fn new(build: &mut Builder) -> Self {
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
            let (across, along) = if (x / 32 + y / 32) % 2 == 0 { (x, y) } else { (y, x) };
            let board = across / 8 + 8 * (x / 32 + 2 * (y / 32));
            let grain = (chance(1, board) * 50.0 + chance(2, along + 64 * board) * 12.0) as u8;
            if across % 8 == 0 { [96, 62, 38] } else { [150 + grain, 104 + grain, 66 + grain / 2] }
        });
        let marble = build.textured("marble tiles", 64, |x, y| {
            let vein = (chance(3, x / 2 + 32 * (y / 2)) * 14.0) as u8;
            if (x / 32 + y / 32) % 2 == 0 { [212 + vein, 208 + vein, 198 + vein] } else { [86 + vein, 82 + vein, 84 + vein] }
        });
        let lamp = build.emitter("ceiling light", [0.8; 3], [1.0, 0.93, 0.82], 1500.0);
        let case_lamp = build.emitter("showcase light", [0.8; 3], [1.0, 0.97, 0.92], 600.0);

        let mut sculptures = Vec::new();
        for kind in 0..3 {
            sculptures.push(("vase", build.mesh("vase", &[(&vase(kind, 91), [clay, glaze, clay][kind])])));
        }
        for kind in 0..2 {
            sculptures.push(("bust", build.mesh("bust", &[(&bust(kind, 5), [white, bronze][kind as usize])])));
        }
        for kind in 0..2 {
            sculptures.push(("free form", build.mesh("free form", &[(&free_form(kind), [bronze, white][kind as usize])])));
        }
        sculptures.push(("knot", build.mesh("knot", &[(&knot(256), bronze)])));

        let mut plinth = Shape::default();
        plinth.standing_box(Vec3::new(-0.32, 0.0, -0.32), Vec3::new(0.32, 1.0, 0.32));
        let paintings = (0..6).map(|kind| painting(build, gold, kind)).collect();
        let can = lathe(&[[0.0, 0.02], [0.05, 0.02], [0.055, 0.13], [0.04, 0.17], [0.0, 0.18]], 24);
        let to_back = glam::Affine3A::from_quat(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
        let mut housing = Shape::default();
        housing.standing_box(Vec3::new(-0.6, 0.0, -0.3), Vec3::new(0.6, 0.06, 0.3));
        let mut light = Shape::default();
        light.rectangle(Vec3::new(-0.6, 0.0, -0.3), Vec3::X * 1.2, Vec3::Z * 0.6);
        let mut bench = Shape::default();
        bench.block(Vec3::new(-0.9, 0.4, -0.25), Vec3::new(0.9, 0.48, 0.25));
        for (x, z) in [(-0.8, -0.18), (0.74, -0.18), (-0.8, 0.12), (0.74, 0.12)] {
            bench.standing_box(Vec3::new(x, 0.0, z), Vec3::new(x + 0.06, 0.44, z + 0.06));
        }
        let post = lathe(&curve(&[[0.16, 0.0], [0.15, 0.02], [0.03, 0.05], [0.025, 0.5], [0.03, 0.9], [0.05, 0.95], [0.0, 1.0]], 3), 24);
        let sag: Vec<Vec3> = (0..=16).map(|i| i as f32 / 16.0).map(|t| Vec3::new(t * 1.4, 0.85 - t * (1.0 - t), 0.0)).collect();
        let (case, case_light) = showcase();
        Self {
            paint: [[0.42, 0.12, 0.1], [0.16, 0.27, 0.2], [0.66, 0.6, 0.48]].map(|albedo| build.material("wall paint", albedo)),
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
        let (sky, land) = ([90.0 + 20.0 * k, 120.0 + 8.0 * k, 170.0 - 12.0 * k], [70.0 + 15.0 * k, 80.0 - 4.0 * k, 40.0 + 9.0 * k]);
        let hill = 0.55 + 0.15 * sin(u * (4.0 + k) + k) + 0.04 * sin(u * 23.0);
        let sun = Vec2::new(u - 0.2 - 0.1 * k, v - 0.25).length() < 0.1;
        let base = if sun { [235.0, 200.0, 120.0] } else if v < hill { sky } else { land };
        base.map(|c: f32| (c + 26.0 * (chance(kind + 10, x + 32 * y) - 0.5)) as u8)
    });
    let mut shape = Shape::default();
    let rings = [(0.0, 0.0), (0.0, 0.05), (0.05, 0.08), (0.09, 0.06), (0.12, 0.03)];
    let corner = |(inset, z): (f32, f32), i: usize| {
        let (x, y) = (0.75 - inset, 0.55 - inset);
        Vec3::new([-x, x, x, -x][i % 4], [-y, -y, y, y][i % 4], z)
    };
    for pair in rings.windows(2) {
        for i in 0..4 {
            shape.polygon(&[corner(pair[0], i), corner(pair[0], i + 1), corner(pair[1], i + 1), corner(pair[1], i)]);
        }
    }
    let mut canvas = Shape::default();
    canvas.polygon(&std::array::from_fn::<_, 4, _>(|i| corner(rings[4], i)));
    canvas.uvs = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]].map(Vec2::from).to_vec();
    build.mesh("painting", &[(&shape, frame), (&canvas, art)])
}

/// A table with four posts and a lid that shines down on what lies on it. No glass: transport is diffuse.
fn showcase() -> (Shape, Shape) {
    let mut case = Shape::default();
    case.standing_box(Vec3::new(-0.75, 0.0, -0.4), Vec3::new(0.75, 0.9, 0.4));
    for (x, z) in [(-0.74, -0.39), (0.71, -0.39), (-0.74, 0.36), (0.71, 0.36)] {
        for (corner, along) in [(Vec3::new(x, 0.9, z), 0.0), (Vec3::new(x + 0.03, 0.9, z + 0.03), 1.0)] {
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

fn is_hall(i: usize, j: usize) -> bool {
    i == 1 && j == 1
}

fn height(i: usize, j: usize) -> f32 {
    if is_hall(i, j) { HALL_HEIGHT } else { ROOM_HEIGHT }
}

/// Floor, ceiling, panels and exhibits of one room.
fn room(build: &mut Builder, stock: &Stock, i: usize, j: usize) {
    let low = Vec3::new(GRID[i] + HALF, 0.0, GRID[j] + HALF);
    let size = Vec3::new(GRID[i + 1] - HALF, 0.0, GRID[j + 1] - HALF) - low;
    let name = format!("room {}{}", ["a", "b", "c"][i], j + 1);
    let mut floor = Shape::default();
    floor.rectangle(low, Vec3::Z * size.z, Vec3::X * size.x);
    let (material, repeat) = if is_hall(i, j) { (stock.marble, 2.0) } else { (stock.parquet, 1.5) };
    build.object(&format!("{name} floor"), &floor.textured(repeat), material);
    let mut ceiling = Shape::default();
    ceiling.rectangle(low + Vec3::Y * height(i, j), Vec3::X * size.x, Vec3::Z * size.z);
    build.object(&format!("{name} ceiling"), &ceiling, stock.plaster);
    let middle = low + size / 2.0;
    if is_hall(i, j) {
        return;
    }
    for (x, z) in [(0.0, 0.0), (-0.28, -0.28), (0.28, -0.28), (-0.28, 0.28), (0.28, 0.28)] {
        let at = middle + Vec3::new(x * size.x, ROOM_HEIGHT - 0.35, z * size.z);
        build.place("ceiling panel", stock.panel, at, Quat::IDENTITY, Vec3::ONE);
    }
    let corner = i != 1 && j != 1;
    if (i, j) == (1, 0) {
        exhibit_skeleton(build, stock, middle);
        return;
    }
    let places: &[(f32, f32)] =
        if corner { &[(-0.27, -0.2), (0.27, -0.2), (-0.27, 0.24), (0.27, 0.24), (0.0, -0.3)] } else { &[(-0.3, -0.28), (0.3, -0.28), (-0.3, 0.28), (0.3, 0.28)] };
    for (n, (x, z)) in places.iter().enumerate() {
        let at = middle + Vec3::new(x * size.x, 0.0, z * size.z);
        exhibit(build, stock, 5 * i + 11 * j + n, at);
    }
    let side = if corner { Vec3::new(0.0, 0.0, 1.2) } else { Vec3::new(1.6, 0.0, 1.5) };
    exhibit_case(build, stock, middle + side);
    build.place("bench", stock.bench, middle + Vec3::new(-2.0, 0.0, -0.6), turned(90.0), Vec3::ONE);
}

/// A sculpture on its plinth under a spot.
fn exhibit(build: &mut Builder, stock: &Stock, n: usize, at: Vec3) {
    let (name, mesh) = stock.sculptures[n * 3 % stock.sculptures.len()];
    build.place("plinth", stock.plinth, at, Quat::IDENTITY, Vec3::ONE);
    build.place(name, mesh, at + Vec3::Y, turned(chance(20, n as u32) * 360.0), Vec3::ONE);
    let angle = n as f32 * 2.4;
    let lamp = at + Vec3::new(1.6 * cos(angle), ROOM_HEIGHT - 0.6, 1.6 * sin(angle));
    let glow = Glow { color: [1.0, 0.9, 0.76], intensity: 1400.0 };
    build.spot(&format!("{name} spot"), [lamp, at + Vec3::Y * 1.4], glow, [0.2, 0.35], Some(stock.fixture));
}

fn exhibit_case(build: &mut Builder, stock: &Stock, at: Vec3) {
    build.place("showcase", stock.showcase, at, Quat::IDENTITY, Vec3::ONE);
    for x in [-0.45, 0.0, 0.45] {
        build.place("amphora", stock.amphora, at + Vec3::new(x, 0.9, 0.0), turned(70.0 * x + 20.0), Vec3::ONE);
    }
}

/// The dinosaur on its platform, roped off, with four spots.
fn exhibit_skeleton(build: &mut Builder, stock: &Stock, middle: Vec3) {
    let mut platform = Shape::default();
    platform.standing_box(Vec3::new(-4.8, 0.0, -1.4), Vec3::new(4.8, 0.25, 1.4));
    let mesh = build.mesh("platform", &[(&platform, stock.wood)]);
    build.place("platform", mesh, middle, Quat::IDENTITY, Vec3::ONE);
    let bones = build.mesh("dinosaur", &[(&skeleton(), stock.white)]);
    build.place("dinosaur", bones, middle + Vec3::Y * 0.25, Quat::IDENTITY, Vec3::ONE);
    for n in 0..4 {
        let x = -4.5 + 3.0 * n as f32;
        let lamp = middle + Vec3::new(x, ROOM_HEIGHT - 0.5, if n % 2 == 0 { 2.6 } else { -2.6 });
        let glow = Glow { color: [1.0, 0.9, 0.76], intensity: 1800.0 };
        build.spot("dinosaur spot", [lamp, middle + Vec3::new(x * 0.8, 1.6, 0.0)], glow, [0.3, 0.5], Some(stock.fixture));
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
fn hall(build: &mut Builder, stock: &Stock) {
    for n in 0..12 {
        // 15 degrees off the axes, so that no column stands in a doorway.
        let angle = (n as f32 * 30.0 + 15.0).to_radians();
        let at = Vec3::new(5.4 * cos(angle), 0.0, 5.4 * sin(angle));
        build.place("column", stock.column, at, Quat::IDENTITY, Vec3::ONE);
        let panel = Vec3::new(3.6 * cos(angle), HALL_HEIGHT - 0.5, 3.6 * sin(angle));
        build.place("ceiling panel", stock.panel, panel, turned(-15.0 - 30.0 * n as f32), Vec3::ONE);
        let post = Vec3::new(2.7 * cos(angle), 0.0, 2.7 * sin(angle));
        build.place("stanchion", stock.stanchion, post, Quat::IDENTITY, Vec3::ONE);
        // From this post to the next: 1.4 m at a radius of 2.7 m.
        build.place("rope", stock.rope, post, turned(-(n as f32 * 30.0 + 15.0) - 105.0), Vec3::ONE);
    }
    let base = lathe(&curve(&[[1.5, 0.0], [1.48, 0.12], [1.1, 0.2], [1.0, 0.5], [0.9, 0.7], [0.6, 0.74], [0.0, 0.75]], 4), 96);
    build.object("shell base", &base, stock.white);
    build.object("shell", &shell().at(0.0, 0.7, 0.0), stock.white);
    for n in 0..4 {
        let angle = (n as f32 * 90.0 + 30.0).to_radians();
        let lamp = Vec3::new(4.2 * cos(angle), HALL_HEIGHT - 1.0, 4.2 * sin(angle));
        let glow = Glow { color: [1.0, 0.92, 0.8], intensity: 6000.0 };
        build.spot("shell spot", [lamp, Vec3::new(0.0, 1.7, 0.0)], glow, [0.2, 0.35], Some(stock.fixture));
        let (x, z) = ([-6.8, 6.8, 6.8, -6.8][n], [-6.8, -6.8, 6.8, 6.8][n]);
        exhibit(build, stock, 3 * n + 1, Vec3::new(x, 0.0, z));
    }
}

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
        build.place(name, mesh, self.left, turned(90.0 * self.quarter as f32), Vec3::ONE);
    }

    /// Hangs paintings at distances from the left end, each with its spot.
    fn hang(&self, build: &mut Builder, stock: &Stock, from_left: &[f32], seed: usize) {
        let rotation = turned(90.0 * self.quarter as f32);
        for (n, x) in from_left.iter().enumerate() {
            let at = self.left + rotation * Vec3::new(*x, 1.7, 0.0);
            let picture = stock.paintings[(seed * 5 + n * 7) % stock.paintings.len()];
            build.place("painting", picture, at, rotation, Vec3::ONE);
            let lamp = self.left + rotation * Vec3::new(*x, ROOM_HEIGHT - 0.6, 1.7);
            let glow = Glow { color: [1.0, 0.92, 0.8], intensity: 900.0 };
            build.spot("painting spot", [lamp, at], glow, [0.22, 0.4], Some(stock.fixture));
        }
    }
}

/// The outer walls, and those between rooms with their doorways.
fn walls(build: &mut Builder, stock: &Stock) {
    for k in 0..3 {
        let (from, to) = (GRID[k] + HALF, GRID[k + 1] - HALF);
        let (low, high) = (GRID[0] + HALF, GRID[3] - HALF);
        let width = to - from;
        let paint = if k == 1 { stock.paint[2] } else { stock.paint[k / 2] };
        for (side, left) in [
            Vec3::new(from, 0.0, low),
            Vec3::new(low, 0.0, to),
            Vec3::new(to, 0.0, high),
            Vec3::new(high, 0.0, from),
        ]
        .into_iter()
        .enumerate()
        {
            let face = Face { left, quarter: side as i32, width, paint };
            let entrance = k == 1 && side == 2;
            let doors = if entrance { vec![doorway(width, 3.0, 3.6, true)] } else { vec![] };
            face.place(build, "outer wall", &wall(width, ROOM_HEIGHT, 0.3, &doors, None));
            if entrance {
                let mut leaf = Shape::default();
                leaf.rectangle(Vec3::new(width / 2.0 - 1.5, 0.0, 0.0), Vec3::X * 3.0, Vec3::NEG_Z * 0.3);
                for (x, z) in [(-1.5, -0.28), (0.02, -0.28)] {
                    leaf.rectangle(Vec3::new(width / 2.0 + x, 0.0, z), Vec3::X * 1.48, Vec3::Y * 3.6);
                }
                Face { paint: stock.wood, ..face }.place(build, "entrance doors", &leaf);
                continue_pictures(build, stock, &Face { left, quarter: 2, width, paint }, &[2.0, 4.3, width - 2.0]);
            } else {
                let places = [width * 0.2, width * 0.5, width * 0.8];
                continue_pictures(build, stock, &Face { left, quarter: side as i32, width, paint }, &places);
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
    face.hang(build, stock, places, face.quarter as usize + face.width as usize);
}

/// A doorway in the middle of a wall.
fn doorway(width: f32, opening: f32, height: f32, arched: bool) -> Opening {
    Opening { low: [(width - opening) / 2.0, 0.0], high: [(width + opening) / 2.0, height], arched }
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
    let (front, doors) = if beside_hall { (HALL_HEIGHT, doorway(width, 3.0, 4.0, true)) } else { (ROOM_HEIGHT, doorway(width, 2.4, 3.2, false)) };
    let face = Face { left, quarter, width, paint: stock.paint[if beside_hall { 2 } else { k / 2 }] };
    let mut threshold = Shape::default();
    threshold.rectangle(Vec3::new(doors.low[0], 0.0, 0.0), Vec3::X * (doors.high[0] - doors.low[0]), Vec3::NEG_Z * (2.0 * HALF));
    let masonry = wall(width, front, 2.0 * HALF, &[doors], Some(ROOM_HEIGHT));
    let mesh = build.mesh("wall", &[(&masonry, face.paint), (&threshold, stock.wood)]);
    build.place("wall", mesh, face.left, turned(90.0 * quarter as f32), Vec3::ONE);
    if !beside_hall {
        // Two paintings towards the corner room and one towards the room between; which side that is depends on the line.
        let rotation = turned(90.0 * quarter as f32);
        let rear = Face { left: left + rotation * Vec3::new(width, 0.0, -2.0 * HALF), quarter: quarter + 2, width, paint: face.paint };
        let (corner, between) = if line == 1 { (&face, &rear) } else { (&rear, &face) };
        corner.hang(build, stock, &[width * 0.18, width * 0.82], 3 + k);
        between.hang(build, stock, &[width * 0.82], 5 + k);
    }
}

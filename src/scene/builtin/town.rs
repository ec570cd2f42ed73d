//! A town square at dusk: houses with shops, a town hall, a colonnade, a fountain, trees, stalls and street lamps.

use glam::{Affine3A, Quat, Vec2, Vec3};

use super::{
    super::Document,
    build::{Builder, Glow, chance, turned},
    enclosures::icosphere,
    sculpture::bust,
    shape::{Opening, Shape, cos, curve, lathe, sin, tube, wall},
};

const GROUND: f32 = 3.9;
const STOREY: f32 = 3.1;

/// 175 thousand triangles and 35 lights: the sun, 12 street lamps, 6 shop windows, 8 pendants in the colonnade and 8 wall lanterns.
pub(super) fn town_square() -> Document {
    let mut build = Builder::new("town-square");
    let m = Materials::new(&mut build);
    ground(&mut build, &m);
    houses(&mut build, &m);
    colonnade(&mut build, &m);
    fountain(&mut build, &m);
    greenery(&mut build, &m);
    furniture(&mut build, &m);
    build.sun("sun", Vec3::new(0.62, -0.55, -0.5), Glow { color: [1.0, 0.68, 0.42], intensity: 900.0 });
    build.camera("camera", Vec3::new(15.5, 3.2, 14.5), Vec3::new(-6.0, 3.4, -8.0), 1.05);
    build.finish()
}

struct Materials {
    stucco: [usize; 4],
    brick: usize,
    stone: usize,
    paving: usize,
    tiles: usize,
    wood: usize,
    green: usize,
    glass: usize,
    shop: usize,
    iron: usize,
    globe: usize,
    bark: usize,
    leaves: usize,
    water: usize,
    bronze: usize,
    cloth: [usize; 2],
    fruit: usize,
    clay: usize,
}

impl Materials {
    fn new(build: &mut Builder) -> Self {
        let stucco = [[0.66, 0.52, 0.33], [0.62, 0.38, 0.28], [0.6, 0.6, 0.52], [0.48, 0.52, 0.56]].map(|albedo| build.material("stucco", albedo));
        let brick = build.textured("brick", 64, |x, y| {
            let row = y / 8;
            let shifted = x + 8 * (row % 2);
            let joint = y % 8 == 0 || shifted % 16 == 0;
            let shade = (chance(30, (shifted / 16) % 4 + 4 * row) * 46.0 + chance(31, x + 64 * y) * 10.0) as u8;
            if joint { [186, 178, 164] } else { [136 + shade, 72 + shade / 2, 56 + shade / 3] }
        });
        let paving = build.textured("paving", 64, |x, y| {
            let row = y / 16;
            let shifted = x + 8 * (row % 2);
            let shade = (chance(32, (shifted / 16) % 4 + 4 * row) * 34.0 + chance(33, x + 64 * y) * 14.0) as u8;
            if y % 16 == 0 || shifted % 16 == 0 { [92, 86, 78] } else { [140 + shade, 132 + shade, 120 + shade] }
        });
        let wood = build.textured("planks", 32, |x, y| {
            let grain = (chance(34, x / 8 + 8 * (y / 4)) * 30.0) as u8;
            if x % 8 == 0 { [58, 38, 24] } else { [112 + grain, 78 + grain, 50 + grain] }
        });
        let cloth = [[200, 40, 36], [40, 96, 150]].map(|stripe| {
            build.textured("awning cloth", 16, |x, _| if x / 8 == 0 { stripe } else { [226, 220, 206] })
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

/// A house by material. It stands with its front on z = 0, from x = 0 on, and reaches back to negative z.
#[derive(Default)]
struct House {
    walls: Shape,
    trim: Shape,
    glass: Shape,
    wood: Shape,
    shutters: Shape,
    roof: Shape,
}

/// What a house looks like.
struct Plan {
    width: f32,
    depth: f32,
    storeys: u32,
    bays: u32,
    roof: f32,
    arched: bool,
}

impl House {
    fn new(plan: &Plan) -> Self {
        let mut house = Self::default();
        let height = GROUND + STOREY * (plan.storeys - 1) as f32;
        let bay = plan.width / plan.bays as f32;
        let mut openings = Vec::new();
        for b in 0..plan.bays {
            let u = (b as f32 + 0.5) * bay;
            let half = if plan.arched { (bay * 0.36).min(1.3) } else { 1.0 };
            let door = plan.arched || b % 2 == 1;
            let ground = Opening { low: [u - half, if door { 0.0 } else { 0.6 }], high: [u + half, if plan.arched { 3.5 } else { 2.9 }], arched: plan.arched };
            openings.push(ground);
            house.fill(&ground, door);
            for s in 1..plan.storeys {
                let base = GROUND + STOREY * (s - 1) as f32;
                let window = Opening { low: [u - 0.5, base + 0.75], high: [u + 0.5, base + 2.35], arched: plan.arched };
                openings.push(window);
                house.fill(&window, false);
                if !plan.arched && bay > 2.3 {
                    house.shutter(u - 1.03, base + 0.75);
                    house.shutter(u + 0.53, base + 0.75);
                }
            }
        }
        house.walls = wall(plan.width, height, 0.25, &openings, None);
        for s in 0..plan.storeys {
            let y = GROUND + STOREY * s as f32 - 0.28;
            attached(&mut house.trim, Vec3::new(0.0, y, 0.0), Vec3::new(plan.width, y + 0.2, 0.14));
        }
        house.walls.rectangle(Vec3::new(plan.width, 0.0, 0.0), Vec3::NEG_Z * plan.depth, Vec3::Y * height);
        house.walls.rectangle(Vec3::new(plan.width, 0.0, -plan.depth), Vec3::NEG_X * plan.width, Vec3::Y * height);
        house.walls.rectangle(Vec3::new(0.0, 0.0, -plan.depth), Vec3::Z * plan.depth, Vec3::Y * height);
        house.cover(plan, height);
        house
    }

    /// Glass or a door in an opening, and what surrounds it.
    fn fill(&mut self, o: &Opening, door: bool) {
        let (w, h) = (o.high[0] - o.low[0], o.high[1] - o.low[1]);
        let corner = |z: f32| Vec3::new(o.low[0], o.low[1], z);
        let pane = if door { &mut self.wood } else { &mut self.glass };
        pane.rectangle(corner(-0.18), Vec3::X * w, Vec3::Y * h);
        if door {
            for (x, y) in [(0.12, 0.25), (0.56, 0.25), (0.12, 1.3), (0.56, 1.3)] {
                let low = corner(-0.18) + Vec3::new(x * w, y, 0.0);
                attached(&mut self.wood, low, low + Vec3::new(0.32 * w, 0.85, 0.04));
            }
        } else {
            // The bars end inside the masonry.
            self.wood.block(corner(-0.16) + Vec3::new(w / 2.0 - 0.03, -0.02, 0.0), corner(-0.11) + Vec3::new(w / 2.0 + 0.03, h + 0.02, 0.0));
            let bar = h * if o.arched { 0.55 } else { 0.62 };
            self.wood.block(corner(-0.155) + Vec3::new(-0.02, bar, 0.0), corner(-0.1) + Vec3::new(w + 0.02, bar + 0.06, 0.0));
            attached(&mut self.trim, corner(0.0) - Vec3::new(0.12, 0.13, 0.0), corner(0.16) + Vec3::new(w + 0.12, -0.01, 0.0));
        }
        if !o.arched {
            let top = Vec3::new(o.low[0] - 0.12, o.high[1] + 0.02, 0.0);
            attached(&mut self.trim, top, top + Vec3::new(w + 0.24, 0.18, 0.07));
        }
    }

    /// A louvred shutter, 0.5 m x 1.6 m.
    fn shutter(&mut self, x: f32, y: f32) {
        attached(&mut self.shutters, Vec3::new(x, y, 0.0), Vec3::new(x + 0.5, y + 1.6, 0.03));
        for slat in 0..8 {
            let low = Vec3::new(x + 0.06, y + 0.1 + 0.18 * slat as f32, 0.03);
            attached(&mut self.shutters, low, low + Vec3::new(0.38, 0.09, 0.025));
        }
    }

    /// A gabled roof of wavy tiles, its ridge along x; eaves reach 40 cm beyond the walls.
    fn cover(&mut self, plan: &Plan, height: f32) {
        const EAVES: f32 = 0.4;
        let (w, half) = (plan.width, plan.depth / 2.0);
        let drop = EAVES * plan.roof / half;
        let waves = (w / 0.45).round();
        let tile = |p: Vec2| 0.035 * cos(p.x * waves * std::f32::consts::TAU) - 0.05 * (p.y * 6.0).fract() + 0.06;
        for (corner, u) in [(Vec3::new(0.0, height - drop, EAVES), Vec3::X * w), (Vec3::new(w, height - drop, -plan.depth - EAVES), Vec3::NEG_X * w)] {
            let up = Vec3::new(0.0, plan.roof + drop, if u.x > 0.0 { -half - EAVES } else { half + EAVES });
            self.roof.grid(corner, u, up, [waves as u32 * 4, 6], tile);
            // Bargeboards and a gutter, 16 cm thick; 3 cm beyond the walls, so that nothing is in one plane.
            let inset = u.normalize() * 0.05;
            for [from, to] in [[corner + inset * 2.0, corner + u - inset * 2.0], [corner + inset, corner + inset + up], [corner + u - inset, corner + u - inset + up]] {
                self.trim.bar(from, to, 0.16);
            }
            // The soffit under the eaves.
            self.trim.polygon(&[corner + u, corner, corner + up.normalize() * EAVES, corner + u + up.normalize() * EAVES]);
        }
        let ridge = |x: f32| Vec3::new(x, height + plan.roof, -half);
        self.walls.polygon(&[Vec3::new(w, height, 0.0), Vec3::new(w, height, -plan.depth), ridge(w)]);
        self.walls.polygon(&[Vec3::new(0.0, height, -plan.depth), Vec3::new(0.0, height, 0.0), ridge(0.0)]);
    }

    fn place(&self, build: &mut Builder, m: &Materials, name: &str, walls: usize, at: Vec3, degrees: f32) {
        let textured = |shape: &Shape, size: f32| shape.clone().textured(size);
        let mesh = build.mesh(
            name,
            &[
                (&textured(&self.walls, 1.6), walls),
                (&self.trim, m.stone),
                (&self.glass, m.glass),
                (&textured(&self.wood, 1.0), m.wood),
                (&self.shutters, m.green),
                (&self.roof, m.tiles),
            ],
        );
        build.place(name, mesh, at, turned(degrees), Vec3::ONE);
    }
}

/// A box on a wall that faces +Z: all faces but the rear one.
fn attached(shape: &mut Shape, low: Vec3, high: Vec3) {
    let s = high - low;
    let (x, y, z) = (Vec3::X * s.x, Vec3::Y * s.y, Vec3::Z * s.z);
    shape.rectangle(low + z, x, y);
    shape.rectangle(low, z, y);
    shape.rectangle(low + x + z, -z, y);
    shape.rectangle(low + y + z, x, -z);
    shape.rectangle(low, x, z);
}

fn houses(build: &mut Builder, m: &Materials) {
    let plan = |width: f32, storeys: u32, bays: u32, roof: f32| Plan { width, depth: 9.0, storeys, bays, roof, arched: false };
    // South, seen from its back by the default camera.
    for (n, (x, storeys)) in [(21.9, 3), (10.95, 2), (0.0, 3), (-10.95, 2)].into_iter().enumerate() {
        let house = House::new(&plan(10.88, storeys, 4, 3.0));
        let walls = if n == 2 { m.brick } else { m.stucco[n] };
        house.place(build, m, "south house", walls, Vec3::new(x, 0.0, 18.0), 180.0);
    }
    // East, with shops.
    for (n, (z, storeys)) in [(18.0, 3), (6.0, 4), (-6.0, 3)].into_iter().enumerate() {
        let house = House::new(&plan(11.9, storeys, 4, 2.6));
        let walls = [m.stucco[2], m.brick, m.stucco[0]][n];
        // Quarter turns: the front of the house faces -X.
        let at = Vec3::new(22.0, 0.0, z - 11.95);
        house.place(build, m, "east house", walls, at, -90.0);
        for bay in [0.5f32, 2.5] {
            let along = at + Vec3::Z * (2.975 * bay);
            shop(build, m, along, n);
        }
    }
    // North: the town hall between two houses.
    for (n, x) in [-21.9, 11.9].into_iter().enumerate() {
        let house = House::new(&plan(10.0, 3, 4, 3.0));
        house.place(build, m, "north house", [m.stucco[1], m.stucco[3]][n], Vec3::new(x, 0.0, -18.0), 0.0);
    }
    let hall = House::new(&Plan { width: 21.0, depth: 9.0, storeys: 3, bays: 7, roof: 3.4, arched: true });
    hall.place(build, m, "town hall", m.stone, Vec3::new(-10.5, 0.0, -18.5), 0.0);
    tower(build, m);
    let mut lantern = shade();
    lantern.bar(Vec3::new(0.0, 0.25, 0.02), Vec3::new(0.0, 0.25, -0.95), 0.03);
    let lantern = build.mesh("lantern shade", &[(&lantern, m.iron)]);
    for (n, x) in [-20.5f32, -13.5, -9.0, -3.0, 3.0, 9.0, 13.5, 20.5].into_iter().enumerate() {
        let at = Vec3::new(x, 3.75, -17.6);
        let glow = Glow { color: [1.0, 0.72, 0.42], intensity: 320.0 };
        build.spot(&format!("wall lantern {n}"), [at, at + Vec3::new(0.0, -3.0, 0.8)], glow, [0.5, 1.1], None);
        build.place("lantern shade", lantern, at + Vec3::Y * 0.02, Quat::IDENTITY, Vec3::ONE);
    }
}

/// A cone of sheet iron over a lamp at the origin, seen from both sides.
fn shade() -> Shape {
    let mut shade = lathe(&curve(&[[0.3, 0.0], [0.26, 0.12], [0.1, 0.2], [0.03, 0.24]], 2), 20);
    shade.append(&lathe(&curve(&[[0.295, 0.0], [0.25, 0.11], [0.09, 0.19], [0.0, 0.2]], 2), 20).inverted());
    shade
}

/// A clock tower on the town hall's roof.
fn tower(build: &mut Builder, m: &Materials) {
    let mut shape = Shape::default();
    shape.standing_box(Vec3::new(-2.2, 9.0, -25.2), Vec3::new(2.2, 19.0, -20.8));
    shape.block(Vec3::new(-2.5, 18.9, -25.5), Vec3::new(2.5, 19.5, -20.5));
    build.object("tower", &shape.textured(1.6), m.brick);
    let roof = lathe(&[[2.9, 19.5], [1.6, 21.5], [0.0, 26.0]], 4).transformed(Affine3A::from_translation(Vec3::new(0.0, 0.0, -23.0)) * Affine3A::from_quat(turned(45.0)));
    build.object("tower roof", &roof, m.tiles);
    let upright = Affine3A::from_translation(Vec3::new(0.0, 16.5, -20.8)) * Affine3A::from_quat(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
    let dial = lathe(&curve(&[[1.5, 0.0], [1.5, 0.08], [1.4, 0.12], [1.3, 0.06], [0.0, 0.05]], 2), 48);
    build.object("clock", &dial.transformed(upright), m.stucco[2]);
    let mut hands = Shape::default();
    for (degrees, length) in [(25.0f32, 1.1), (140.0, 0.75)] {
        let (s, c) = (sin(degrees.to_radians()), cos(degrees.to_radians()));
        let at = Vec3::new(0.0, 16.5, -20.68);
        hands.bar(at, at + Vec3::new(s * length, c * length, 0.0), 0.06);
    }
    build.object("clock hands", &hands, m.iron);
}

/// A lit window and an awning over it, on the east side; `at` is the middle of the bay on the ground.
fn shop(build: &mut Builder, m: &Materials, at: Vec3, n: usize) {
    let mut window = Shape::default();
    window.rectangle(Vec3::new(-0.95, 0.65, -0.08), Vec3::X * 1.9, Vec3::Y * 2.2);
    let mesh = build.mesh("shop window", &[(&window, m.shop)]);
    build.place("shop window", mesh, at, turned(-90.0), Vec3::ONE);
    let mut awning = Shape::default();
    awning.grid(Vec3::new(-1.6, 2.95, 1.5), Vec3::X * 3.2, Vec3::new(0.0, 0.62, -1.48), [16, 6], |p| 0.08 * (p.y - p.y * p.y));
    awning.grid(Vec3::new(-1.6, 2.7, 1.5), Vec3::X * 3.2, Vec3::Y * 0.25, [32, 2], |p| 0.02 * sin(p.x * 60.0) * (1.0 - p.y));
    let mesh = build.mesh("awning", &[(&awning.textured(0.8), m.cloth[n % 2])]);
    build.place("awning", mesh, at, turned(-90.0), Vec3::ONE);
}

/// The market hall on the west side: arches behind columns, with pendants inside.
fn colonnade(build: &mut Builder, m: &Materials) {
    let arches: Vec<Opening> =
        (0..9).map(|n| 0.5 + 4.0 * n as f32).map(|u| Opening { low: [u, 0.0], high: [u + 3.0, 4.8], arched: true }).collect();
    let front = wall(36.0, 7.0, 0.6, &arches, Some(6.2));
    let mesh = build.mesh("arcade", &[(&front, m.stone)]);
    build.place("arcade", mesh, Vec3::new(-22.0, 0.0, 18.0), turned(90.0), Vec3::ONE);

    let mut rest = Shape::default();
    let (low, high) = (Vec3::new(-28.0, 0.0, -18.0), Vec3::new(-22.6, 6.2, 18.0));
    rest.rectangle(low + Vec3::Z * 36.0, Vec3::NEG_Z * 36.0, Vec3::Y * 6.2);
    rest.rectangle(low, Vec3::X * 5.4, Vec3::Y * 6.2);
    rest.rectangle(high - Vec3::Y * 6.2, Vec3::NEG_X * 5.4, Vec3::Y * 6.2);
    rest.rectangle(low + Vec3::Y * 6.2, Vec3::X * 5.4, Vec3::Z * 36.0);
    rest.rectangle(Vec3::new(-28.2, 7.0, 18.2), Vec3::X * 6.2, Vec3::NEG_Z * 36.4);
    // The outside, seen from the streets and by the sun.
    rest.rectangle(Vec3::new(-28.2, 0.0, 18.2), Vec3::X * 6.2, Vec3::Y * 7.0);
    rest.rectangle(Vec3::new(-22.0, 0.0, -18.2), Vec3::NEG_X * 6.2, Vec3::Y * 7.0);
    rest.rectangle(Vec3::new(-28.2, 0.0, -18.2), Vec3::Z * 36.4, Vec3::Y * 7.0);
    for z in [-18.0, 18.2] {
        rest.rectangle(Vec3::new(-22.0, 0.0, z), Vec3::NEG_Z * 0.2, Vec3::Y * 7.0);
    }
    build.object("market hall", &rest, m.stucco[0]);
    let mut frieze = Shape::default();
    attached(&mut frieze, Vec3::new(0.05, 5.29, 0.0), Vec3::new(35.95, 5.8, 1.0));
    attached(&mut frieze, Vec3::new(0.05, 6.6, 0.0), Vec3::new(35.95, 7.1, 0.5));
    let mesh = build.mesh("entablature", &[(&frieze, m.stone)]);
    build.place("entablature", mesh, Vec3::new(-22.0, 0.0, 18.0), turned(90.0), Vec3::ONE);

    let mut profile = vec![[0.42, 0.0], [0.42, 0.15]];
    profile.extend(curve(&[[0.4, 0.15], [0.43, 0.22], [0.35, 0.3], [0.33, 0.36]], 3));
    profile.extend((0..=10).map(|i| i as f32 / 10.0).map(|t| [0.32 - 0.05 * t * t, 0.4 + 4.3 * t]));
    profile.extend(curve(&[[0.27, 4.75], [0.3, 4.9], [0.4, 5.1], [0.42, 5.2]], 3));
    profile.push([0.42, 5.3]);
    let column = build.mesh("column", &[(&lathe(&profile, 30), m.stone)]);
    for n in 0..10 {
        build.place("column", column, Vec3::new(-21.5, 0.0, 18.0 - 4.0 * n as f32), Quat::IDENTITY, Vec3::ONE);
    }
    let mut shade = shade();
    shade.append(&tube(&[Vec3::Y * 0.24, Vec3::Y * 1.9], &[0.015], 6, false));
    let shade = build.mesh("pendant", &[(&shade, m.iron)]);
    for n in 0..8 {
        let at = Vec3::new(-25.3, 4.2, 14.0 - 4.0 * n as f32);
        build.place("pendant", shade, at, Quat::IDENTITY, Vec3::ONE);
        build.point("pendant lamp", at + Vec3::Y * 0.03, Glow { color: [1.0, 0.74, 0.45], intensity: 220.0 });
    }
}

fn fountain(build: &mut Builder, m: &Materials) {
    let rim = [[4.2, 0.0], [4.2, 0.18], [3.9, 0.2], [3.8, 0.35], [3.75, 0.6], [3.95, 0.7], [3.95, 0.82], [3.6, 0.84], [3.5, 0.7], [3.4, 0.42]];
    build.object("fountain basin", &lathe(&curve(&rim, 4), 56), m.stone);
    build.object("fountain water", &lathe(&[[3.45, 0.5], [0.0, 0.5]], 72), m.water);
    let stem = [[0.9, 0.3], [0.8, 0.7], [0.4, 0.9], [0.32, 1.5], [0.5, 1.75], [1.4, 2.0], [1.9, 2.25], [1.88, 2.32], [1.7, 2.26], [1.0, 2.1], [0.3, 2.1], [0.26, 2.7], [0.42, 2.9], [0.4, 2.96], [0.0, 2.96]];
    build.object("fountain stem", &lathe(&curve(&stem, 4), 48), m.stone);
    let figure = bust_of_a_founder();
    build.object("founder", &figure.at(0.0, 2.96, 0.0), m.bronze);
}

/// The museum's bust, twice its size, turned to the camera.
fn bust_of_a_founder() -> Shape {
    let turn = turned(40.0);
    bust(1, 3).transformed(Affine3A::from_scale_rotation_translation(Vec3::splat(2.2), turn, Vec3::ZERO))
}

fn greenery(build: &mut Builder, m: &Materials) {
    let crown = |seed: u32| {
        let mut shape = Shape::default();
        for blob in 0..4u32 {
            let k = seed * 4 + blob;
            let size = 1.1 + 0.5 * chance(41, k);
            let at = Vec3::new(1.6 * chance(42, k) - 0.8, 3.6 + 1.0 * blob as f32 * 0.6, 1.6 * chance(43, k) - 0.8);
            shape.append(&icosphere(3).bent(|p, n| p * size + n * 0.14 * (sin(9.0 * p.x + k as f32) + sin(11.0 * p.y) + sin(10.0 * p.z))).at(at.x, at.y, at.z));
        }
        shape
    };
    let trunk: Vec<Vec3> = curve(&[[0.0, 0.0, 0.0], [0.06, 0.4, 0.02], [-0.04, 1.6, 0.05], [0.05, 3.4, 0.0]], 4).into_iter().map(Vec3::from).collect();
    let radii: Vec<f32> = (0..trunk.len()).map(|i| 0.2 - 0.007 * i as f32 + if i == 0 { 0.12 } else { 0.0 }).collect();
    let trunk = tube(&trunk, &radii, 14, false);
    let meshes: Vec<usize> = (0..2).map(|seed| build.mesh("tree", &[(&trunk, m.bark), (&crown(seed), m.leaves)])).collect();
    for (n, (x, z)) in [(-13.0, -11.0), (-13.0, 0.0), (-13.0, 11.0), (13.0, -11.0), (13.0, 0.5), (6.5, 12.5), (-6.5, 12.5), (4.5, -12.5)].into_iter().enumerate() {
        build.place("tree", meshes[n % 2], Vec3::new(x, 0.0, z), turned(77.0 * n as f32), Vec3::ONE);
    }
    let pot = lathe(&curve(&[[0.2, 0.0], [0.3, 0.4], [0.34, 0.45], [0.3, 0.46], [0.27, 0.38], [0.0, 0.36]], 2), 20);
    let bush = icosphere(2).bent(|p, n| p * 0.36 + n * 0.05 * (sin(9.0 * p.x) + sin(8.0 * p.z + 2.0 * p.y))).at(0.0, 0.62, 0.0);
    let pot = build.mesh("potted bush", &[(&pot, m.clay), (&bush, m.leaves)]);
    for n in 0..10 {
        let (x, z) = if n < 6 { (-8.5 + 3.4 * n as f32, -17.2) } else { (20.6, -14.4 + 8.0 * (n - 6) as f32) };
        build.place("potted bush", pot, Vec3::new(x, 0.0, z), turned(50.0 * n as f32), Vec3::ONE);
    }
}

/// Lamps, benches, bollards and market stalls.
fn furniture(build: &mut Builder, m: &Materials) {
    let post = lathe(&curve(&[[0.24, 0.0], [0.22, 0.25], [0.1, 0.35], [0.07, 0.9], [0.06, 2.2], [0.055, 3.2], [0.1, 3.3], [0.12, 3.42]], 2), 16);
    let cap = lathe(&[[0.13, 3.82], [0.05, 3.95], [0.0, 4.05]], 16);
    let mut iron = post;
    iron.append(&cap);
    let globe = icosphere(2).transformed(Affine3A::from_scale_rotation_translation(Vec3::splat(0.2), Quat::IDENTITY, Vec3::Y * 3.62));
    let lamp = build.mesh("street lamp", &[(&iron, m.iron), (&globe, m.globe)]);
    for n in 0..12 {
        let angle = (n as f32 * 30.0 + 15.0).to_radians();
        build.place("street lamp", lamp, Vec3::new(16.5 * cos(angle), 0.0, 13.5 * sin(angle)), Quat::IDENTITY, Vec3::ONE);
    }
    let mut bench = Shape::default();
    for i in 0..4 {
        bench.block(Vec3::new(-0.9, 0.42, -0.25 + 0.12 * i as f32), Vec3::new(0.9, 0.46, -0.15 + 0.12 * i as f32));
    }
    for i in 0..3 {
        bench.block(Vec3::new(-0.9, 0.55 + 0.13 * i as f32, -0.32), Vec3::new(0.9, 0.65 + 0.13 * i as f32, -0.28));
    }
    let mut legs = Shape::default();
    for x in [-0.7, 0.64] {
        legs.standing_box(Vec3::new(x, 0.0, -0.25), Vec3::new(x + 0.06, 0.44, -0.19));
        legs.standing_box(Vec3::new(x, 0.0, 0.12), Vec3::new(x + 0.06, 0.44, 0.18));
    }
    let bench = build.mesh("bench", &[(&bench.textured(0.6), m.wood), (&legs, m.iron)]);
    let bollard = build.mesh("bollard", &[(&lathe(&curve(&[[0.14, 0.0], [0.13, 0.1], [0.08, 0.16], [0.08, 0.65], [0.11, 0.72], [0.07, 0.84], [0.0, 0.88]], 2), 16), m.iron)]);
    for n in 0..8 {
        let angle = (n as f32 * 45.0 + 22.5).to_radians();
        let out = Vec3::new(6.2 * cos(angle), 0.0, 6.2 * sin(angle));
        build.place("bench", bench, out, turned(90.0 - n as f32 * 45.0 - 22.5), Vec3::ONE);
        build.place("bollard", bollard, Vec3::new(-19.5, 0.0, -14.0 + 4.0 * n as f32), Quat::IDENTITY, Vec3::ONE);
        build.place("bollard", bollard, Vec3::new(-14.0 + 4.0 * n as f32, 0.0, 16.2), Quat::IDENTITY, Vec3::ONE);
    }
    stalls(build, m);
}

fn stalls(build: &mut Builder, m: &Materials) {
    let mut frame = Shape::default();
    for (x, z) in [(-1.4, -0.9), (1.34, -0.9), (-1.4, 0.84), (1.34, 0.84)] {
        frame.standing_box(Vec3::new(x, 0.0, z), Vec3::new(x + 0.06, 2.3, z + 0.06));
    }
    frame.block(Vec3::new(-1.33, 0.78, -0.83), Vec3::new(1.33, 0.84, 0.83));
    let mut canopy = Shape::default();
    for (z, up) in [(1.15, Vec3::new(0.0, 0.55, -1.15)), (-1.15, Vec3::new(0.0, 0.55, 1.15))] {
        let (corner, along) = if z > 0.0 { (Vec3::new(-1.6, 2.3, z), Vec3::X * 3.2) } else { (Vec3::new(1.6, 2.3, z), Vec3::NEG_X * 3.2) };
        canopy.grid(corner, along, up, [16, 4], |p| 0.1 * (p.y * p.y - p.y));
    }
    let mut goods = Shape::default();
    let fruit = icosphere(1);
    for n in 0..40u32 {
        let (x, z) = ((n % 8) as f32 * 0.2 - 0.72 + 0.03 * chance(50, n), (n / 8) as f32 * 0.2 - 0.5 + 0.03 * chance(51, n));
        goods.append(&fruit.clone().transformed(Affine3A::from_scale_rotation_translation(Vec3::splat(0.08), Quat::IDENTITY, Vec3::new(x, 0.92, z))));
    }
    for (n, (x, z)) in [(-17.0, 6.0), (-17.0, -5.0), (8.5, -6.5), (11.5, 7.0)].into_iter().enumerate() {
        let mesh = build.mesh("market stall", &[(&frame.clone().textured(0.6), m.wood), (&canopy.clone().textured(0.8), m.cloth[n % 2]), (&goods, m.fruit)]);
        build.place("market stall", mesh, Vec3::new(x, 0.0, z), turned(if n < 2 { 90.0 } else { 30.0 * n as f32 }), Vec3::ONE);
    }
}

//! A house: a front with windows, doors and shutters under a gabled roof of tiles.

use glam::{Vec2, Vec3};

use super::materials::Materials;
use crate::scene::builtin::{
    build::{Builder, turned},
    masonry::{Opening, wall},
    shape::Shape,
    turning::cos,
};

const GROUND: f32 = 3.9;

const STOREY: f32 = 3.1;

/// A house by material. It stands with its front on z = 0, from x = 0 on, and reaches back to negative z.
#[derive(Default)]
pub(super) struct House {
    walls: Shape,
    trim: Shape,
    glass: Shape,
    wood: Shape,
    shutters: Shape,
    roof: Shape,
}

/// What a house looks like.
pub(super) struct Plan {
    pub width: f32,
    pub depth: f32,
    pub storeys: u32,
    pub bays: u32,
    pub roof: f32,
    pub arched: bool,
}

impl House {
    pub fn new(plan: &Plan) -> Self {
        let mut house = Self::default();
        let height = GROUND + STOREY * (plan.storeys - 1) as f32;
        let bay = plan.width / plan.bays as f32;
        let mut openings = Vec::new();
        for b in 0..plan.bays {
            let u = (b as f32 + 0.5) * bay;
            let half = if plan.arched {
                (bay * 0.36).min(1.3)
            } else {
                1.0
            };
            let door = plan.arched || b % 2 == 1;
            let ground = Opening {
                low: [u - half, if door { 0.0 } else { 0.6 }],
                high: [u + half, if plan.arched { 3.5 } else { 2.9 }],
                arched: plan.arched,
            };
            openings.push(ground);
            house.fill(&ground, door);
            for s in 1..plan.storeys {
                let base = GROUND + STOREY * (s - 1) as f32;
                let window = Opening {
                    low: [u - 0.5, base + 0.75],
                    high: [u + 0.5, base + 2.35],
                    arched: plan.arched,
                };
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
            attached(
                &mut house.trim,
                Vec3::new(0.0, y, 0.0),
                Vec3::new(plan.width, y + 0.2, 0.14),
            );
        }
        house.walls.rectangle(
            Vec3::new(plan.width, 0.0, 0.0),
            Vec3::NEG_Z * plan.depth,
            Vec3::Y * height,
        );
        house.walls.rectangle(
            Vec3::new(plan.width, 0.0, -plan.depth),
            Vec3::NEG_X * plan.width,
            Vec3::Y * height,
        );
        house.walls.rectangle(
            Vec3::new(0.0, 0.0, -plan.depth),
            Vec3::Z * plan.depth,
            Vec3::Y * height,
        );
        house.cover(plan, height);
        house
    }

    /// Glass or a door in an opening, and what surrounds it.
    fn fill(&mut self, o: &Opening, door: bool) {
        let (w, h) = (o.high[0] - o.low[0], o.high[1] - o.low[1]);
        let corner = |z: f32| Vec3::new(o.low[0], o.low[1], z);
        let pane = if door {
            &mut self.wood
        } else {
            &mut self.glass
        };
        pane.rectangle(corner(-0.18), Vec3::X * w, Vec3::Y * h);
        if door {
            for (x, y) in [(0.12, 0.25), (0.56, 0.25), (0.12, 1.3), (0.56, 1.3)] {
                let low = corner(-0.18) + Vec3::new(x * w, y, 0.0);
                attached(&mut self.wood, low, low + Vec3::new(0.32 * w, 0.85, 0.04));
            }
        } else {
            // The bars end inside the masonry.
            self.wood.block(
                corner(-0.16) + Vec3::new(w / 2.0 - 0.03, -0.02, 0.0),
                corner(-0.11) + Vec3::new(w / 2.0 + 0.03, h + 0.02, 0.0),
            );
            let bar = h * if o.arched { 0.55 } else { 0.62 };
            self.wood.block(
                corner(-0.155) + Vec3::new(-0.02, bar, 0.0),
                corner(-0.1) + Vec3::new(w + 0.02, bar + 0.06, 0.0),
            );
            attached(
                &mut self.trim,
                corner(0.0) - Vec3::new(0.12, 0.13, 0.0),
                corner(0.16) + Vec3::new(w + 0.12, -0.01, 0.0),
            );
        }
        if !o.arched {
            let top = Vec3::new(o.low[0] - 0.12, o.high[1] + 0.02, 0.0);
            attached(&mut self.trim, top, top + Vec3::new(w + 0.24, 0.18, 0.07));
        }
    }

    /// A louvred shutter, 0.5 m x 1.6 m.
    fn shutter(&mut self, x: f32, y: f32) {
        attached(
            &mut self.shutters,
            Vec3::new(x, y, 0.0),
            Vec3::new(x + 0.5, y + 1.6, 0.03),
        );
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
        let tile = |p: Vec2| {
            0.035 * cos(p.x * waves * std::f32::consts::TAU) - 0.05 * (p.y * 6.0).fract() + 0.06
        };
        for (corner, u) in [
            (Vec3::new(0.0, height - drop, EAVES), Vec3::X * w),
            (
                Vec3::new(w, height - drop, -plan.depth - EAVES),
                Vec3::NEG_X * w,
            ),
        ] {
            let up = Vec3::new(
                0.0,
                plan.roof + drop,
                if u.x > 0.0 {
                    -half - EAVES
                } else {
                    half + EAVES
                },
            );
            self.roof.grid(corner, u, up, [waves as u32 * 4, 6], tile);
            // Bargeboards and a gutter, 16 cm thick; 3 cm beyond the walls, so that nothing is in one plane.
            let inset = u.normalize() * 0.05;
            for [from, to] in [
                [corner + inset * 2.0, corner + u - inset * 2.0],
                [corner + inset, corner + inset + up],
                [corner + u - inset, corner + u - inset + up],
            ] {
                self.trim.bar(from, to, 0.16);
            }
            // The soffit under the eaves.
            self.trim.polygon(&[
                corner + u,
                corner,
                corner + up.normalize() * EAVES,
                corner + u + up.normalize() * EAVES,
            ]);
        }
        let ridge = |x: f32| Vec3::new(x, height + plan.roof, -half);
        self.walls.polygon(&[
            Vec3::new(w, height, 0.0),
            Vec3::new(w, height, -plan.depth),
            ridge(w),
        ]);
        self.walls.polygon(&[
            Vec3::new(0.0, height, -plan.depth),
            Vec3::new(0.0, height, 0.0),
            ridge(0.0),
        ]);
    }

    pub fn place(
        &self,
        build: &mut Builder,
        m: &Materials,
        name: &str,
        walls: usize,
        at: Vec3,
        degrees: f32,
    ) {
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
pub(super) fn attached(shape: &mut Shape, low: Vec3, high: Vec3) {
    let s = high - low;
    let (x, y, z) = (Vec3::X * s.x, Vec3::Y * s.y, Vec3::Z * s.z);
    shape.rectangle(low + z, x, y);
    shape.rectangle(low, z, y);
    shape.rectangle(low + x + z, -z, y);
    shape.rectangle(low + y + z, x, -z);
    shape.rectangle(low, x, z);
}

//! Triangle shapes out of flat pieces, and what can be done to any shape.

use glam::{Affine3A, Mat3, Vec2, Vec3};

/// Triangles on their way into a mesh, counter-clockwise seen from the front.
#[derive(Clone, Debug, Default)]
pub(super) struct Shape {
    /// Metres.
    pub positions: Vec<Vec3>,
    /// Unit, one per position.
    pub normals: Vec<Vec3>,
    /// One per position, or empty where no texture is used.
    pub uvs: Vec<Vec2>,
    /// Indices into `positions`.
    pub triangles: Vec<[u32; 3]>,
}

impl Shape {
    /// Adds a flat polygon (convex, counter-clockwise seen from the front) as a fan, with its geometric normal.
    pub fn polygon(&mut self, corners: &[Vec3]) {
        let first = self.positions.len() as u32;
        let normal = (corners[1] - corners[0])
            .cross(corners[2] - corners[0])
            .normalize();
        self.positions.extend_from_slice(corners);
        self.normals.resize(self.positions.len(), normal);
        self.triangles
            .extend((1..corners.len() as u32 - 1).map(|i| [first, first + i, first + i + 1]));
    }

    /// A rectangle from a corner along two edges; its front is where their cross product points.
    pub fn rectangle(&mut self, corner: Vec3, u: Vec3, v: Vec3) {
        self.polygon(&[corner, corner + u, corner + u + v, corner + v]);
    }

    /// Adds the five faces of a box that stands on the plane y = `low.y`: what it stands on sees no sixth.
    pub fn standing_box(&mut self, low: Vec3, high: Vec3) {
        let s = high - low;
        let (x, y, z) = (Vec3::X * s.x, Vec3::Y * s.y, Vec3::Z * s.z);
        self.rectangle(low + x + z, -z, y);
        self.rectangle(low, z, y);
        self.rectangle(low + z + y, x, -z);
        self.rectangle(low + z, x, y);
        self.rectangle(low + x, -x, y);
    }

    /// Adds all six faces of a box.
    pub fn block(&mut self, low: Vec3, high: Vec3) {
        self.standing_box(low, high);
        let s = high - low;
        self.rectangle(low, Vec3::X * s.x, Vec3::Z * s.z);
    }

    /// Adds a square bar of the given thickness between two points.
    pub fn bar(&mut self, from: Vec3, to: Vec3, thickness: f32) {
        let along = to - from;
        let side = along.any_orthogonal_vector().normalize() * thickness / 2.0;
        let up = along.cross(side).normalize() * thickness / 2.0;
        let corners = [side + up, up - side, -side - up, side - up];
        for i in 0..4 {
            let (a, b) = (corners[i], corners[(i + 1) % 4]);
            self.polygon(&[from + a, from + b, to + b, to + a]);
        }
        self.polygon(&corners.map(|c| to + c));
        self.polygon(&[3, 2, 1, 0].map(|i| from + corners[i]));
    }

    /// Adds a rectangle of `across` x `along` cells, lifted along its normal by `height` of the place within it (0..1).
    pub fn grid(
        &mut self,
        corner: Vec3,
        u: Vec3,
        v: Vec3,
        cells: [u32; 2],
        height: impl Fn(Vec2) -> f32,
    ) {
        let first = self.positions.len() as u32;
        let normal = u.cross(v).normalize();
        let at = |i: i32, j: i32| {
            let place = Vec2::new(i as f32 / cells[0] as f32, j as f32 / cells[1] as f32);
            corner + u * place.x + v * place.y + normal * height(place)
        };
        for j in 0..=cells[1] as i32 {
            for i in 0..=cells[0] as i32 {
                self.positions.push(at(i, j));
                let slope = (at(i + 1, j) - at(i - 1, j)).cross(at(i, j + 1) - at(i, j - 1));
                self.normals.push(slope.normalize());
            }
        }
        let row = cells[0] + 1;
        for j in 0..cells[1] {
            for i in 0..cells[0] {
                let a = first + j * row + i;
                self.triangles
                    .extend([[a, a + 1, a + 1 + row], [a, a + 1 + row, a + row]]);
            }
        }
    }

    /// Adds all of another shape. Texture coordinates survive where both have some.
    pub fn append(&mut self, other: &Shape) {
        let first = self.positions.len() as u32;
        self.positions.extend_from_slice(&other.positions);
        self.normals.extend_from_slice(&other.normals);
        self.uvs.extend_from_slice(&other.uvs);
        self.triangles
            .extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
    }

    /// Turns the front into the back.
    pub fn inverted(mut self) -> Self {
        self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        self.normals.iter_mut().for_each(|n| *n = -*n);
        self
    }

    /// The shape moved. The transform must not mirror.
    pub fn transformed(mut self, transform: Affine3A) -> Self {
        let normal = Mat3::from(transform.matrix3).inverse().transpose();
        self.positions
            .iter_mut()
            .for_each(|p| *p = transform.transform_point3(*p));
        self.normals
            .iter_mut()
            .for_each(|n| *n = (normal * *n).normalize_or_zero());
        self
    }

    /// The shape moved without turning it.
    pub fn at(self, x: f32, y: f32, z: f32) -> Self {
        self.transformed(Affine3A::from_translation(Vec3::new(x, y, z)))
    }

    /// Every vertex moved by a function of its place and normal; the normals follow the new surface.
    pub fn bent(mut self, move_to: impl Fn(Vec3, Vec3) -> Vec3) -> Self {
        let moved = self
            .positions
            .iter()
            .zip(&self.normals)
            .map(|(p, n)| move_to(*p, *n))
            .collect();
        self.positions = moved;
        self.normals = vec![Vec3::ZERO; self.positions.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|v| self.positions[v as usize]);
            // Not normalized: larger triangles count more.
            let normal = (b - a).cross(c - a);
            t.iter().for_each(|v| self.normals[*v as usize] += normal);
        }
        self.normals
            .iter_mut()
            .for_each(|n| *n = n.normalize_or_zero());
        self
    }

    /// Texture coordinates by projection along the axis that a vertex's normal is nearest to, one repeat per `size` metres.
    pub fn textured(mut self, size: f32) -> Self {
        let project = |(p, n): (&Vec3, &Vec3)| {
            let n = n.abs();
            let flat = if n.y >= n.x && n.y >= n.z {
                Vec2::new(p.x, p.z)
            } else if n.x >= n.z {
                Vec2::new(p.z, -p.y)
            } else {
                Vec2::new(p.x, -p.y)
            };
            flat / size
        };
        self.uvs = self
            .positions
            .iter()
            .zip(&self.normals)
            .map(project)
            .collect();
        self
    }

    pub(super) fn extent(&self) -> [Vec3; 2] {
        let empty = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        self.positions
            .iter()
            .fold(empty, |[min, max], p| [min.min(*p), max.max(*p)])
    }
}

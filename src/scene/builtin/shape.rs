//! Triangle shapes: flat ones, turned ones, bent ones, and walls with openings.

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
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
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
    pub fn grid(&mut self, corner: Vec3, u: Vec3, v: Vec3, cells: [u32; 2], height: impl Fn(Vec2) -> f32) {
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
                self.triangles.extend([[a, a + 1, a + 1 + row], [a, a + 1 + row, a + row]]);
            }
        }
    }

    /// Adds all of another shape. Texture coordinates survive where both have some.
    pub fn append(&mut self, other: &Shape) {
        let first = self.positions.len() as u32;
        self.positions.extend_from_slice(&other.positions);
        self.normals.extend_from_slice(&other.normals);
        self.uvs.extend_from_slice(&other.uvs);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
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
        self.positions.iter_mut().for_each(|p| *p = transform.transform_point3(*p));
        self.normals.iter_mut().for_each(|n| *n = (normal * *n).normalize_or_zero());
        self
    }

    /// The shape moved without turning it.
    pub fn at(self, x: f32, y: f32, z: f32) -> Self {
        self.transformed(Affine3A::from_translation(Vec3::new(x, y, z)))
    }

    /// Every vertex moved by a function of its place and normal; the normals follow the new surface.
    pub fn bent(mut self, move_to: impl Fn(Vec3, Vec3) -> Vec3) -> Self {
        let moved = self.positions.iter().zip(&self.normals).map(|(p, n)| move_to(*p, *n)).collect();
        self.positions = moved;
        self.normals = vec![Vec3::ZERO; self.positions.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|v| self.positions[v as usize]);
            // Not normalized: larger triangles count more.
            let normal = (b - a).cross(c - a);
            t.iter().for_each(|v| self.normals[*v as usize] += normal);
        }
        self.normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
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
        self.uvs = self.positions.iter().zip(&self.normals).map(project).collect();
        self
    }

    pub(super) fn extent(&self) -> [Vec3; 2] {
        let empty = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        self.positions.iter().fold(empty, |[min, max], p| [min.min(*p), max.max(*p)])
    }
}

/// The sine of an angle in radians, rounded from double precision: the same on every platform.
pub(super) fn sin(angle: f32) -> f32 {
    f64::from(angle).sin() as f32
}

/// The cosine, as [`sin`].
pub(super) fn cos(angle: f32) -> f32 {
    f64::from(angle).cos() as f32
}

/// A profile of (radius, height) turned around Y; going up, its outside is the front. Bends of more than 40 degrees are sharp.
pub(super) fn lathe(profile: &[[f32; 2]], segments: u32) -> Shape {
    let mut shape = Shape::default();
    let mut profile = profile.to_vec();
    profile.dedup_by(|a, b| (a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-5);
    let normals: Vec<Vec2> = profile
        .windows(2)
        .map(|p| Vec2::new(p[1][1] - p[0][1], p[0][0] - p[1][0]).normalize_or_zero())
        .collect();
    // A vertex belongs to the smooth run that its segment lies in.
    let normal_at = |segment: usize, end: usize| {
        let own = normals[segment];
        let other = if end == segment { segment.checked_sub(1) } else { Some(segment + 1) };
        match other.and_then(|other| normals.get(other)) {
            Some(other) if own.dot(*other) > 0.766 => (own + *other).normalize(),
            _ => own,
        }
    };
    let ring = |shape: &mut Shape, [radius, height]: [f32; 2], normal: Vec2| {
        let first = shape.positions.len() as u32;
        for i in 0..segments {
            let angle = i as f32 / segments as f32 * std::f32::consts::TAU;
            let (s, c) = (sin(angle), cos(angle));
            shape.positions.push(Vec3::new(c * radius, height, s * radius));
            shape.normals.push(Vec3::new(c * normal.x, normal.y, s * normal.x));
        }
        first
    };
    let mut last: Option<(u32, Vec2)> = None;
    for segment in 0..profile.len() - 1 {
        let (low, high) = (normal_at(segment, segment), normal_at(segment, segment + 1));
        let a = match last {
            Some((ring, normal)) if normal == low => ring,
            _ => ring(&mut shape, profile[segment], low),
        };
        let b = ring(&mut shape, profile[segment + 1], high);
        for i in 0..segments {
            let j = (i + 1) % segments;
            if profile[segment][0] > 0.0 {
                shape.triangles.push([a + i, b + j, a + j]);
            }
            if profile[segment + 1][0] > 0.0 {
                shape.triangles.push([a + i, b + i, b + j]);
            }
        }
        last = Some((b, high));
    }
    shape
}

/// A smooth curve through the given points, `steps` pieces between two of them (Catmull and Rom 1974).
pub(super) fn curve<const N: usize>(points: &[[f32; N]], steps: u32) -> Vec<[f32; N]> {
    let mut out = Vec::new();
    let point = |i: isize| points[i.clamp(0, points.len() as isize - 1) as usize];
    for i in 0..points.len() as isize - 1 {
        let [a, b, c, d] = [point(i - 1), point(i), point(i + 1), point(i + 2)];
        for step in 0..steps {
            let t = step as f32 / steps as f32;
            out.push(std::array::from_fn(|k| {
                let (a, b, c, d) = (a[k], b[k], c[k], d[k]);
                0.5 * (2.0 * b + (c - a) * t + (2.0 * a - 5.0 * b + 4.0 * c - d) * t * t + (3.0 * (b - c) + d - a) * t * t * t)
            }));
        }
    }
    out.push(points[points.len() - 1]);
    out
}

/// A round tube along a path, its radius given at every point. An open one has no caps: taper its ends.
pub(super) fn tube(path: &[Vec3], radii: &[f32], sides: u32, closed: bool) -> Shape {
    let mut shape = Shape::default();
    let count = path.len();
    let tangent = |i: usize| {
        let (before, after) = if closed {
            (path[(i + count - 1) % count], path[(i + 1) % count])
        } else {
            (path[i.saturating_sub(1)], path[(i + 1).min(count - 1)])
        };
        (after - before).normalize_or(Vec3::Y)
    };
    // The frame is carried along, so that the tube does not twist.
    let mut side = tangent(0).any_orthonormal_vector();
    for i in 0..count {
        let along = tangent(i);
        side = (side - along * side.dot(along)).normalize_or(along.any_orthonormal_vector());
        let up = along.cross(side);
        for k in 0..sides {
            let angle = k as f32 / sides as f32 * std::f32::consts::TAU;
            let normal = side * cos(angle) + up * sin(angle);
            shape.positions.push(path[i] + normal * radii[i.min(radii.len() - 1)]);
            shape.normals.push(normal);
        }
    }
    let last = if closed { count } else { count - 1 };
    for i in 0..last as u32 {
        let (a, b) = (i * sides, (i + 1) % count as u32 * sides);
        // Where a closed tube meets itself its frame has turned: join the nearest corners.
        let turn = if b == 0 {
            let reach = |k: &u32| (shape.positions[*k as usize] - shape.positions[a as usize]).length_squared();
            (0..sides).min_by(|k, l| reach(k).total_cmp(&reach(l))).unwrap_or(0)
        } else {
            0
        };
        for k in 0..sides {
            let l = (k + 1) % sides;
            let (bk, bl) = (b + (k + turn) % sides, b + (l + turn) % sides);
            shape.triangles.extend([[a + k, a + l, bl], [a + k, bl, bk]]);
        }
    }
    shape
}

/// An opening in a [`wall`]: lower left and upper right corner; arched ones end in a half circle.
#[derive(Clone, Copy)]
pub(super) struct Opening {
    pub low: [f32; 2],
    pub high: [f32; 2],
    pub arched: bool,
}

/// A wall in the plane z = 0 from (0, 0) to (`width`, `height`), facing +Z, with openings whose reveals go `depth` deep
/// (towards -Z); one that starts on the ground has no sill. `back` gives the height of its rear face at z = -`depth`, if it has one.
pub(super) fn wall(width: f32, height: f32, depth: f32, openings: &[Opening], back: Option<f32>) -> Shape {
    /// Masonry between the top of an arch and where plain wall goes on.
    const CROWN: f32 = 0.1;
    const STEPS: u32 = 12;
    let mut shape = face(width, height, openings, CROWN);
    for o in openings {
        let arch = arch_points(o, STEPS);
        let spring = if o.arched { o.high[1] - (o.high[0] - o.low[0]) / 2.0 } else { o.high[1] };
        let point = |p: [f32; 2], z: f32| Vec3::new(p[0], p[1], z);
        let mut outline = vec![[o.low[0], spring], o.low, [o.high[0], o.low[1]], [o.high[0], spring]];
        if o.arched {
            outline.extend(arch.iter().rev().skip(1).take(arch.len() - 2).copied());
        }
        for i in 0..outline.len() {
            let (a, b) = (outline[i], outline[(i + 1) % outline.len()]);
            if a[1].max(b[1]) <= 0.0 {
                continue;
            }
            shape.polygon(&[point(a, 0.0), point(b, 0.0), point(b, -depth), point(a, -depth)]);
        }
    }
    if let Some(height) = back {
        let mirrored: Vec<Opening> = openings
            .iter()
            .map(|o| Opening { low: [width - o.high[0], o.low[1]], high: [width - o.low[0], o.high[1]], arched: o.arched })
            .collect();
        let turn = Affine3A::from_translation(Vec3::new(width, 0.0, -depth))
            * Affine3A::from_mat3(Mat3::from_cols(Vec3::NEG_X, Vec3::Y, Vec3::NEG_Z));
        shape.append(&face(width, height, &mirrored, CROWN).transformed(turn));
    }
    shape
}

/// The front face of a wall around its openings.
fn face(width: f32, height: f32, openings: &[Opening], crown: f32) -> Shape {
    let mut shape = Shape::default();
    let top = |o: &Opening| if o.arched { o.high[1] + crown } else { o.high[1] };
    let cuts = |limit: f32, values: Vec<f32>| {
        let mut cuts = values;
        cuts.extend([0.0, limit]);
        cuts.sort_by(f32::total_cmp);
        cuts.dedup_by(|a, b| (*a - *b).abs() < 1e-4);
        cuts
    };
    let us = cuts(width, openings.iter().flat_map(|o| [o.low[0], o.high[0]]).collect());
    let vs = cuts(height, openings.iter().flat_map(|o| [o.low[1], top(o)]).collect());
    for u in us.windows(2) {
        for v in vs.windows(2) {
            let middle = [(u[0] + u[1]) / 2.0, (v[0] + v[1]) / 2.0];
            let open = |o: &Opening| (o.low[0]..o.high[0]).contains(&middle[0]) && (o.low[1]..top(o)).contains(&middle[1]);
            if !openings.iter().any(open) {
                shape.rectangle(Vec3::new(u[0], v[0], 0.0), Vec3::X * (u[1] - u[0]), Vec3::Y * (v[1] - v[0]));
            }
        }
    }
    for o in openings.iter().filter(|o| o.arched) {
        for p in arch_points(o, 12).windows(2) {
            let ceiling = top(o);
            shape.polygon(&[[p[0][0], p[0][1]], [p[1][0], p[1][1]], [p[1][0], ceiling], [p[0][0], ceiling]].map(|[x, y]| Vec3::new(x, y, 0.0)));
        }
    }
    shape
}

/// The half circle on top of an opening, from left to right.
fn arch_points(o: &Opening, steps: u32) -> Vec<[f32; 2]> {
    let radius = (o.high[0] - o.low[0]) / 2.0;
    let (center, spring) = (o.low[0] + radius, o.high[1] - radius);
    let point = |k: u32| match k {
        0 => [o.low[0], spring],
        k if k == steps => [o.high[0], spring],
        k => {
            let angle = std::f32::consts::PI * (1.0 - k as f32 / steps as f32);
            [center + radius * cos(angle), spring + radius * sin(angle)]
        }
    };
    (0..=steps).map(point).collect()
}

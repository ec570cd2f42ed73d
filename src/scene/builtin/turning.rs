//! Round shapes: curves, profiles turned around an axis, and tubes.

use glam::{Vec2, Vec3};

use super::shape::Shape;

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
        let other = if end == segment {
            segment.checked_sub(1)
        } else {
            Some(segment + 1)
        };
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
            shape
                .positions
                .push(Vec3::new(c * radius, height, s * radius));
            shape
                .normals
                .push(Vec3::new(c * normal.x, normal.y, s * normal.x));
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
                0.5 * (2.0 * b
                    + (c - a) * t
                    + (2.0 * a - 5.0 * b + 4.0 * c - d) * t * t
                    + (3.0 * (b - c) + d - a) * t * t * t)
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
            shape
                .positions
                .push(path[i] + normal * radii[i.min(radii.len() - 1)]);
            shape.normals.push(normal);
        }
    }
    let last = if closed { count } else { count - 1 };
    for i in 0..last as u32 {
        let (a, b) = (i * sides, (i + 1) % count as u32 * sides);
        // Where a closed tube meets itself its frame has turned: join the nearest corners.
        let turn = if b == 0 {
            let reach = |k: &u32| {
                (shape.positions[*k as usize] - shape.positions[a as usize]).length_squared()
            };
            (0..sides)
                .min_by(|k, l| reach(k).total_cmp(&reach(l)))
                .unwrap_or(0)
        } else {
            0
        };
        for k in 0..sides {
            let l = (k + 1) % sides;
            let (bk, bl) = (b + (k + turn) % sides, b + (l + turn) % sides);
            shape
                .triangles
                .extend([[a + k, a + l, bl], [a + k, bl, bk]]);
        }
    }
    shape
}

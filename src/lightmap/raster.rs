//! Which triangle is seen at each sample of a picture: a small scanline rasterizer with a depth buffer, in bands of rows.

use glam::{DVec2, DVec3, Mat3, Vec3};
use rayon::prelude::*;

use crate::scene::{AlphaMode, Camera, Scene};

/// Rows of a band: what one thread draws at a time.
const BAND: usize = 24;

/// A pinhole camera over a picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    /// World space.
    pub eye: Vec3,
    /// Camera axes in world space: right, up, back.
    axes: Mat3,
    /// Half the height and width of the picture at distance 1.
    half: DVec2,
    /// Samples.
    pub width: usize,
    /// Samples.
    pub height: usize,
    /// Nothing nearer than this is drawn, metres.
    near: f64,
}

impl View {
    /// `near` in metres.
    pub fn new(camera: &Camera, width: usize, height: usize, near: f32) -> Self {
        let tan = f64::from(camera.fov_y * 0.5).tan();
        Self {
            eye: camera.transform.translation.into(),
            axes: camera.transform.matrix3.into(),
            half: DVec2::new(tan * width as f64 / height as f64, tan),
            width,
            height,
            near: near.into(),
        }
    }

    /// Direction through a sample, world space, of length 1 along the view.
    pub fn ray(&self, x: f32, y: f32) -> Vec3 {
        let ndc = DVec2::new(
            2.0 * f64::from(x) / self.width as f64 - 1.0,
            1.0 - 2.0 * f64::from(y) / self.height as f64,
        );
        let at = (ndc * self.half).as_vec2();
        self.axes * Vec3::new(at.x, at.y, -1.0)
    }

    /// World to camera space, looking along +z.
    fn to_camera(self, p: Vec3) -> DVec3 {
        let local = self.axes.transpose() * (p - self.eye);
        DVec3::new(local.x.into(), local.y.into(), (-local.z).into())
    }

    fn to_screen(self, p: DVec3) -> DVec2 {
        let ndc = DVec2::new(p.x / p.z, p.y / p.z) / self.half;
        DVec2::new(
            (ndc.x + 1.0) * 0.5 * self.width as f64,
            (1.0 - ndc.y) * 0.5 * self.height as f64,
        )
    }
}

/// A triangle on the screen.
struct Face {
    /// Convex, clipped to the near plane.
    polygon: [DVec2; 4],
    corners: usize,
    /// 1 / depth is `inverse · (x, y, 1)`.
    inverse: DVec3,
    object: u32,
    triangle: u32,
    masked: bool,
}

/// What a sample sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    /// Index into the scene's objects.
    pub object: u32,
    /// Index into the mesh's triangles.
    pub triangle: u32,
    /// 1 / distance along the view, per metre.
    pub inverse_depth: f32,
}

/// Draws triangles (object, triangle); returns what each sample sees, row by row. Single-sided triangles are seen from their
/// front alone, as glTF's renderers show them.
pub(super) fn draw(
    scene: &Scene,
    view: &View,
    triangles: &(impl Fn(u32) -> (u32, u32) + Sync),
    count: u32,
) -> Vec<Option<Seen>> {
    let faces: Vec<Face> = (0..count)
        .into_par_iter()
        .filter_map(|i| {
            let (object, triangle) = triangles(i);
            project(scene, view, object, triangle)
        })
        .collect();
    let bands = view.height.div_ceil(BAND);
    let mut lists: Vec<Vec<u32>> = vec![Vec::new(); bands];
    for (i, face) in faces.iter().enumerate() {
        let ys = face.polygon[..face.corners].iter().map(|p| p.y);
        let (low, high) = ys.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| {
            (l.min(y), h.max(y))
        });
        let row = |y: f64| (y.max(0.0) as usize).min(view.height - 1) / BAND;
        if high > 0.0 && low < view.height as f64 {
            for list in &mut lists[row(low)..=row(high)] {
                list.push(i as u32);
            }
        }
    }
    let mut seen = vec![None; view.width * view.height];
    seen.par_chunks_mut(BAND * view.width)
        .zip(&lists)
        .enumerate()
        .for_each(|(band, (seen, list))| {
            for &i in list {
                fill(scene, view, &faces[i as usize], band * BAND, seen);
            }
        });
    seen
}

fn project(scene: &Scene, view: &View, object: u32, triangle: u32) -> Option<Face> {
    // In counter-clockwise order seen from the front.
    let p = scene
        .world_triangle(object, triangle)
        .map(|p| view.to_camera(p));
    let normal = (p[1] - p[0]).cross(p[2] - p[0]);
    // Camera space here is left-handed (z forward), which turns the winding round.
    let facing = normal.dot(p[0]);
    if facing == 0.0 || !facing.is_finite() || p.iter().all(|p| p.z < view.near) {
        return None;
    }
    let material = scene.material(object, triangle);
    if facing < 0.0 && !material.double_sided {
        return None;
    }
    let (mut polygon, mut corners) = ([DVec2::ZERO; 4], 0);
    for i in 0..3 {
        let (a, b) = (p[i], p[(i + 1) % 3]);
        if a.z >= view.near {
            polygon[corners] = view.to_screen(a);
            corners += 1;
        }
        if (a.z >= view.near) != (b.z >= view.near) {
            // From the nearer end always, so that neighbours get the same point.
            let (a, b) = if a.z < b.z { (a, b) } else { (b, a) };
            polygon[corners] = view.to_screen(a.lerp(b, (view.near - a.z) / (b.z - a.z)));
            corners += 1;
        }
    }
    // The plane n·p = n·p0 with p = depth * (x half, y half, 1) gives 1 / depth as a linear function of the screen.
    let n = normal / facing;
    let (sx, sy) = (
        2.0 * view.half.x / view.width as f64,
        -2.0 * view.half.y / view.height as f64,
    );
    let inverse = DVec3::new(
        n.x * sx,
        n.y * sy,
        n.z - n.x * view.half.x + n.y * view.half.y,
    );
    let masked = matches!(material.alpha, AlphaMode::Mask { .. });
    Some(Face {
        polygon,
        corners,
        inverse,
        object,
        triangle,
        masked,
    })
}

/// Draws a face into the rows of a band that starts at row `top`.
fn fill(scene: &Scene, view: &View, face: &Face, top: usize, seen: &mut [Option<Seen>]) {
    let polygon = &face.polygon[..face.corners];
    for (row, seen) in seen.chunks_mut(view.width).enumerate() {
        let y = (top + row) as f64 + 0.5;
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        for (i, &p) in polygon.iter().enumerate() {
            let q = polygon[(i + 1) % polygon.len()];
            let (low, high) = if (p.y, p.x) <= (q.y, q.x) {
                (p, q)
            } else {
                (q, p)
            };
            if low.y <= y && y < high.y {
                let x = low.x + (high.x - low.x) * ((y - low.y) / (high.y - low.y));
                left = left.min(x);
                right = right.max(x);
            }
        }
        if left >= right {
            continue;
        }
        let first = (left - 0.5).ceil().clamp(0.0, view.width as f64) as usize;
        let end = (right - 0.5).ceil().clamp(0.0, view.width as f64) as usize;
        let start = face.inverse.y * y + face.inverse.z;
        for (x, slot) in seen[..end].iter_mut().enumerate().skip(first) {
            let inverse_depth = (face.inverse.x * (x as f64 + 0.5) + start) as f32;
            if slot.is_some_and(|s| s.inverse_depth >= inverse_depth) {
                continue;
            }
            let candidate = Seen {
                object: face.object,
                triangle: face.triangle,
                inverse_depth,
            };
            if face.masked {
                let weights = candidate.weights(scene, view, x as f32 + 0.5, y as f32);
                if scene.alpha_passes(face.object, face.triangle, weights) {
                    continue;
                }
            }
            *slot = Some(candidate);
        }
    }
}

impl Seen {
    /// Weights of the triangle's corners in the mesh's order where the ray through (x, y) meets its plane, moved into the
    /// triangle where the sample lies beside it.
    pub fn weights(&self, scene: &Scene, view: &View, x: f32, y: f32) -> Vec3 {
        let transform = scene.objects[self.object as usize].transform;
        let mesh = scene.mesh(self.object);
        let [a, b, c] = mesh.triangles[self.triangle as usize]
            .map(|v| transform.transform_point3(mesh.positions[v as usize]) - view.eye);
        // The ray meets the plane where the three sub-volumes are in the weights' proportion.
        let ray = view.ray(x, y);
        let volumes = Vec3::new(
            b.cross(c).dot(ray),
            c.cross(a).dot(ray),
            a.cross(b).dot(ray),
        );
        let sum = volumes.element_sum();
        let weights = (volumes / sum).clamp(Vec3::ZERO, Vec3::ONE);
        let total = weights.element_sum();
        if total > 0.0 && total.is_finite() {
            weights / total
        } else {
            Vec3::splat(1.0 / 3.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::viewpoint::looking;
    use super::*;

    fn soup(positions: Vec<Vec3>) -> Scene {
        let triangles: Vec<[Vec3; 3]> = positions
            .chunks_exact(3)
            .map(|t| [t[0], t[1], t[2]])
            .collect();
        let mut scene = Scene::of_triangles(&triangles);
        scene.materials[0].double_sided = true;
        scene
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        // Triangles all around the camera, behind it and through it, against a ray per sample.
        #[test]
        fn sees_what_rays_hit(coordinates in prop::collection::vec(-4.0f32..4.0, 9 * 6)) {
            let positions = coordinates.chunks_exact(3).map(|c| Vec3::new(c[0], c[1], c[2])).collect();
            let scene = soup(positions);
            let view = View::new(&looking(Vec3::new(0.1, 0.2, 3.0), Vec3::ZERO), 32, 24, 0.01);
            let seen = draw(&scene, &view, &|i| (0, i), 6);
            for (i, seen) in seen.iter().enumerate() {
                let ray = view.ray((i % 32) as f32 + 0.5, (i / 32) as f32 + 0.5);
                let mut hits = Vec::new();
                let mut doubtful = false;
                for t in 0..6 {
                    let [a, b, c] = scene.world_triangle(0, t).map(|p| p - view.eye);
                    let v = Vec3::new(b.cross(c).dot(ray), c.cross(a).dot(ray), a.cross(b).dot(ray));
                    let weights = v / v.element_sum();
                    let depth = a.dot(b.cross(c)) / v.element_sum();
                    // Near an edge, the near plane or edge-on, rounding decides.
                    doubtful |= depth > 0.0 && weights.min_element().abs() < 1e-3 || (depth - 0.01).abs() < 1e-3 || !depth.is_finite();
                    if weights.min_element() > 0.0 && depth > 0.01 {
                        hits.push((1.0 / depth, t));
                    }
                }
                hits.sort_by(|a, b| b.0.total_cmp(&a.0));
                doubtful |= hits.len() > 1 && hits[0].0 - hits[1].0 < 1e-4 * hits[0].0;
                if !doubtful {
                    prop_assert_eq!(seen.map(|s| s.triangle), hits.first().map(|h| h.1));
                    if let (Some(seen), Some(hit)) = (seen, hits.first()) {
                        prop_assert!((seen.inverse_depth - hit.0).abs() < 1e-3 * hit.0);
                    }
                }
            }
        }
    }
}

//! A camera for scenes that bring none: of a few likely places, the one that sees most.

use std::collections::BTreeSet;

use glam::{Affine3A, Mat3, Vec3};
use rayon::prelude::*;

use super::raster::{View, draw};
use crate::scene::{Camera, Scene};

/// Size of the trial pictures.
const TRIAL: [usize; 2] = [64, 36];
/// Only the largest triangles take part in the trial.
const LARGEST: usize = 20_000;
/// Vertical field of view: wide, as for interiors.
const FOV_Y: f32 = 0.9;

/// Places a camera. It depends on the scene alone.
pub(crate) fn choose(scene: &Scene) -> Camera {
    let mut triangles = all(scene);
    // By area, which is the first number; ties by place.
    triangles.par_sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (low, high) = extent(scene, &triangles);
    let (center, size) = ((low + high) * 0.5, high - low);
    triangles.truncate(LARGEST);
    let diagonal = size.length().max(1e-6);
    let scored: Vec<(f32, Camera)> = candidates(center, size)
        .into_par_iter()
        .map(|camera| {
            let view = View::new(&camera, TRIAL[0], TRIAL[1], diagonal * 1e-3);
            let list = |i: u32| (triangles[i as usize].1, triangles[i as usize].2);
            let seen = draw(scene, &view, &list, triangles.len() as u32);
            let far_enough = 1.0 / (0.04 * diagonal);
            let good = seen
                .iter()
                .flatten()
                .filter(|s| s.inverse_depth < far_enough);
            let distinct: BTreeSet<(u32, u32)> =
                good.clone().map(|s| (s.object, s.triangle)).collect();
            let filled = good.count() as f32 / seen.len() as f32;
            // A full picture first, much to see in it second.
            (filled.powi(3) * (2.0 + distinct.len() as f32).ln(), camera)
        })
        .collect();
    let best = scored
        .into_iter()
        .reduce(|best, next| if next.0 > best.0 { next } else { best });
    best.map_or_else(|| looking(center + Vec3::Z, center), |(_, camera)| camera)
}

/// Area (of the world, m²), object and triangle of all that is to be seen.
fn all(scene: &Scene) -> Vec<(f32, u32, u32)> {
    (0..scene.objects.len() as u32)
        .into_par_iter()
        .flat_map_iter(|object| {
            (0..scene.mesh(object).triangles.len() as u32).map(move |triangle| {
                let [a, b, c] = scene.world_triangle(object, triangle);
                ((b - a).cross(c - a).length() * 0.5, object, triangle)
            })
        })
        .collect()
}

/// The box that most triangles lie in: a ground plane far around the scene does not count.
fn extent(scene: &Scene, triangles: &[(f32, u32, u32)]) -> (Vec3, Vec3) {
    let mut corners: Vec<Vec3> = triangles
        .iter()
        .flat_map(|t| scene.world_triangle(t.1, t.2))
        .collect();
    let (mut low, mut high) = (Vec3::ZERO, Vec3::ONE);
    for axis in 0..3 {
        corners.sort_unstable_by(|a, b| a[axis].total_cmp(&b[axis]));
        let at = |share: f64| corners.get(((corners.len() as f64 - 1.0) * share) as usize);
        if let (Some(first), Some(last)) = (at(0.01), at(0.99)) {
            (low[axis], high[axis]) = (first[axis], last[axis]);
        }
    }
    (low, high)
}

/// Inside along the axes at eye height, in front of each side, and from above each corner.
fn candidates(center: Vec3, size: Vec3) -> Vec<Camera> {
    let mut cameras = Vec::new();
    let eye_height = center.y - 0.5 * size.y + (0.35 * size.y).min(1.7_f32.max(0.12 * size.y));
    for side in [Vec3::Z, Vec3::X, Vec3::NEG_X, Vec3::NEG_Z] {
        let reach = (size * side).length();
        let across = (size * Vec3::new(side.z, 0.0, side.x)).length();
        let level = |v: Vec3| Vec3::new(v.x, eye_height, v.z);
        cameras.push(looking(
            level(center + 0.42 * reach * side),
            level(center) + 0.08 * size.y * Vec3::Y,
        ));
        let step = Vec3::new(side.z, 0.0, -side.x) * 0.3 * across;
        cameras.push(looking(
            level(center + 0.42 * reach * side + step),
            level(center - 0.3 * step),
        ));
        // In front: the whole opposite side fills the picture's height or width.
        let distance = 0.5 * size.y.max(across / 1.78) / (0.5 * FOV_Y).tan();
        cameras.push(looking(
            center + side * (0.5 * reach + 1.02 * distance),
            center,
        ));
        let corner = side + Vec3::new(side.z, 0.9, -side.x);
        cameras.push(looking(
            center + 0.75 * size.length() * corner.normalize(),
            center,
        ));
    }
    cameras
}

impl Camera {
    /// A wide camera at `eye` that looks at `target`, upright; both in metres.
    pub fn looking(eye: Vec3, target: Vec3) -> Self {
        looking(eye, target)
    }
}

/// A camera at `eye` that looks at `target`, upright.
pub(super) fn looking(eye: Vec3, target: Vec3) -> Camera {
    let back = (eye - target).try_normalize().unwrap_or(Vec3::Z);
    let right = Vec3::Y.cross(back).try_normalize().unwrap_or(Vec3::X);
    let axes = Mat3::from_cols(right, back.cross(right), back);
    Camera {
        name: "preview".into(),
        transform: Affine3A::from_mat3_translation(axes, eye),
        fov_y: FOV_Y,
    }
}

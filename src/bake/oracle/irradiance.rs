//! What every form of virtual light must give at a point: closed forms in double precision.

use glam::{DVec3, Vec3};

use super::{EVALUATION, Numbers, accumulate, gpu, random_light, random_texels};
use crate::cluster::{Shape, VirtualLight};
use crate::scene::Scene;

/// Irradiance in double precision, without occlusion but for that by the surface that the light lies on, the polygon clipped vertex by vertex, its form factor with `acos`.
pub(super) fn irradiance(light: &VirtualLight, p: DVec3, n: DVec3) -> DVec3 {
    let flux = light.flux.as_dvec3();
    let normal = light.normal.as_dvec3();
    let l = light.position.as_dvec3() - p;
    let (d2, unit) = (l.length_squared(), l.normalize());
    let pi = std::f64::consts::PI;
    if l.dot(light.surface.as_dvec3()) > 0.0
        && matches!(light.shape, Shape::Disk { .. } | Shape::Polygon { .. })
    {
        return DVec3::ZERO;
    }
    match &light.shape {
        Shape::Directional { .. } => flux * (-n.dot(normal)).max(0.0),
        Shape::Point => flux * n.dot(unit).max(0.0) / d2,
        Shape::Spot { inner, outer } => {
            let (ci, co) = (f64::from(inner.cos()), f64::from(outer.cos()));
            let cone = ((-unit.dot(normal) - co) / (ci - co).max(1e-3)).clamp(0.0, 1.0);
            flux * n.dot(unit).max(0.0) * cone * cone / d2
        }
        Shape::Disk { area } => {
            let cosines = n.dot(unit).max(0.0) * (-unit.dot(normal)).max(0.0);
            flux * cosines / (pi * d2 + f64::from(EVALUATION.disk_area * area))
        }
        Shape::Polygon { vertices } => {
            if l.dot(normal) >= 0.0 {
                return DVec3::ZERO;
            }
            let outline: Vec<DVec3> = vertices.iter().map(|v| v.as_dvec3() - p).collect();
            let area: DVec3 = (1..outline.len() - 1)
                .map(|i| (outline[i] - outline[0]).cross(outline[i + 1] - outline[0]))
                .sum();
            let mut clipped = Vec::new();
            for (i, &b) in outline.iter().enumerate() {
                let a = outline[(i + outline.len() - 1) % outline.len()];
                let (ha, hb) = (a.dot(n), b.dot(n));
                if (ha > 0.0) != (hb > 0.0) {
                    clipped.push(a + (b - a) * (ha / (ha - hb)));
                }
                if hb > 0.0 {
                    clipped.push(b);
                }
            }
            let factor: f64 = (0..clipped.len())
                .map(|i| {
                    let (a, b) = (
                        clipped[i].normalize(),
                        clipped[(i + 1) % clipped.len()].normalize(),
                    );
                    -n.dot(a.cross(b).normalize_or_zero()) * a.dot(b).clamp(-1.0, 1.0).acos()
                        / (2.0 * pi)
                })
                .sum();
            flux * factor.max(0.0) / (0.5 * area.length())
        }
    }
}

#[test]
fn every_form_agrees_with_double_precision() {
    let gpu = gpu();
    let mut numbers = Numbers(7);
    let texels = random_texels(&mut numbers, 40, 3.0);
    // No occluder: a triangle far outside.
    let far = Vec3::splat(100.0);
    let scene = Scene::of_triangles(&[[far, far + Vec3::X, far + Vec3::Y]]);
    for (kind, tolerance) in [(0, 4e-3), (1, 1e-4), (2, 1e-5), (3, 1e-4), (4, 1e-5)] {
        for _ in 0..6 {
            let light = random_light(&mut numbers, kind);
            let got = accumulate(&gpu, &scene, &texels, &[(light.clone(), 1)]);
            let peak = texels
                .iter()
                .map(|t| irradiance(&light, t.at(), t.facing()).y)
                .fold(0.0, f64::max);
            for (texel, got) in texels.iter().zip(&got) {
                let want = irradiance(&light, texel.at(), texel.facing());
                let far = far_tolerance(&light, texel.at());
                for (got, want) in got.iter().zip(want.to_array()) {
                    let error = (got - want).abs();
                    assert!(
                        error <= tolerance * want + 2e-5 * peak + far,
                        "kind {kind}: {got} for {want}, {light:?}"
                    );
                }
            }
        }
    }
}

/// What the switch of far polygons to disks may cost: 2 % of the largest component's irradiance face on.
fn far_tolerance(light: &VirtualLight, p: DVec3) -> f64 {
    let Shape::Polygon { vertices } = &light.shape else {
        return 0.0;
    };
    let radius = vertices
        .iter()
        .map(|v| v.distance(light.position))
        .fold(0.0, f32::max);
    let d = light.position.as_dvec3().distance(p);
    let is_far = d > f64::from(crate::bake::passes::accumulate::FAR * radius);
    let face_on = f64::from(light.flux.max_element()) / (std::f64::consts::PI * d * d);
    if is_far { 0.02 * face_on } else { 0.0 }
}

#[test]
fn what_is_subtracted_was_added() {
    let gpu = gpu();
    let mut numbers = Numbers(3);
    let texels = random_texels(&mut numbers, 20, 3.0);
    let scene = Scene::of_triangles(
        &(0..50)
            .map(|_| {
                let c = numbers.vector() * 2.0;
                [0; 3].map(|_| c + numbers.vector() * 0.5)
            })
            .collect::<Vec<_>>(),
    );
    let lights: Vec<_> = (0..24)
        .map(|i| (random_light(&mut numbers, i % 5), 1))
        .collect();
    let half: Vec<_> = lights.iter().step_by(2).cloned().collect();
    let others: Vec<_> = lights
        .iter()
        .skip(1)
        .step_by(2)
        .map(|(light, _)| (light.clone(), -1))
        .collect();
    let mut all = lights;
    all.extend(others);
    assert_eq!(
        accumulate(&gpu, &scene, &texels, &all),
        accumulate(&gpu, &scene, &texels, &half)
    );
}

//! The receiver's own surface against the oracle: light from behind the geometric normal does not arrive, whatever the
//! interpolated one says; all other light does, unchanged.

use glam::{DVec3, Vec3};

use super::irradiance::irradiance;
use super::{Numbers, accumulate, gpu, random_light, random_texels};
use crate::cluster::{Shape, VirtualLight};
use crate::scene::Scene;

/// Cosines between the face and the directions to all of the emitter, scaled: the least and the largest.
fn heights(light: &VirtualLight, p: DVec3, face: DVec3) -> (f64, f64) {
    let to = |at: Vec3| face.dot(at.as_dvec3() - p);
    match &light.shape {
        Shape::Directional { .. } => {
            let h = -face.dot(light.normal.as_dvec3());
            (h, h)
        }
        Shape::Polygon { vertices } => {
            let center = vertices.iter().sum::<Vec3>() / vertices.len() as f32;
            let radius = vertices
                .iter()
                .map(|v| v.distance(center))
                .fold(0.0, f32::max);
            let (h, r) = (to(center), f64::from(radius));
            (h - r, h + r)
        }
        _ => (to(light.position), to(light.position)),
    }
}

#[test]
fn light_from_behind_the_surface_does_not_arrive() {
    let gpu = gpu();
    let mut numbers = Numbers(11);
    let mut texels = random_texels(&mut numbers, 20, 3.0);
    for texel in &mut texels {
        let tilted = Vec3::from_array(texel.normal) + numbers.vector() * 0.6;
        texel.face = tilted.normalize().to_array();
    }
    let far = Vec3::splat(100.0);
    let scene = Scene::of_triangles(&[[far, far + Vec3::X, far + Vec3::Y]]);
    for (kind, tolerance) in [(0, 4e-3), (1, 1e-4), (2, 1e-5), (3, 1e-4), (4, 1e-5)] {
        let (mut behind, mut before) = (0, 0);
        for _ in 0..4 {
            let light = random_light(&mut numbers, kind);
            let got = accumulate(&gpu, &scene, &texels, &[(light.clone(), 1)]);
            let wanted: Vec<f64> = texels
                .iter()
                .map(|t| irradiance(&light, t.at(), t.facing()).y)
                .collect();
            let peak = wanted.iter().copied().fold(0.0, f64::max);
            for ((texel, got), want) in texels.iter().zip(&got).zip(wanted) {
                let face = Vec3::from_array(texel.face).as_dvec3();
                let (least, most) = heights(&light, texel.at(), face);
                if most < -1e-5 {
                    assert_eq!(*got, [0.0; 3], "kind {kind}");
                    behind += u32::from(want > 1e-3 * peak);
                } else if least > 1e-5 {
                    // What the switch of far polygons to disks may cost comes on top: oracle.rs has it.
                    let switch = if kind == 0 { 0.02 * peak } else { 0.0 };
                    let error = (got[1] - want).abs();
                    assert!(
                        error <= tolerance * want + 2e-5 * peak + switch,
                        "kind {kind}: {got:?} for {want}"
                    );
                    before += u32::from(want > 1e-3 * peak);
                }
            }
        }
        assert!(
            behind > 5 && before > 100,
            "kind {kind}: {behind} behind, {before} before"
        );
    }
}

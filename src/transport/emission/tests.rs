//! What lights send, held to integrals.

use super::super::surface::cut_triangle;
use super::*;
use crate::scene::Light;
use crate::transport::testing::{add_quads, cornell, light, material, quad, room};
use glam::Affine3A;

fn lit(aperture: Aperture) -> (Scene, Emitter) {
    let mut scene = room(0.5);
    let transform = Affine3A::from_rotation_translation(
        glam::Quat::from_rotation_x(-0.7),
        Vec3::new(0.1, 0.2, 0.3),
    );
    scene
        .lights
        .push(light(aperture, Vec3::new(1.0, 2.0, 3.0), transform));
    let emitter = Emitter::new(&scene, 0);
    (scene, emitter)
}

#[test]
fn spots_send_what_their_falloff_integrates_to() {
    for (inner, outer) in [
        (0.0, 0.5),
        (0.3, 0.31),
        (0.4, 0.4),
        (0.0, PI / 2.0),
        (0.0, 0.001),
    ] {
        let falloff = SpotFalloff::new(inner, outer);
        let n = 200_000;
        let step = (1.0 - f64::from(outer.cos())) / f64::from(n);
        let sum: f64 = (0..n)
            .map(|i| {
                f64::from(falloff.at((f64::from(outer.cos()) + (f64::from(i) + 0.5) * step) as f32))
                    * step
            })
            .sum();
        let exact = sum * std::f64::consts::TAU;
        assert!(
            (f64::from(falloff.solid_angle()) / exact - 1.0).abs() < 0.03 || exact < 1e-5,
            "{inner} {outer} {exact}"
        );
        // A sampled cosine's share below a threshold is the integral's.
        let threshold = falloff.sample(0.5);
        let above: f64 = (0..n)
            .map(|i| f64::from(outer.cos()) + (f64::from(i) + 0.5) * step)
            .filter(|&c| c > f64::from(threshold))
            .map(|c| f64::from(falloff.at(c as f32)) * step)
            .sum();
        assert!(
            (above / sum - 0.5).abs() < 0.03 || exact < 1e-5,
            "{inner} {outer}"
        );
    }
}

#[test]
fn rays_leave_where_they_should() {
    let sequence = Sequence::new(0, 0);
    let (_, point) = lit(Aperture::Point);
    assert!((point.flux - Vec3::new(1.0, 2.0, 3.0) * 4.0 * PI).length() < 1e-4);
    assert_eq!(point.emit(&sequence, 9).origin, Vec3::new(0.1, 0.2, 0.3));
    let (scene, spot) = lit(Aperture::Spot {
        inner: 0.2,
        outer: 0.4,
    });
    let axis = Vec3::from(scene.lights[0].transform.matrix3 * Vec3A::NEG_Z);
    let (_, sun) = lit(Aperture::Directional);
    for i in 0..500 {
        assert!(spot.emit(&sequence, i).direction.dot(axis) > 0.4f32.cos() - 1e-5);
        let ray = sun.emit(&sequence, i);
        assert!((ray.direction - axis).length() < 1e-5 && (mean(ray.color) - 1.0).abs() < 1e-5);
        assert!(ray.origin.dot(axis) < -1.41, "starts outside of the room");
    }
    // The room's 2 m cube, widened by its grid of 2/16 a side at most, seen along a direction that tilts in the yz plane.
    let area = f64::from(mean(sun.flux)) / 2.0;
    let exact = 4.0 * f64::from(axis.y.abs() + axis.z.abs());
    assert!(
        area >= exact - 1e-4 && area <= exact * 1.2,
        "{area} {exact}"
    );
}

#[test]
fn surfaces_send_pi_l_a_a_side() {
    let mut scene = cornell();
    let lamp = Emitter::new(&scene, 0);
    assert!((lamp.flux.x - PI * 17.0 * 0.25).abs() < 1e-4);
    assert!(lamp.emit(&Sequence::new(0, 0), 3).direction.y < 0.0);
    let quad = quad(Vec3::ZERO, Vec3::X, Vec3::Y);
    let object = add_quads(&mut scene, &[quad], material(Vec3::ONE, Vec3::ONE, true));
    // A mirrored, stretched object keeps its front's flux.
    scene.objects[object as usize].transform = Affine3A::from_scale(Vec3::new(-2.0, 1.0, 1.0));
    let both = Emitter::new(&scene, 1);
    assert!((both.flux.x - 2.0 * PI * 2.0).abs() < 1e-4);
    let up = (0..64)
        .filter(|&i| both.emit(&Sequence::new(0, 1), i).direction.z > 0.0)
        .count();
    assert_eq!(up, 32);
    assert!(both.pieces().iter().all(|p| p.normal.z > 0.99));
}

#[test]
fn cut_triangles_fill_the_triangle() {
    let area: f32 = cut_triangle(5)
        .map(|[a, b, c]| {
            let twice = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
            assert!(twice > 0.0);
            twice
        })
        .sum();
    assert_eq!(cut_triangle(5).count(), 25);
    assert!((area - 1.0).abs() < 1e-5);
}

#[test]
fn a_light_without_a_scene_sends_nothing() {
    let mut scene = Scene::default();
    let sun: Light = light(Aperture::Directional, Vec3::ONE, Affine3A::IDENTITY);
    scene.lights.push(sun);
    assert_eq!(Emitter::new(&scene, 0).flux, Vec3::ZERO);
}

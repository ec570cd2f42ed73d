//! Small scenes made by hand, for the tests of this crate.

use std::sync::Arc;

use glam::{Affine3A, Vec3, Vec4};

use crate::scene::{AlphaMode, Aperture, Light, Material, Mesh, Object, Primitive, Scene};

pub(crate) fn material(albedo: Vec3, emission: Vec3, double_sided: bool) -> Material {
    Material {
        name: String::new(),
        source: None,
        base_color: Vec4::new(albedo.x, albedo.y, albedo.z, 1.0),
        base_color_texture: None,
        emission,
        emission_texture: None,
        double_sided,
        alpha: AlphaMode::Opaque,
    }
}

/// Adds an object of quads (counter-clockwise from the front) with one material; emissive ones become lights.
pub(crate) fn add_quads(scene: &mut Scene, quads: &[[Vec3; 4]], material: Material) -> u32 {
    let mut mesh = Mesh::default();
    for quad in quads {
        let base = mesh.positions.len() as u32;
        mesh.positions.extend(quad);
        mesh.triangles
            .extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
    }
    mesh.normals = vec![Vec3::ZERO; mesh.positions.len()];
    mesh.primitives.push(Primitive {
        triangles: 0..mesh.triangles.len() as u32,
        vertices: 0..mesh.positions.len() as u32,
        material: scene.materials.len() as u32,
        source: 0,
    });
    let object = scene.objects.len() as u32;
    if material.emission != Vec3::ZERO {
        scene.lights.push(Light {
            node: object,
            ..light(Aperture::Surface { object }, Vec3::ONE, Affine3A::IDENTITY)
        });
    }
    scene.materials.push(material);
    scene.objects.push(Object {
        name: format!("object {object}"),
        node: object,
        mesh: scene.meshes.len() as u32,
        transform: Affine3A::IDENTITY,
    });
    scene.meshes.push(Arc::new(mesh));
    object
}

pub(crate) fn light(aperture: Aperture, intensity: Vec3, transform: Affine3A) -> Light {
    Light {
        name: String::new(),
        node: 0,
        aperture,
        intensity,
        transform,
    }
}

/// A parallelogram that faces along `u` x `v`.
pub(crate) fn quad(corner: Vec3, u: Vec3, v: Vec3) -> [Vec3; 4] {
    [corner, corner + u, corner + u + v, corner + v]
}

/// The six faces of an axis-aligned box, looking outwards or inwards.
pub(crate) fn box_quads(lo: Vec3, hi: Vec3, inwards: bool) -> Vec<[Vec3; 4]> {
    let d = hi - lo;
    let (x, y, z) = (Vec3::X * d.x, Vec3::Y * d.y, Vec3::Z * d.z);
    let mut quads = vec![
        quad(lo, y, x),
        quad(lo, z, y),
        quad(lo, x, z),
        quad(hi, -x, -y),
        quad(hi, -y, -z),
        quad(hi, -z, -x),
    ];
    if inwards {
        quads.iter_mut().for_each(|q| q.reverse());
    }
    quads
}

/// A closed room of 2 m with one albedo and no light.
pub(crate) fn room(albedo: f32) -> Scene {
    let mut scene = Scene::default();
    let walls = box_quads(Vec3::splat(-1.0), Vec3::ONE, true);
    add_quads(
        &mut scene,
        &walls,
        material(Vec3::splat(albedo), Vec3::ZERO, false),
    );
    scene
}

/// A Cornell box of 2 m, open to +Z, with a lamp under the ceiling and two boxes.
pub(crate) fn cornell() -> Scene {
    let mut scene = Scene::default();
    let faces = box_quads(Vec3::splat(-1.0), Vec3::ONE, true);
    let white = || material(Vec3::splat(0.73), Vec3::ZERO, false);
    // The faces' order is -Z, -X, -Y, +Z, +X, +Y.
    add_quads(&mut scene, &[faces[0], faces[2], faces[5]], white());
    add_quads(
        &mut scene,
        &[faces[1]],
        material(Vec3::new(0.63, 0.065, 0.05), Vec3::ZERO, false),
    );
    add_quads(
        &mut scene,
        &[faces[4]],
        material(Vec3::new(0.14, 0.45, 0.09), Vec3::ZERO, false),
    );
    add_quads(
        &mut scene,
        &box_quads(Vec3::new(0.1, -1.0, 0.0), Vec3::new(0.7, -0.4, 0.6), false),
        white(),
    );
    add_quads(
        &mut scene,
        &box_quads(
            Vec3::new(-0.7, -1.0, -0.6),
            Vec3::new(-0.1, 0.2, 0.0),
            false,
        ),
        white(),
    );
    let lamp = quad(Vec3::new(-0.25, 0.99, -0.25), Vec3::X * 0.5, Vec3::Z * 0.5);
    add_quads(
        &mut scene,
        &[lamp],
        material(Vec3::ZERO, Vec3::splat(17.0), false),
    );
    scene
}

//! Slow, obvious twins of the GPU passes, and the tests that hold the passes to them.

use std::sync::LazyLock;

use arrayvec::ArrayVec;
use glam::{DVec3, Vec3, Vec4};

use super::accumulate::{AccumulatePass, Batch, Evaluation};
use super::occluders::Occluders;
use super::place::Receivers;
use super::records::{self, Light, ShadowSizes, Surroundings};
use super::shaders;
use super::shadow::ShadowPass;
use super::versions::Versions;
use crate::cluster::{Shape, VirtualLight};
use crate::gpu::{Gpu, GpuError, GpuOptions, Stage};
use crate::lightmap::Texel;
use crate::lightmap::texels::Texels;
use crate::scene::{AlphaMode, Bounds, Material, Mesh, Object, Primitive, Scene};

/// The device under test, with the validation layer where it is installed.
pub(super) fn gpu() -> Gpu {
    match Gpu::new(&GpuOptions {
        device: None,
        validate: true,
    }) {
        Err(GpuError::NoValidation) => {
            eprintln!("the validation layer is not installed: running without it");
            Gpu::new(&GpuOptions::default()).expect("a Vulkan device")
        }
        gpu => gpu.expect("a Vulkan device"),
    }
}

/// Uniform numbers in 0..1 from a counter.
pub(super) struct Numbers(pub(super) u64);

impl Numbers {
    pub(super) fn next(&mut self) -> f32 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        ((self.0 >> 40) as f32) / (1u64 << 24) as f32
    }

    pub(super) fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.vector();
            if v.length_squared() > 0.01 && v.length_squared() < 1.0 {
                return v.normalize();
            }
        }
    }
}

/// One mesh of loose triangles.
pub(super) fn soup(triangles: &[[Vec3; 3]]) -> Scene {
    let count = triangles.len() as u32;
    let mesh = Mesh {
        positions: triangles.iter().flatten().copied().collect(),
        normals: vec![Vec3::ZERO; triangles.len() * 3],
        triangles: (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        primitives: vec![Primitive {
            triangles: 0..count,
            vertices: 0..3 * count,
            material: 0,
            source: 0,
        }],
        ..Mesh::default()
    };
    Scene {
        meshes: vec![mesh.into()],
        materials: vec![Material {
            name: String::new(),
            source: None,
            base_color: Vec4::ONE,
            base_color_texture: None,
            emission: Vec3::ZERO,
            emission_texture: None,
            double_sided: false,
            alpha: AlphaMode::Opaque,
        }],
        objects: vec![Object {
            name: "soup".into(),
            node: 0,
            mesh: 0,
            transform: glam::Affine3A::IDENTITY,
        }],
        ..Scene::default()
    }
}

/// Receivers anywhere in the cube of the given half size, facing anywhere, as whole tiles.
pub(super) fn random_texels(numbers: &mut Numbers, tiles: usize, half: f32) -> Vec<Texel> {
    (0..tiles)
        .flat_map(|_| {
            // Tiles are small and nearly flat, as real ones are.
            let (center, axis) = (numbers.vector() * half, numbers.direction());
            (0..Texel::TILE)
                .map(|_| {
                    let normal = (axis + numbers.vector() * 0.2).normalize().to_array();
                    Texel {
                        position: (center + numbers.vector() * 0.05).to_array(),
                        object: 0,
                        normal,
                        face: normal,
                        pixel: 0,
                    }
                })
                .collect::<Vec<_>>()
        })
        .collect()
}

pub(super) const SIZES: ShadowSizes = ShadowSizes {
    indirect: 64,
    direct: 128,
    sun: 256,
};
pub(super) const EVALUATION: Evaluation = Evaluation {
    scale: (1u64 << 32) as f32,
    epsilon: 0.0,
    disk_area: 0.3,
};

pub(super) fn bounds() -> Bounds {
    Bounds {
        min: Vec3::splat(-4.0),
        max: Vec3::splat(4.0),
    }
}

/// The only version there is.
pub(super) fn around() -> Surroundings<'static> {
    static BOUNDS: LazyLock<Bounds> = LazyLock::new(bounds);
    Surroundings {
        version: 0,
        other: 0,
        regions: &[],
        first_region: 0,
        bounds: &BOUNDS,
        soft: false,
        moved: 0.0,
    }
}

/// Runs the real passes; returns irradiance in lux per receiver.
pub(super) fn accumulate(
    gpu: &Gpu,
    scene: &Scene,
    texels: &[Texel],
    lights: &[(VirtualLight, i32)],
) -> Vec<[f64; 3]> {
    let occluders = Occluders::new(gpu, scene).expect("upload");
    let texels = Texels {
        list: texels.to_vec(),
        tiles: std::iter::once(0..(texels.len() / Texel::TILE) as u32).collect(),
        count: texels.len() as u32,
    };
    let receivers = Receivers::new(gpu, scene, &[true], &texels).expect("place");
    let mut shadow = ShadowPass::new(gpu, 16 << 20).expect("buffers");
    let versions = Versions::new(gpu, &[true], bounds()).expect("buffers");
    let mut pass = AccumulatePass::new(gpu, &receivers, EVALUATION).expect("buffers");
    for batch in lights.chunks(8) {
        let (mut views, mut offset) = (Vec::new(), 0);
        let records: Vec<Light> = batch
            .iter()
            .map(|(light, sign)| {
                records::record(light, *sign, &SIZES, &around(), &mut views, &mut offset)
            })
            .collect();
        let mut cmd = gpu.commands().expect("recording");
        cmd.barrier(Stage::All, Stage::All);
        shadow
            .record(gpu, &mut cmd, &occluders, versions.address(), &views)
            .expect("recording");
        let batch = Batch {
            lights: &records,
            regions: &[],
            soft: false,
        };
        pass.record(
            gpu,
            &mut cmd,
            &receivers,
            &shadow,
            versions.address(),
            &batch,
        )
        .expect("recording");
        cmd.submit()
            .expect("submission")
            .wait()
            .expect("no validation message");
    }
    let sums = pass.read().expect("read-back");
    let scale = f64::from(pass.scale());
    sums.chunks_exact(3 * Texel::TILE)
        .flat_map(|t| {
            (0..Texel::TILE).map(move |i| [0, 1, 2].map(|c| t[c * Texel::TILE + i] as f64 / scale))
        })
        .collect()
}

/// Irradiance without occlusion in double precision, the polygon clipped vertex by vertex, its form factor with `acos`.
pub(super) fn irradiance(light: &VirtualLight, p: DVec3, n: DVec3) -> DVec3 {
    let flux = light.flux.as_dvec3();
    let normal = light.normal.as_dvec3();
    let l = light.position.as_dvec3() - p;
    let (d2, unit) = (l.length_squared(), l.normalize());
    let pi = std::f64::consts::PI;
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

pub(super) fn random_light(numbers: &mut Numbers, kind: usize) -> VirtualLight {
    let normal = numbers.direction();
    let position = numbers.vector() * 2.0;
    let (u, v) = normal.any_orthonormal_pair();
    let shape = match kind {
        0 => {
            let corners = 3 + (numbers.next() * 5.99) as usize;
            let (ru, rv) = (0.2 + numbers.next(), 0.2 + numbers.next());
            let vertices: ArrayVec<Vec3, 8> = (0..corners)
                .map(|i| {
                    let angle = std::f32::consts::TAU * i as f32 / corners as f32;
                    position + u * (ru * angle.cos()) + v * (rv * angle.sin())
                })
                .collect();
            Shape::Polygon { vertices }
        }
        1 => Shape::Disk {
            area: numbers.next(),
        },
        2 => Shape::Point,
        3 => Shape::Spot {
            inner: 0.3,
            outer: 0.9,
        },
        _ => Shape::Directional {
            frame: glam::Affine3A::IDENTITY,
        },
    };
    // The polygon of u and v is counter-clockwise around u x v.
    let normal = if kind == 0 { u.cross(v) } else { normal };
    VirtualLight {
        shape,
        position,
        normal,
        flux: Vec3::new(1.0, 2.0, 3.0),
        direct: false,
    }
}

#[test]
fn every_form_agrees_with_double_precision() {
    let gpu = gpu();
    let mut numbers = Numbers(7);
    let texels = random_texels(&mut numbers, 40, 3.0);
    // No occluder: a triangle far outside.
    let far = Vec3::splat(100.0);
    let scene = soup(&[[far, far + Vec3::X, far + Vec3::Y]]);
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
    let is_far = d > f64::from(super::accumulate::FAR * radius);
    let face_on = f64::from(light.flux.max_element()) / (std::f64::consts::PI * d * d);
    if is_far { 0.02 * face_on } else { 0.0 }
}

impl Texel {
    pub(super) fn at(&self) -> DVec3 {
        Vec3::from_array(self.position).as_dvec3()
    }

    pub(super) fn facing(&self) -> DVec3 {
        Vec3::from_array(self.normal).as_dvec3()
    }
}

#[test]
fn what_is_subtracted_was_added() {
    let gpu = gpu();
    let mut numbers = Numbers(3);
    let texels = random_texels(&mut numbers, 20, 3.0);
    let scene = soup(
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

#[test]
fn records_lie_in_memory_as_the_shaders_read_them() {
    use std::mem::offset_of;
    let expected: &[(&str, &[usize])] = &[
        (
            "Receiver",
            &[
                offset_of!(records::Receiver, position),
                offset_of!(records::Receiver, normal),
                offset_of!(records::Receiver, face),
            ],
        ),
        (
            "Tile",
            &[
                offset_of!(records::Tile, center),
                offset_of!(records::Tile, extent),
                offset_of!(records::Tile, axis),
                offset_of!(records::Tile, cone_cos),
                offset_of!(records::Tile, sums),
                offset_of!(records::Tile, instance),
            ],
        ),
        (
            "Instance",
            &[
                offset_of!(records::Instance, since),
                offset_of!(records::Instance, until),
                offset_of!(records::Instance, crowded),
            ],
        ),
        (
            "Region",
            &[
                offset_of!(records::Region, center),
                offset_of!(records::Region, extent),
            ],
        ),
        (
            "Placement",
            &[
                offset_of!(records::Placement, row),
                offset_of!(records::Placement, normal_row),
            ],
        ),
        (
            "Triangle",
            &[
                offset_of!(records::Triangle, a),
                offset_of!(records::Triangle, b),
                offset_of!(records::Triangle, c),
            ],
        ),
        (
            "Cutout",
            &[
                offset_of!(records::Cutout, uv),
                offset_of!(records::Cutout, first),
                offset_of!(records::Cutout, size),
                offset_of!(records::Cutout, wrap),
            ],
        ),
        (
            "Chunk",
            &[
                offset_of!(records::Chunk, center),
                offset_of!(records::Chunk, extent),
                offset_of!(records::Chunk, count),
                offset_of!(records::Chunk, instance),
            ],
        ),
        (
            "View",
            &[
                offset_of!(records::View, origin),
                offset_of!(records::View, x),
                offset_of!(records::View, y),
                offset_of!(records::View, z),
                offset_of!(records::View, offset),
                offset_of!(records::View, size),
                offset_of!(records::View, kind),
                offset_of!(records::View, cos_cone),
                offset_of!(records::View, version),
                offset_of!(records::View, limit),
            ],
        ),
        (
            "Light",
            &[
                offset_of!(Light, position),
                offset_of!(Light, normal),
                offset_of!(Light, flux),
                offset_of!(Light, area),
                offset_of!(Light, radius),
                offset_of!(Light, spot_scale),
                offset_of!(Light, spot_offset),
                offset_of!(Light, kind),
                offset_of!(Light, sign),
                offset_of!(Light, view),
                offset_of!(Light, version),
                offset_of!(Light, other),
                offset_of!(Light, first_region),
                offset_of!(Light, regions),
                offset_of!(Light, origin),
                offset_of!(Light, blur),
                offset_of!(Light, blur_slope),
                offset_of!(Light, vertices),
                offset_of!(Light, vertex),
            ],
        ),
    ];
    for (name, offsets) in expected {
        let (_, members) = shaders::LAYOUTS
            .iter()
            .find(|(n, _)| n == name)
            .unwrap_or_else(|| panic!("{name} is in no shader"));
        let found: Vec<usize> = members.iter().map(|(_, offset)| *offset as usize).collect();
        assert_eq!(&found, offsets, "{name}: {members:?}");
    }
}

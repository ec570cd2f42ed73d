//! Slow, obvious twins of the GPU passes, the tests that hold the passes to them, and what these tests share.

mod depth;
mod horizon;
mod irradiance;
mod layout;
mod occlusion;
mod versions;

use std::collections::HashMap;
use std::sync::LazyLock;

use arrayvec::ArrayVec;
use glam::{DVec3, Vec3};

use crate::bake::device::records::{self, Light, Parts, ShadowSizes, Surroundings, View};
use crate::bake::passes::accumulate::{AccumulatePass, Batch, Evaluation};
use crate::bake::passes::shadow::{Maps, Place, ShadowPass};
use crate::bake::world::occluders::Occluders;
use crate::bake::world::place::Receivers;
use crate::bake::world::versions::Versions;
use crate::cluster::{Shape, VirtualLight};
use crate::gpu::{Gpu, GpuError, GpuOptions, Stage};
use crate::lightmap::Texel;
use crate::lightmap::texels::Texels;
use crate::scene::{Bounds, Scene};

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

/// All of these are drawn.
pub(super) fn maps(views: &[View]) -> Maps<'_> {
    static KEPT: LazyLock<HashMap<u32, Place>> = LazyLock::new(HashMap::new);
    Maps {
        views,
        kept: &KEPT,
        blocks: true,
    }
}

/// The only version there is.
pub(super) fn around() -> Surroundings<'static> {
    static BOUNDS: LazyLock<Bounds> = LazyLock::new(bounds);
    Surroundings {
        version: 0,
        other: 0,
        begins: 0,
        parts: Parts::ALL,
        kept: [0; 2],
        regions: &[],
        first_occluder: 0,
        occluders: 0,
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
    let texels = Texels {
        list: texels.to_vec(),
        tiles: std::iter::once(0..(texels.len() / Texel::TILE) as u32).collect(),
        count: texels.len() as u32,
        ..Texels::default()
    };
    let (sums, _) = run(gpu, scene, &texels, lights, EVALUATION, true);
    let scale = f64::from(EVALUATION.scale);
    sums.chunks_exact(3 * Texel::TILE)
        .flat_map(|t| {
            (0..Texel::TILE).map(move |i| [0, 1, 2].map(|c| t[c * Texel::TILE + i] as f64 / scale))
        })
        .collect()
}

/// Runs the real passes, with or without leaving out what is hidden; returns their sums, and how many pairs of a texel and a
/// light they evaluated.
pub(super) fn run(
    gpu: &Gpu,
    scene: &Scene,
    texels: &Texels,
    lights: &[(VirtualLight, i32)],
    evaluation: Evaluation,
    occlusion: bool,
) -> (Vec<i64>, u64) {
    let occluders = Occluders::new(gpu, scene).expect("upload");
    let receivers = Receivers::new(gpu, scene, &[true], texels).expect("place");
    let mut shadow = ShadowPass::new(gpu, 64 << 20).expect("buffers");
    let versions = Versions::new(gpu, &[true], bounds()).expect("buffers");
    let mut pass = AccumulatePass::new(gpu, &receivers, evaluation).expect("buffers");
    shadow.set_occlusion(occlusion);
    pass.set_occlusion(occlusion);
    for batch in lights.chunks(8) {
        let mut views = Vec::new();
        let records: Vec<Light> = batch
            .iter()
            .map(|(light, sign)| records::record(light, *sign, &SIZES, &around(), &mut views))
            .collect();
        let mut cmd = gpu.commands().expect("recording");
        cmd.barrier(Stage::All, Stage::All);
        shadow
            .record(gpu, &mut cmd, &occluders, versions.address(), &maps(&views))
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
    let pairs = pass.pairs().expect("read-back").values().sum();
    (pass.read().expect("read-back"), pairs)
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
    // What it lies on is a little tilted.
    let surface = match kind {
        0 | 1 => (normal + 0.2 * u).normalize(),
        _ => normal,
    };
    VirtualLight {
        shape,
        position,
        normal,
        surface,
        flux: Vec3::new(1.0, 2.0, 3.0),
        direct: false,
    }
}

/// A light that sees the same, as VPLs that changed leave one behind, but shines otherwise.
pub(super) fn turned(numbers: &mut Numbers, light: &VirtualLight) -> VirtualLight {
    VirtualLight {
        shape: Shape::Disk {
            area: numbers.next(),
        },
        normal: (light.normal + 0.2 * numbers.direction()).normalize(),
        flux: light.flux * (0.5 + numbers.next()),
        ..light.clone()
    }
}

impl Texel {
    pub(super) fn at(&self) -> DVec3 {
        Vec3::from_array(self.position).as_dvec3()
    }

    pub(super) fn facing(&self) -> DVec3 {
        Vec3::from_array(self.normal).as_dvec3()
    }
}

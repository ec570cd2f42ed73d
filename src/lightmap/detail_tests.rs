//! Tests of the sharing out of texels: where they go, and how many.

use std::sync::Arc;

use glam::Affine3A;

use super::*;
use crate::lightmap::coverage::fetched;
use crate::lightmap::{Atlas, AtlasOptions};
use crate::scene::{Mesh, Object};

/// Stripes of light as wide as `width` metres on what lies above y = 5, and an even light of 1 lx.
struct Stripes {
    width: f32,
}

impl Probe for Stripes {
    fn direct(&self, point: &Point) -> f32 {
        let bright = (point.position.x / self.width).rem_euclid(2.0) < 1.0;
        if point.position.y > 5.0 && bright {
            4.0
        } else {
            0.0
        }
    }

    fn bounced(&self, _: &Point, _: [f32; 2]) -> f32 {
        1.0
    }
}

/// Squares of 8 m: one in stripes, three not.
fn squares() -> Scene {
    let mesh = Mesh {
        name: "square".into(),
        positions: [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Z, Vec3::Z]
            .iter()
            .map(|p| 8.0 * *p)
            .collect(),
        normals: vec![Vec3::NEG_Y; 4],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let object = |i: u32| Object {
        name: format!("square {i}"),
        node: i,
        mesh: i,
        transform: Affine3A::from_translation(Vec3::Y * if i == 2 { 10.0 } else { 0.0 }),
    };
    Scene {
        // A mesh each: what shares a mesh shares its layout.
        meshes: (0..4).map(|_| Arc::new(mesh.clone())).collect(),
        objects: (0..4).map(object).collect(),
        ..Scene::default()
    }
}

fn lit(atlas: &Atlas, object: usize) -> usize {
    let place = &atlas.objects[object];
    fetched(&place.layout, place.size)
        .iter()
        .filter(|f| **f)
        .count()
}

fn build(width: f32, texels: u64) -> Atlas {
    let options = AtlasOptions {
        texels,
        ..AtlasOptions::default()
    };
    Atlas::build_lit(&squares(), &options, Some(&Stripes { width })).unwrap()
}

#[test]
fn texels_go_where_light_varies_and_stay_within_the_budget() {
    let atlas = build(0.5, 40_000);
    let all: usize = (0..4).map(|o| lit(&atlas, o)).sum();
    assert!((39_200..=40_800).contains(&all), "{all}");
    // 2 edges a metre of 4 lx along x, none along z; in any direction 2 / pi of that. The rest varies by 1 lx, and
    // the stripes by 3 lx, in a fortieth of 16 m. Density goes with the cube root.
    let smooth = 16.0f64 / 40.0;
    let ratio =
        ((8.0 * 2.0 / std::f64::consts::PI + 3.0 / smooth) / (1.0 / smooth)).powf(2.0 / 3.0);
    let found = lit(&atlas, 2) as f64 / lit(&atlas, 1) as f64;
    assert!(
        (found / ratio - 1.0).abs() < 0.1,
        "{found} instead of {ratio}"
    );
}

#[test]
fn where_light_is_even_so_are_the_texels() {
    let atlas = build(1e6, 10_000);
    let even = Atlas::build(
        &squares(),
        &AtlasOptions {
            texels: 10_000,
            ..AtlasOptions::default()
        },
    )
    .unwrap();
    // Bright and dark ones differ, but evenly lit ones do not.
    assert_eq!(lit(&atlas, 0), lit(&atlas, 1));
    assert!(lit(&even, 2) == lit(&even, 0) && lit(&atlas, 2) > lit(&atlas, 0));
}

#[test]
fn a_density_that_was_asked_for_is_kept() {
    let options = AtlasOptions {
        density: Some(10.0),
        ..AtlasOptions::default()
    };
    let atlas = Atlas::build_lit(&squares(), &options, Some(&Stripes { width: 0.5 })).unwrap();
    assert_eq!(lit(&atlas, 2), lit(&atlas, 1));
}

#[test]
fn one_thread_and_many_give_the_same_atlas() {
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| format!("{:?}", build(0.5, 5_000).objects))
    };
    assert_eq!(with(1), with(3));
}

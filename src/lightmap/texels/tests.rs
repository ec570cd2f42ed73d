//! The list's order and fillers, and the points and normals that texels stand for.

use std::sync::Arc;

use glam::{Affine3A, Mat3, Quat};
use proptest::prelude::*;

use super::*;
use crate::lightmap::{UvLayout, UvSource, UvVertex};
use crate::scene::Object;

/// A mesh that lies in the plane y = 0 as its layout does in uv, facing up; triangles of a fan around the origin.
fn fan(triangles: u32, charts: u32) -> (Mesh, UvLayout) {
    let positions: Vec<Vec3> = std::iter::once(Vec3::ZERO)
        .chain((0..=triangles).map(|i| {
            let angle = i as f32 / triangles as f32 * std::f32::consts::FRAC_PI_2;
            Vec3::new(30.0 * angle.cos(), 0.0, 30.0 * angle.sin())
        }))
        .collect();
    let triangles: Vec<_> = (1..=triangles).map(|i| [0, i + 1, i]).collect();
    let vertices = positions.iter().enumerate().map(|(i, p)| UvVertex {
        source: i as u32,
        uv: Vec2::new(p.x, p.z),
    });
    let layout = UvLayout {
        vertices: vertices.collect(),
        triangles: triangles.clone(),
        charts: (0..triangles.len() as u32).map(|i| i % charts).collect(),
    };
    let mesh = Mesh {
        normals: vec![Vec3::Y; positions.len()],
        positions,
        triangles,
        ..Mesh::default()
    };
    (mesh, layout)
}

/// One object per mesh and layout, side by side in one page, 32 texels wide each; claims as `claim(object, x, y)` says.
fn lay_out(
    meshes: Vec<(Mesh, UvLayout)>,
    claim: impl Fn(u32, u32, u32) -> Option<u32>,
) -> (Scene, Atlas, Claims) {
    let page_size = 128;
    let mut scene = Scene::default();
    let mut atlas = Atlas {
        page_size,
        pages: 1,
        density: 1.0,
        objects: Vec::new(),
    };
    let mut claims = Claims {
        pages: vec![vec![Claims::NONE; (page_size * page_size) as usize]],
        first_triangle: vec![0],
        ..Claims::default()
    };
    for (i, (mesh, layout)) in meshes.into_iter().enumerate() {
        let object = i as u32;
        let (origin, size) = (UVec2::new(32 * object, 5), UVec2::splat(32));
        let first = claims.first_triangle[i];
        for (y, x) in (0..size.y).flat_map(|y| (0..size.x).map(move |x| (y, x))) {
            if let Some(triangle) = claim(object, x, y) {
                let at = origin + UVec2::new(x, y);
                claims.pages[0][(at.y * page_size + at.x) as usize] = first + triangle;
            }
        }
        claims
            .first_triangle
            .push(first + layout.triangles.len() as u32);
        scene.meshes.push(Arc::new(mesh));
        scene.objects.push(Object {
            name: String::new(),
            node: object,
            mesh: object,
            transform: Affine3A::IDENTITY,
        });
        atlas.objects.push(ObjectAtlas {
            page: 0,
            origin,
            size,
            source: UvSource::Unwrapped,
            layout: Arc::new(layout),
        });
    }
    (scene, atlas, claims)
}

#[test]
fn the_list_goes_by_object_in_whole_tiles() {
    // The second object has no texels; the third a single one.
    let (scene, atlas, claims) =
        lay_out(
            vec![fan(7, 3), fan(4, 1), fan(5, 2)],
            |object, x, y| match object {
                0 => (x + y < 40).then_some((x * 13 + y * 7) % 7),
                1 => None,
                _ => (x == 9 && y == 2).then_some(3),
            },
        );
    let texels = Texels::build(&scene, &atlas, &claims);

    assert_eq!(texels.list.len() % Texel::TILE, 0);
    assert_eq!(texels.tiles.len(), 3);
    assert_eq!(texels.tiles[0].start, 0);
    assert!(texels.tiles[1].is_empty());
    assert_eq!(texels.tiles[2].len(), 1);
    assert_eq!(
        texels.tiles[2].end as usize * Texel::TILE,
        texels.list.len()
    );
    for (object, tiles) in texels.tiles.iter().enumerate() {
        let own =
            &texels.list[tiles.start as usize * Texel::TILE..tiles.end as usize * Texel::TILE];
        assert!(own.iter().all(|texel| texel.object == object as u32));
        let lit = own
            .iter()
            .position(|texel| texel.pixel == Texel::NONE)
            .unwrap_or(own.len());
        assert!(own.len() - lit < Texel::TILE);
        for filler in &own[lit..] {
            assert_eq!(
                *filler,
                Texel {
                    pixel: Texel::NONE,
                    ..own[lit - 1]
                }
            );
        }
    }
    let mut pixels: Vec<_> = texels
        .list
        .iter()
        .map(|t| t.pixel)
        .filter(|p| *p != Texel::NONE)
        .collect();
    pixels.sort_unstable();
    let claimed: Vec<_> = (0..128 * 128)
        .filter(|p| claims.pages[0][*p as usize] != Claims::NONE)
        .collect();
    assert_eq!(pixels, claimed);
    assert_eq!(texels.count as usize, claimed.len());
}

#[test]
fn points_lie_under_their_texels() {
    // Each texel of the fan is claimed by the triangle under it.
    let triangle_at = |x: u32, y: u32| {
        let center = Vec2::new(x as f32, y as f32) + 0.5;
        let sector = center.y.atan2(center.x) / std::f32::consts::FRAC_PI_2 * 6.0;
        (center.length() < 28.0).then_some((sector as u32).min(5))
    };
    let (scene, atlas, claims) = lay_out(vec![fan(6, 1)], |_, x, y| triangle_at(x, y));
    let texels = Texels::build(&scene, &atlas, &claims);
    assert!(texels.count > 500);
    for texel in texels.list.iter().filter(|t| t.pixel != Texel::NONE) {
        let center = Vec2::new(
            (texel.pixel % 128) as f32 + 0.5,
            (texel.pixel / 128) as f32 - 4.5,
        );
        let position = Vec3::from(texel.position);
        // Off the centre only where the centre is on a border between triangles.
        assert!(position.distance(Vec3::new(center.x, 0.0, center.y)) < 1.5 * INSET as f32);
        assert_eq!(texel.normal, [0.0, 1.0, 0.0]);
    }
}

#[test]
fn normals_are_interpolated_where_they_can_be_trusted() {
    let up = Vec3::Y;
    let tilted = Vec3::new(0.6, 0.8, 0.0);
    // Front of all but the last: up.
    let (mut mesh, layout) = fan(1, 1);
    let mut normal_with = |normals: [Vec3; 3]| {
        mesh.normals = normals.to_vec();
        let (scene, atlas, claims) = lay_out(vec![(mesh.clone(), layout.clone())], |_, x, y| {
            (x == 9 && y == 9).then_some(0)
        });
        Vec3::from(Texels::build(&scene, &atlas, &claims).list[0].normal)
    };
    assert_eq!(normal_with([up; 3]), up);
    assert!(normal_with([tilted; 3]).distance(tilted) < 1e-6);
    let blend = normal_with([up, tilted, up]);
    assert!(blend.x > 0.01 && blend.x < 0.59 && (blend.length() - 1.0).abs() < 1e-6);
    assert_eq!(normal_with([Vec3::ZERO; 3]), up);
    assert_eq!(normal_with([-up; 3]), up);
    assert_eq!(normal_with([Vec3::new(1.0, -1e-3, 0.0); 3]), up);
    assert_eq!(normal_with([Vec3::NAN; 3]), up);

    // A triangle that has no area in space has no side of its own.
    mesh.positions = vec![Vec3::ONE; 3];
    for (given, expected) in [(tilted, tilted), (-up, -up), (Vec3::ZERO, up)] {
        mesh.normals = vec![given; 3];
        let (scene, atlas, claims) = lay_out(vec![(mesh.clone(), layout.clone())], |_, x, y| {
            (x == 3 && y == 3).then_some(0)
        });
        let texel = Texels::build(&scene, &atlas, &claims).list[0];
        assert!(Vec3::from(texel.normal).distance(expected) < 1e-6);
        assert_eq!(texel.position, [1.0; 3]);
    }
}

/// The promise to whoever places texels: the inverse transpose takes normals to the front, mirrored or not.
#[test]
fn the_inverse_transpose_takes_normals_to_the_front() {
    let (mesh, layout) = fan(1, 1);
    let (scene, atlas, claims) = lay_out(vec![(mesh.clone(), layout)], |_, x, y| {
        (x == 9 && y == 9).then_some(0)
    });
    let normal = Vec3::from(Texels::build(&scene, &atlas, &claims).list[0].normal);
    for mirror in [1.0, -1.0] {
        let scale = Vec3::new(2.0 * mirror, 0.5, 3.0);
        let linear = Mat3::from_quat(Quat::from_rotation_z(0.7)) * Mat3::from_diagonal(scale);
        let [a, b, c] = mesh.triangles[0].map(|v| linear * mesh.positions[v as usize]);
        let front = (b - a).cross(c - a).normalize() * linear.determinant().signum();
        let world = (linear.inverse().transpose() * normal).normalize();
        assert!(world.distance(front) < 1e-5);
    }
}

fn distance_to_line(p: DVec2, a: DVec2, b: DVec2) -> f64 {
    (b - a).perp_dot(p - a).abs() / a.distance(b)
}

proptest! {
    /// The point is in the triangle, off its border, and nothing else off the border is nearer to the texel's centre.
    #[test]
    fn weights_are_of_the_nearest_inner_point(
        corners in prop::array::uniform3((0.0f32..24.0, 0.0f32..24.0)),
        shrink in prop::sample::select(vec![1.0f32, 0.1, 1e-3, 0.0]),
        thin in prop::sample::select(vec![1.0f32, 1e-2, 0.0]),
        center in (0u32..24, 0u32..24),
    ) {
        let first = Vec2::from(corners[0]);
        let uv = corners.map(|c| first + (Vec2::from(c) - first) * shrink * Vec2::new(1.0, thin));
        let center = Vec2::new(center.0 as f32, center.1 as f32) + 0.5;
        let weights = inner_weights(uv, center);
        prop_assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        prop_assert!(weights.iter().all(|w| (-1e-9..=1.0 + 1e-9).contains(w)), "{weights:?}");

        let v = uv.map(Vec2::as_dvec2);
        let at = |w: [f64; 3]| v[0] * w[0] + v[1] * w[1] + v[2] * w[2];
        let point = at(weights);
        let area = (v[1] - v[0]).perp_dot(v[2] - v[0]).abs();
        let perimeter = v[0].distance(v[1]) + v[1].distance(v[2]) + v[2].distance(v[0]);
        if area < 1e-6 {
            return Ok(());
        }
        let margin = INSET.min(INSET_SHARE * area / perimeter);
        let depth = |p: DVec2| (0..3).map(|i| distance_to_line(p, v[i], v[(i + 1) % 3])).fold(f64::INFINITY, f64::min);
        prop_assert!(depth(point) > margin - 1e-6);
        let reached = point.distance(center.as_dvec2());
        const STEPS: u32 = 40;
        for (i, j) in (0..=STEPS).flat_map(|i| (0..=STEPS - i).map(move |j| (i, j))) {
            let other = at([i, j, STEPS - i - j].map(|n| f64::from(n) / f64::from(STEPS)));
            if depth(other) > margin {
                prop_assert!(other.distance(center.as_dvec2()) > reached - 1e-6);
            }
        }
    }
}

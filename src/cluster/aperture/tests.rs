//! Tests of apertures' trees: flux, cuts, and that changed paths leave the tree of a new one.

use super::*;
use crate::cluster::Shape;
use crate::scene::Material;
use crate::transport::bvh::SceneBvh;
use crate::transport::testing::{add_quads, box_quads, light, material, quad, room};
use crate::transport::{PathSettings, trace};
use glam::Affine3A;

fn tree(quads: &[[Vec3; 4]], material: Material) -> (ApertureTree, Emitter) {
    let mut scene = room(0.5);
    add_quads(&mut scene, quads, material);
    let bvh = SceneBvh::build(&scene);
    let settings = PathSettings::for_paths(&scene, 2000);
    let paths = trace(&scene, &bvh, &settings);
    let emitter = Emitter::new(&scene, 0);
    (
        ApertureTree::new(&scene.lights[0], &emitter, &paths.lights[&3]),
        emitter,
    )
}

fn lamp(double_sided: bool) -> Material {
    material(Vec3::ZERO, Vec3::new(3.0, 2.0, 1.0), double_sided)
}

/// Every node's lights carry its exact flux, its parts' as well, and keys fall.
fn check(tree: &ApertureTree, path: u64, flux: Vec3) -> usize {
    let node = tree.node(path).expect("a node");
    let sum = |path: u64| tree.lights(path, 4).iter().map(|l| l.flux).sum::<Vec3>();
    assert!(
        (sum(path) - flux).abs().max_element() < 1e-4 * flux.x,
        "{path:b}: {} {flux}",
        sum(path)
    );
    if node.parts() == 0 {
        return 1;
    }
    let parts = [path << 1, path << 1 | 1];
    assert!(
        (parts.map(sum).iter().sum::<Vec3>() - flux)
            .abs()
            .max_element()
            < 1e-4 * flux.x
    );
    parts
        .iter()
        .map(|&p| {
            assert!(tree.node(p).expect("a part").key() <= node.key());
            check(tree, p, sum(p))
        })
        .sum()
}

#[test]
fn a_rectangle_is_one_polygon_and_splits_into_rectangles() {
    let (tree, emitter) = tree(
        &[quad(Vec3::new(-0.5, 0.9, -0.1), Vec3::X, Vec3::Z * 0.2)],
        lamp(false),
    );
    let root = tree.lights(1, 4);
    let [
        VirtualLight {
            shape: Shape::Polygon { vertices },
            ..
        },
    ] = &root[..]
    else {
        panic!("{root:?}")
    };
    assert_eq!(vertices.len(), 4);
    assert!(check(&tree, 1, emitter.flux) > 16);
    for path in [0b10, 0b111, 0b10101] {
        let [
            VirtualLight {
                shape: Shape::Polygon { vertices },
                normal,
                direct: true,
                ..
            },
        ] = &tree.lights(path, 4)[..]
        else {
            panic!("not one polygon");
        };
        assert!(vertices.len() == 4 && normal.y < -0.99);
    }
    assert!(tree.node(1 << 20).is_none() && tree.lights(1 << 20, 4).is_empty());
}

#[test]
fn boxes_and_two_sides_keep_their_flux() {
    let crate_ = box_quads(Vec3::splat(-0.2), Vec3::splat(0.2), false);
    let (faces, emitter) = tree(&crate_, lamp(false));
    assert_eq!(faces.root.facets.len(), 6);
    check(&faces, 1, emitter.flux);
    assert!(faces.lights(1, 4).len() <= 4);
    let (both, emitter) = tree(
        &[quad(Vec3::ZERO, Vec3::X * 0.5, Vec3::Y * 0.5)],
        lamp(true),
    );
    check(&both, 1, emitter.flux);
    let normals: Vec<Vec3> = both.lights(1, 4).iter().map(|l| l.normal).collect();
    assert_eq!(normals, [Vec3::Z, -Vec3::Z]);
}

#[test]
fn changed_paths_leave_the_tree_of_a_new_one() {
    let crate_ = box_quads(Vec3::splat(-0.2), Vec3::splat(0.2), false);
    let mut scene = room(0.5);
    add_quads(&mut scene, &crate_, lamp(true));
    let bvh = SceneBvh::build(&scene);
    let settings = PathSettings::for_paths(&scene, 700);
    let all = trace(&scene, &bvh, &settings).lights[&3].clone();
    let emitter = Emitter::new(&scene, 0);
    let build = |paths: &LightPaths| ApertureTree::new(&scene.lights[0], &emitter, paths);
    let mut paths = all.clone();
    let mut tree = build(&paths);
    // Most go dark, one after the other, then come back in another order with something nearer, or at all.
    let order: Vec<usize> = (0..all.paths.len())
        .map(|i| i * 311 % all.paths.len())
        .collect();
    for (step, &i) in order.iter().chain(order.iter().rev()).enumerate() {
        let old = paths.paths[i].emission;
        let mut new = all.paths[i].emission;
        if step < order.len() {
            new.scatter.distance = f32::INFINITY;
        } else if i % 2 == 0 {
            new.scatter.distance *= 0.5;
        }
        paths.paths[i].emission = new;
        tree.change(&EmissionChange {
            light: 3,
            path: i as u32,
            old: Some(old),
            new: Some(new),
        });
        if step % 100 == 0 {
            assert_eq!(tree, build(&paths));
        }
    }
    assert_eq!(tree, build(&paths));
    let mut found = 0;
    for path in &all.paths {
        let way = tree.locate(&path.emission);
        let leaf = tree.node(way).expect("a leaf");
        assert_eq!(leaf.parts(), 0);
        let Content::Leaf(starts) = &leaf.content else {
            continue;
        };
        found += usize::from(starts.iter().any(|s| s.position == path.emission.position));
    }
    assert_eq!(found, tree.root.count);
    assert_ne!(tree, build(&all));
}

#[test]
fn grids_merge_and_notches_stay() {
    let tile = |x: u32, y: u32| {
        quad(
            Vec3::new(x as f32 * 0.25, y as f32 * 0.25, 0.0),
            Vec3::X * 0.25,
            Vec3::Y * 0.25,
        )
    };
    let grid: Vec<_> = (0..9).map(|i| tile(i % 3, i / 3)).collect();
    assert_eq!(tree(&grid, lamp(false)).0.root.facets.len(), 1);
    let notched: Vec<_> = (0..8).map(|i| tile(i % 3, i / 3)).collect();
    let (notched, emitter) = tree(&notched, lamp(false));
    assert_eq!(notched.root.facets.len(), 2);
    check(&notched, 1, emitter.flux);
}

#[test]
fn punctual_lights_are_themselves() {
    let mut scene = room(0.5);
    let aim = Affine3A::from_rotation_x(-1.0);
    scene.lights.push(light(
        Aperture::Spot {
            inner: 0.1,
            outer: 0.2,
        },
        Vec3::new(1.0, 2.0, 3.0),
        aim,
    ));
    let emitter = Emitter::new(&scene, 0);
    let tree = ApertureTree::new(&scene.lights[0], &emitter, &LightPaths::default());
    let [spot] = &tree.lights(1, 4)[..] else {
        panic!("not one light")
    };
    assert_eq!(
        (&spot.shape, spot.flux),
        (
            &Shape::Spot {
                inner: 0.1,
                outer: 0.2
            },
            Vec3::new(1.0, 2.0, 3.0)
        )
    );
    assert!((spot.normal - aim.transform_vector3(Vec3::NEG_Z)).length() < 1e-6);
    assert_eq!(tree.node(1).map(|n| (n.key(), n.parts())), Some((0, 0)));
}

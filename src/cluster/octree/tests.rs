//! The tree, held to one built anew.

use glam::Vec3;

use super::*;
use crate::transport::{Scatter, VplKey};
use proptest::prelude::*;

fn vpl(i: u32, position: Vec3, distance: f32) -> Vpl {
    Vpl {
        key: VplKey {
            light: 0,
            path: i,
            bounce: 0,
        },
        position,
        normal: Vec3::Y,
        share: Vec3::new(1.5, 1.0, 0.5),
        weight: 1.0,
        flux: Vec3::new(0.3, 0.2, 0.1),
        object: 0,
        scatter: Scatter {
            distance,
            albedo: 0.6,
            ..Default::default()
        },
    }
}

/// Clumps, so that the tree gets deep, across the border between root cells, some with rays that left the scene.
fn vpls() -> impl Strategy<Value = Vec<Vpl>> {
    let coordinate = || prop_oneof![-400f32..-300.0, 0f32..0.01, 680f32..690.0];
    let one = (
        coordinate(),
        coordinate(),
        coordinate(),
        prop_oneof![0f32..10.0, Just(f32::INFINITY)],
    );
    prop::collection::vec(one, 0..150).prop_map(|all| {
        let each =
            |(i, (x, y, z, d)): (usize, (f32, f32, f32, f32))| vpl(i as u32, Vec3::new(x, y, z), d);
        all.into_iter().enumerate().map(each).collect()
    })
}

fn check(node: &Node, cell: Cell, scale: &FluxScale) {
    let [lo, hi] = cell.bounds();
    let slack = Vec3::splat(1e-4);
    assert!(
        node.vpls()
            .iter()
            .all(|v| v.position.cmpge(lo - slack).all() && v.position.cmple(hi + slack).all())
    );
    let mut sums = Sums::default();
    node.vpls()
        .iter()
        .for_each(|v| sums.add(&terms(v, scale, cell.level)));
    assert_eq!(*node.sums(), sums);
    assert_eq!(
        node.is_leaf(),
        node.sums.count as usize <= LEAF_CAPACITY || cell.level == MAX_LEVEL
    );
    assert!(node.sums.key <= node.sums.contribution);
    for (octant, child) in node.children() {
        assert!(child.sums.key <= node.sums.key && child.sums.count > 0);
        check(child, cell.child(octant), scale);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn the_tree_is_a_function_of_the_set(vpls in vpls(), order in any::<u64>(), keep in 0usize..150) {
        let scale = FluxScale::new(0.2);
        let keep = keep.min(vpls.len());
        let built = Octree::build(scale, &vpls[..keep]);
        for (cell, root) in built.roots() {
            check(root, cell, &scale);
            prop_assert_eq!(built.node(&cell), Some(root));
        }
        // In another order, with everything else added and removed in between.
        let mut shuffled: Vec<&Vpl> = vpls.iter().collect();
        shuffled.sort_by_key(|v| (u64::from(v.key.path) + 1).wrapping_mul(order | 1));
        let mut tree = Octree::new(scale);
        shuffled.iter().for_each(|v| tree.add(v));
        for v in shuffled.iter().filter(|v| v.key.path as usize >= keep) {
            let mut other = **v;
            (other.scatter.distance, other.scatter.albedo) = (0.5, 0.9);
            let dimmed = Vpl { flux: other.flux * 0.3, ..other };
            for [from, to] in [[**v, other], [other, dimmed], [dimmed, **v]] {
                prop_assert_eq!(tree.revise(&[[from, to]]), 1);
                prop_assert_eq!(tree.revise(&[[from, to]]), 0);
            }
            prop_assert!(tree.remove(v));
            prop_assert!(!tree.remove(v));
        }
        prop_assert_eq!(tree, built);
    }
}

#[test]
fn bulk_adds_are_fast_and_equal_to_single_ones() {
    let sequence = crate::transport::sampling::Sequence::new(3, 0);
    let all: Vec<Vpl> = (0..20_000)
        .map(|i| {
            let [x, y, z, d] = sequence.sample(i, 0);
            vpl(i, Vec3::new(x * 9.0, (y * 3.0).round(), z * 5.0), d * 4.0)
        })
        .collect();
    let mut one_by_one = Octree::new(FluxScale::new(0.2));
    all.iter().rev().for_each(|v| one_by_one.add(v));
    assert_eq!(one_by_one, Octree::build(FluxScale::new(0.2), &all));
}

#[test]
fn all_that_is_dimmed_leaves_the_tree_of_what_it_became() {
    let sequence = crate::transport::sampling::Sequence::new(4, 0);
    let scale = FluxScale::new(0.2);
    let pairs: Vec<[Vpl; 2]> = (0..20_000)
        .map(|i| {
            let [x, y, z, d] = sequence.sample(i, 0);
            let old = vpl(i, Vec3::new(x * 9.0, (y * 3.0).round(), z * 5.0), d * 4.0);
            let mut new = Vpl {
                flux: old.flux * d,
                ..old
            };
            if d > 0.7 {
                new.scatter.distance *= x;
            }
            [old, new]
        })
        .collect();
    let [old, new] = [0, 1].map(|at| Octree::build(scale, pairs.iter().map(|p| &p[at])));
    let mut tree = old.clone();
    assert_eq!(tree.revise(&pairs), pairs.len());
    assert_eq!(tree, new);
    assert_eq!(tree.revise(&pairs[..500]), 0);
    assert_eq!(tree, new);
}

//! Tests of the wanted cells: after any changes they are what is made from nothing.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::Vec3;
use proptest::prelude::*;

use super::border::join;
use super::similarity::Groups;
use super::{Budget, Cell, CellId, Clusters, Selected, SimilaritySettings, VirtualLight, Wanted};
use crate::scene::Scene;
use crate::scene::edit::Change;
use crate::transport::bvh::SceneBvh;
use crate::transport::testing::cornell;
use crate::transport::validate_tests::{edit, lit};
use crate::transport::{Differences, Validator};
use crate::transport::{PathSet, Vpl};
use crate::transport::{PathSettings, trace};

fn traced(paths: u32) -> (Scene, PathSet, PathSettings) {
    let scene = cornell();
    let settings = PathSettings::for_paths(&scene, paths);
    let set = trace(&scene, &SceneBvh::build(&scene), &settings);
    (scene, set, settings)
}

fn from_nothing(clusters: &Clusters, budget: Budget) -> BTreeMap<CellId, Arc<Selected>> {
    let selected = clusters.virtual_lights(&clusters.select(budget));
    selected
        .into_iter()
        .map(|s| (s.cell, Arc::new(s)))
        .collect()
}

/// Every VPL is in one cell: as many as there are, none twice. Returns how many crossed a border.
fn check_vpls(clusters: &Clusters, cells: &BTreeMap<CellId, Arc<Selected>>) -> usize {
    let mut all: Vec<u64> = cells.values().flat_map(|s| s.vpls.clone()).collect();
    all.sort_unstable();
    all.dedup();
    let held: usize = cells.values().map(|s| s.vpls.len()).sum();
    let octree = cells.keys().filter_map(|id| match id {
        CellId::Octree(cell) => clusters.octree.node(cell).map(|n| (id, n.vpls().len())),
        CellId::Aperture { .. } => None,
    });
    let (mut own, mut came) = (0, 0);
    for (id, vpls) in octree {
        own += vpls;
        came += cells[id].vpls.len().saturating_sub(vpls);
    }
    assert_eq!((all.len(), held), (own, own));
    came
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn wanted_is_what_is_made_from_nothing(
        changes in prop::collection::vec((any::<u64>(), 0usize..4, 5usize..400), 1..8)
    ) {
        let (scene, set, settings) = traced(1500);
        let mut clusters = Clusters::new(&scene, &set, &settings, SimilaritySettings::default());
        let mut wanted = Wanted::new();
        let mut known = BTreeMap::new();
        let mut out: BTreeMap<_, Vpl> = BTreeMap::new();
        for (seed, kind, cells) in changes {
            let pick = |v: &&Vpl| {
                let place = v.position.x.to_bits() as u64;
                let mixed = (u64::from(v.key.path) << 8 | u64::from(v.key.bounce)) ^ seed;
                match kind {
                    // Everything on one side, some of all, and none.
                    0 => v.position.x > (seed % 19) as f32 * 0.1 - 0.9,
                    1 => mixed.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 60 == 3,
                    2 => place % 100 == seed % 100,
                    _ => false,
                }
            };
            let (back, gone): (Vec<Vpl>, Vec<Vpl>) =
                set.vpls().filter(pick).partition(|v| out.contains_key(&v.key));
            let differences = Differences {
                added: back.clone(),
                removed: gone.clone(),
                ..Default::default()
            };
            clusters.apply(&scene, &set, &differences);
            back.iter().for_each(|v| { out.remove(&v.key); });
            out.extend(gone.iter().map(|v| (v.key, *v)));
            for budget in [Budget::Cells(cells), Budget::Auto { error: 1.0 / (cells * cells) as f64 }] {
                let changed = wanted.update(&clusters, budget);
                let expected = from_nothing(&clusters, budget);
                prop_assert_eq!(wanted.cells(), &expected);
                let ids: BTreeSet<CellId> = known.keys().chain(expected.keys()).copied().collect();
                let differ = ids.into_iter().filter(|c| known.get(c) != expected.get(c));
                prop_assert_eq!(changed, differ.collect::<BTreeSet<_>>());
                known = expected;
                check_vpls(&clusters, &known);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    #[test]
    fn edits_leave_no_trace(edits in prop::collection::vec((edit(), 0usize..3), 1..8)) {
        let mut scene = lit();
        let mut bvh = SceneBvh::build(&scene);
        let settings = PathSettings::for_paths(&scene, 400);
        let similarity = SimilaritySettings::default();
        let mut validator = Validator::new(&scene, &bvh, &settings);
        let mut clusters = Clusters::new(&scene, validator.paths(), &settings, similarity);
        let mut wanted = Wanted::new();
        for (edit, steps) in edits {
            let old = scene.clone();
            edit.apply(&mut scene);
            let change = Change::between(&old, &scene);
            bvh = bvh.moved(&scene, &change.objects);
            validator.invalidate(&scene, &change);
            for _ in 0..steps {
                let differences = validator.step(&scene, &bvh, 60);
                clusters.apply(&scene, validator.paths(), &differences);
                wanted.update(&clusters, Budget::Cells(60));
            }
        }
        while !validator.is_valid() {
            let differences = validator.step(&scene, &bvh, 100);
            clusters.apply(&scene, validator.paths(), &differences);
        }
        wanted.update(&clusters, Budget::Cells(60));
        let paths = trace(&scene, &SceneBvh::build(&scene), &settings);
        let fresh = Clusters::new(&scene, &paths, &settings, similarity);
        prop_assert_eq!(&clusters.octree, &fresh.octree);
        let trees = |c: &Clusters| -> Vec<_> {
            c.apertures.iter().map(|(l, (_, tree))| (*l, tree.clone())).collect()
        };
        prop_assert_eq!(trees(&clusters), trees(&fresh));
        prop_assert_eq!(wanted.cells(), &from_nothing(&fresh, Budget::Cells(60)));
        prop_assert_eq!(wanted.error(), fresh.select(Budget::Cells(60)).error);
    }
}

#[test]
fn what_crosses_a_border_depends_on_the_cells_beside_it_alone() {
    let (scene, set, settings) = traced(6000);
    let similarity = SimilaritySettings::default();
    let clusters = Clusters::new(&scene, &set, &settings, similarity);
    let cells: Vec<(Cell, Groups)> = clusters
        .select(Budget::Cells(150))
        .cells
        .into_iter()
        .filter_map(|id| match id {
            CellId::Octree(cell) => {
                let vpls = clusters.octree.node(&cell)?.vpls();
                Some((cell, Groups::new(cell, vpls, &similarity)))
            }
            CellId::Aperture { .. } => None,
        })
        .collect();
    let all = join(cells.clone(), &similarity);
    // Cells that share a face, by their bounds.
    let beside = |a: &Cell, b: &Cell| {
        let ([a0, a1], [b0, b1]) = (a.bounds(), b.bounds());
        let apart = (b0 - a1).max(a0 - b1).to_array();
        apart.iter().filter(|d| **d < -1e-4).count() == 2 && apart.iter().all(|d| *d < 1e-4)
    };
    for cell in all.keys() {
        let near = |(c, _): &&(Cell, Groups)| c == cell || beside(c, cell);
        let alone = join(cells.iter().filter(near).cloned().collect(), &similarity);
        assert_eq!(alone[cell].1, all[cell].1);
    }
    let crossed: usize = all.values().map(|(_, b)| b.left().len()).sum();
    assert!(crossed > 20, "{crossed}");
    let cells = from_nothing(&clusters, Budget::Cells(150));
    assert!(check_vpls(&clusters, &cells) > 10);
}

#[test]
fn what_stands_for_light_stays_where_it_is_when_lights_are_dimmed() {
    let scene = lit();
    let bvh = SceneBvh::build(&scene);
    let settings = PathSettings::for_paths(&scene, 4000);
    let cells = |scene: &Scene| {
        let paths = trace(scene, &bvh, &settings);
        let clusters = Clusters::new(scene, &paths, &settings, SimilaritySettings::default());
        from_nothing(&clusters, Budget::Auto { error: 2e-3 })
    };
    let before = cells(&scene);
    let mut dimmed = scene.clone();
    dimmed.materials[5].emission *= Vec3::new(0.9, 0.5, 0.2);
    dimmed.lights.iter_mut().for_each(|l| l.intensity *= 0.1);
    let after = cells(&dimmed);
    assert!(before.len() > 100 && before.keys().eq(after.keys()));
    for (a, b) in before.values().zip(after.values()) {
        assert_eq!(a.vpls, b.vpls);
        assert_eq!(a.lights.len(), b.lights.len());
        for (a, b) in a.lights.iter().zip(&b.lights) {
            assert!(a.is_dimmed(b) && b.flux.cmple(a.flux).all());
        }
    }
    // Nothing stands for lights that are off.
    let mut off = scene.clone();
    off.lights.iter_mut().for_each(|l| l.intensity = Vec3::ZERO);
    let lamp_alone = cells(&off);
    assert!(before.keys().eq(lamp_alone.keys()));
    let lights = |cells: &BTreeMap<_, Arc<Selected>>| -> Vec<VirtualLight> {
        cells.values().flat_map(|c| c.lights.clone()).collect()
    };
    let (all, left) = (lights(&before), lights(&lamp_alone));
    assert!(left.len() < all.len() && left.iter().all(|l| l.flux != Vec3::ZERO));
}

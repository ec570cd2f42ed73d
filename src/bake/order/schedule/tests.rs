//! The schedule, held to what every plan must keep.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::Vec3;

use super::*;
use crate::bake::order::brightness::Brightness;
use crate::bake::order::parts::{join, seen_first};
use crate::bake::order::places::Around;
use crate::bake::order::plan::Plan;
use crate::cluster::Shape;
use crate::scene::Scene;
use crate::scene::builtin::builtin;
use crate::transport::SceneBvh;

fn light(x: f32, flux: f32) -> VirtualLight {
    VirtualLight {
        shape: Shape::Disk { area: 0.01 },
        position: Vec3::new(x, 0.0, 0.0),
        normal: Vec3::Y,
        surface: Vec3::Y,
        flux: Vec3::splat(flux),
        direct: false,
    }
}

fn cell(path: u64) -> CellId {
    CellId::Aperture { light: 0, path }
}

fn selected(path: u64, lights: Vec<VirtualLight>, vpls: &[u64]) -> Arc<Selected> {
    Arc::new(Selected {
        cell: cell(path),
        lights,
        vpls: vpls.to_vec(),
    })
}

fn all(cells: &[Arc<Selected>]) -> BTreeMap<CellId, Arc<Selected>> {
    cells.iter().map(|s| (s.cell, s.clone())).collect()
}

fn held(cells: &[Arc<Selected>]) -> BTreeMap<CellId, Held> {
    let hold = |s: &Arc<Selected>| Held {
        selected: s.clone(),
        version: 0,
    };
    cells.iter().map(|s| (s.cell, hold(s))).collect()
}

/// As in an aperture's tree: the way without its last bit.
fn parent(cell: &CellId) -> Option<CellId> {
    match cell {
        CellId::Aperture { light, path } if *path > 1 => Some(CellId::Aperture {
            light: *light,
            path: path / 2,
        }),
        _ => None,
    }
}

#[test]
fn cells_that_overlap_or_swapped_vpls_are_exchanged_together_and_others_apart() {
    let old = [
        // Refined: its parts come.
        selected(0b10, vec![light(0.0, 2.0)], &[]),
        // Merged, from 0b1100 and 0b1101.
        selected(0b1100, vec![light(1.0, 1.0)], &[]),
        selected(0b1101, vec![light(1.1, 1.0)], &[]),
        // The first has VPLs that the second gets; others go and come there and in the third.
        selected(0b11100, vec![light(2.0, 1.0)], &[1, 2, 3, 9]),
        selected(0b11110, vec![light(2.1, 1.0)], &[4, 5]),
        selected(0b11101, vec![light(2.2, 1.0)], &[6, 7]),
        // One that stays.
        selected(0b11111, vec![light(3.0, 1.0)], &[8]),
    ];
    let new = [
        selected(0b100, vec![light(0.0, 1.0)], &[]),
        selected(0b101, vec![light(0.1, 1.0)], &[]),
        selected(0b110, vec![light(1.05, 2.0)], &[]),
        selected(0b11100, vec![light(2.0, 0.5)], &[1, 2]),
        selected(0b11110, vec![light(2.1, 1.5)], &[3, 5, 11]),
        selected(0b11101, vec![light(2.2, 0.9)], &[7, 10]),
        selected(0b11111, vec![light(3.0, 1.0)], &[8]),
    ];
    let groups = exchanges(&held(&old), &all(&new), parent);
    let cells = |paths: &[u64]| paths.iter().map(|p| cell(*p)).collect::<Vec<_>>();
    let expected: BTreeSet<_> = [
        (cells(&[0b10]), cells(&[0b100, 0b101])),
        (cells(&[0b1100, 0b1101]), cells(&[0b110])),
        (cells(&[0b11100, 0b11110]), cells(&[0b11100, 0b11110])),
        (cells(&[0b11101]), cells(&[0b11101])),
    ]
    .into();
    assert_eq!(groups.len(), expected.len());
    assert_eq!(groups.into_iter().collect::<BTreeSet<_>>(), expected);
}

fn update(kind: Kind, path: u64, visible: f64, cost: f64, invalid: f64) -> Update {
    Update {
        kind,
        what: What::Advance(cell(path)),
        gain: visible,
        parts: Parts::ALL,
        shown: [0.0, visible],
        invalid,
        work: Work::of(cost),
        lights: 1,
    }
}

#[test]
fn what_shows_most_for_its_work_goes_first() {
    // Per work: 2, 1.5, 3. By their squares, the second would go before the first.
    let updates = [(1, 2.0, 1.0), (2, 3.0, 2.0), (3, 6.0, 2.0)]
        .map(|(path, visible, cost)| update(Kind::Validation, path, visible, cost, 1.0));
    let mut plan = Plan::new(updates.to_vec(), 0.0);
    let order: Vec<_> = std::iter::from_fn(|| plan.next(0.1))
        .map(|u| u.what)
        .collect();
    assert_eq!(order, [3, 1, 2].map(|p| What::Advance(cell(p))));
}

#[test]
fn direct_light_is_done_apart_and_what_is_left_is_known_all_the_time() {
    let indirect = |i: i64| {
        CellId::Octree(crate::cluster::Cell {
            level: 3,
            index: [i, 0, 0],
        })
    };
    let updates = (0..20).map(|i| {
        let visible = f64::from(i * 7 % 20);
        let mut update = update(Kind::Validation, i as u64 + 1, visible, 1.0, 1.0);
        if i % 3 == 0 {
            update.what = What::Advance(indirect(i.into()));
        }
        update
    });
    let mut plan = Plan::new(updates.collect(), 0.0);
    let mut left: f64 = (0..20).map(f64::from).sum();
    let mut last = f64::INFINITY;
    for round in 0..20 {
        assert!((plan.invalid_flux() - left).abs() < 1e-9 && plan.len() == 20 - round);
        let update = if round < 5 {
            let direct = plan.next_direct().unwrap();
            assert!(matches!(
                direct.what,
                What::Advance(CellId::Aperture { .. })
            ));
            direct
        } else {
            let next = plan.next(0.1).unwrap();
            assert!(round == 5 || next.shown[1] <= last);
            last = next.shown[1];
            next
        };
        left -= update.gain;
    }
    assert!(plan.next(0.1).is_none() && plan.next_direct().is_none());
}

#[test]
fn validation_and_balancing_share_the_work_by_what_is_invalid() {
    let shares = |invalid: f64| {
        let of = |kind| (0..400).map(move |i| update(kind, i, 1.0, 1.0, invalid));
        let updates = of(Kind::Validation).chain(of(Kind::Balancing)).collect();
        let mut plan = Plan::new(updates, 0.0);
        let done: Vec<_> = (0..300).filter_map(|_| plan.next(0.1)).collect();
        let validation = done.iter().filter(|u| u.kind == Kind::Validation);
        validation.count() as f64 / 300.0
    };
    assert!((shares(1.0) - 1.0).abs() < 0.01);
    assert!((shares(0.1) - 0.5).abs() < 0.01);
    assert!((shares(0.01) - 0.5).abs() < 0.01);
    let between = shares(0.4);
    assert!(between > 0.6 && between < 0.9, "{between}");
}

#[test]
fn balancing_waits_for_its_share_and_for_what_is_most_wrong() {
    let share = |cost: f64| update(Kind::Balancing, 0, 1e3, cost, 0.0);
    let few = |i| update(Kind::Validation, i, 2.0, 1.0, 0.1);
    let turn = |updates: Vec<Update>| {
        let mut plan = Plan::new(updates, 0.0);
        let done = std::iter::from_fn(|| plan.next(0.1));
        let kinds: Vec<_> = done.map(|u| u.kind).collect();
        kinds.iter().position(|k| *k == Kind::Balancing)
    };
    // As much work of both: the one that is long comes when the other has done as much.
    assert_eq!(
        turn((1..40).map(few).chain([share(10.0)]).collect()),
        Some(10)
    );
    // Far more lumens are wrong in an update that is dear, and so comes last.
    let dear = update(Kind::Validation, 50, 30.0, 1e4, 1.0);
    assert_eq!(
        turn((1..40).map(few).chain([share(10.0), dear]).collect()),
        Some(40)
    );
}

#[test]
fn balancing_waits_for_validation_that_shows_more() {
    let balancing = update(Kind::Balancing, 0, 1.5, 1.0, 0.0);
    let validation = (1..9).map(|i| update(Kind::Validation, i, i as f64, 1.0, 0.01));
    let mut plan = Plan::new(validation.chain([balancing]).collect(), 0.0);
    let order: Vec<_> = std::iter::from_fn(|| plan.next(0.1)).collect();
    let at = order.iter().position(|u| u.kind == Kind::Balancing);
    assert_eq!((at, order.len()), (Some(7), 9));
}

/// What of an exchange shows is what its lights do not share, and of what leaves an earlier scene what goes towards the change.
#[test]
fn an_exchange_shows_what_its_lights_do_not_share() {
    let scene = Scene::from_document(&builtin("integrating-sphere").unwrap()).unwrap();
    let bvh = SceneBvh::build(&scene);
    let bounds = scene.bounds();
    let around = Around::new(&scene, &bvh, 0.0, None);
    let below = |x: f32, flux| VirtualLight {
        position: bounds.center() + Vec3::new(x, -0.49, 0.0) * bounds.size().x,
        ..light(0.0, flux)
    };
    let visible = |old: &[VirtualLight], new: &[VirtualLight], towards: &[Towards]| {
        let old = [selected(1, old.to_vec(), &[])];
        let new = [selected(1, new.to_vec(), &[])];
        let mut brightness = Brightness::default();
        brightness.learn(&around, old.iter().chain(&new));
        let (held, wanted) = (held(&old), all(&new));
        let group = (vec![cell(1)], vec![cell(1)]);
        let none = |_: &CellId| 0.0;
        let judge = Judge {
            brightness: &brightness,
            around: &around,
        };
        let update = exchange(group, Parts::ALL, &held, &wanted, judge, none, none);
        update.beside(towards).shown[1]
    };
    let (still, old) = (below(0.1, 10.0), below(0.0, 1.0));
    let comes = visible(&[], std::slice::from_ref(&old), &[]);
    let near = visible(
        &[still.clone(), old.clone()],
        &[still.clone(), below(0.001, 1.0)],
        &[],
    );
    assert!(near > 0.0 && near < 0.1 * comes, "{near} {comes}");
    let one = std::slice::from_ref(&old);
    let dimmed = visible(one, &[below(0.0, 0.9)], &[]);
    assert!((dimmed / comes - 0.1).abs() < 1e-3, "{dimmed} {comes}");
    let towards = Towards {
        met: 0.0,
        shown: [0.0, comes],
    };
    let shaded = visible(one, &[below(0.0, 0.9)], &[towards]);
    assert!((shaded - dimmed.hypot(comes)).abs() < 1e-6 * comes);
}

fn shown(path: u64, shown: Both, work: f64) -> Update {
    Update {
        what: What::Exchange {
            subtract: Vec::new(),
            add: vec![CellId::Octree(crate::cluster::cell::Cell::at(
                Vec3::splat(path as f32),
                3,
            ))],
        },
        shown,
        ..update(Kind::Validation, path, 1.0, work, 1.0)
    }
}

/// What is seen of an update is done by itself, unless what is not seen of it matters as much, or hardly anything is seen.
#[test]
fn what_is_seen_is_done_first_where_that_shows_more_for_its_work() {
    let updates = vec![
        shown(1, [10.0, 1.0], 1.0),
        shown(2, [1.0, 10.0], 1.0),
        shown(3, [0.05, 0.0], 1.0),
        // Direct light.
        update(Kind::Validation, 4, 10.0, 1.0, 1.0),
    ];
    let gain: f64 = updates.iter().map(|u| u.gain).sum();
    let done = seen_first(updates.clone());
    let parts: Vec<_> = done.iter().map(|u| (u.parts, u.what.clone())).collect();
    let what = |i: usize| updates[i].what.clone();
    let expected = [
        (Parts::SEEN, what(0)),
        (Parts::REST, what(0)),
        (Parts::ALL, what(1)),
        (Parts::ALL, what(2)),
        (Parts::ALL, what(3)),
    ];
    assert_eq!(parts, expected);
    assert!((done.iter().map(|u| u.gain).sum::<f64>() - gain).abs() < 1e-9);
    let order: Vec<_> = {
        let mut plan = Plan::new(done, 0.0);
        std::iter::from_fn(|| plan.next(0.1))
            .map(|u| (u.parts, u.what))
            .collect()
    };
    let at = |parts, i| order.iter().position(|o| *o == (parts, what(i)));
    assert!(at(Parts::SEEN, 0) < at(Parts::REST, 0));
}

/// Two parts that want the same of cells that they hold in the same way are done at once.
#[test]
fn what_is_the_same_in_both_parts_is_joined() {
    let of = |path, parts| Update {
        parts,
        ..update(Kind::Validation, path, 1.0, 1.0, 1.0)
    };
    let updates = vec![
        of(1, Parts::SEEN),
        of(2, Parts::SEEN),
        of(3, Parts::SEEN),
        of(1, Parts::REST),
        of(3, Parts::REST),
        of(4, Parts::REST),
    ];
    let joined = join(updates, |c| *c != cell(3));
    let parts: Vec<_> = joined
        .iter()
        .map(|u| (u.what.cells()[0], u.parts))
        .collect();
    let expected = [
        (cell(1), Parts::ALL),
        (cell(2), Parts::SEEN),
        (cell(3), Parts::SEEN),
        (cell(3), Parts::REST),
        (cell(4), Parts::REST),
    ];
    assert_eq!(parts, expected);
    assert_eq!(join(joined.clone(), |_| true).len(), 4);
}

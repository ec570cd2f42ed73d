//! What to do next: the differences between what the map holds and what it should hold, cut into updates that keep every
//! lumen counted once, the most visible first (IBGI section 4.4).

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use glam::Vec3;

use super::brightness::Judge;
use super::estimate::{alone, lumens, shown};
use super::shown::{Shining, difference};
use super::sight::{Both, norm_in};
use super::towards::Towards;
use super::work::Work;
use crate::bake::device::records::{Parts, Region};
use crate::bake::world::versions::Version;
use crate::cluster::{CellId, Selected, VirtualLight};

/// A cell whose lights are in the map.
#[derive(Clone, Debug)]
pub(in crate::bake) struct Held {
    pub selected: Arc<Selected>,
    /// The scene that they were added in.
    pub version: Version,
}

impl Held {
    /// Whether another one holds the same lights, added in the same scene.
    pub(in crate::bake) fn is_same(&self, other: &Self) -> bool {
        self.version == other.version && is_same(&self.selected, &other.selected)
    }

    /// Its lights with the version that they were added in.
    pub(in crate::bake) fn lights(&self) -> impl Iterator<Item = (VirtualLight, Version)> + '_ {
        let lights = self.selected.lights.iter();
        lights.map(|light| (light.clone(), self.version))
    }
}

/// The two processes that IBGI interleaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Brings light up to date with the scene.
    Validation,
    /// Refines cells, or merges them.
    Balancing,
}

impl Kind {
    /// In lower case.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Validation => "validation",
            Kind::Balancing => "balancing",
        }
    }
}

/// A change of the map that is done whole or not at all.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::bake) struct Update {
    pub kind: Kind,
    pub what: What,
    /// Lumens that are wrong until then, estimated. Of balancing, by how much the metric falls.
    pub gain: f64,
    /// In which parts of the map it is to be done.
    pub parts: Parts,
    /// What of it is seen in either part: the norm of the irradiance that is wrong, lux m, estimated.
    pub shown: Both,
    /// The share of its cells' flux that these are, at most 1.
    pub invalid: f64,
    /// Evaluations of lights, estimated.
    pub work: Work,
    /// Lights to send to the device.
    pub lights: u64,
}

impl Update {
    /// What is seen of it for its work: what the order goes by.
    pub(in crate::bake) fn worth(&self) -> f64 {
        norm_in(self.parts, self.shown).powf(TOGETHER) / self.work()
    }

    /// Evaluations of lights, estimated, in the parts of the map that it is for.
    pub(in crate::bake) fn work(&self) -> f64 {
        self.work.within(self.parts)
    }

    /// What of it is to be done in some parts of the map alone.
    pub(super) fn within(&self, parts: Parts) -> Self {
        Self {
            parts,
            gain: 0.5 * self.gain,
            ..self.clone()
        }
    }

    /// With what of the light that leaves goes towards what changed: it may be in its shadow now.
    pub(in crate::bake) fn beside(mut self, towards: &[Towards]) -> Self {
        for towards in towards {
            for (shown, more) in self.shown.iter_mut().zip(towards.shown) {
                *shown = shown.hypot(more);
            }
        }
        self
    }

    /// Whether it is about direct light alone.
    pub(in crate::bake) fn is_direct(&self) -> bool {
        self.what
            .cells()
            .iter()
            .all(|c| matches!(c, CellId::Aperture { .. }))
    }

    /// Cells that it takes out of the map.
    pub(in crate::bake) fn leaving(&self) -> &[CellId] {
        match &self.what {
            What::Advance(_) => &[],
            What::Exchange { subtract, .. } => subtract,
        }
    }
}

/// Which cells an update is about.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::bake) enum What {
    /// The cell's lights are the right ones, but were added in an earlier scene.
    Advance(CellId),
    /// Some cells leave, others come.
    Exchange {
        subtract: Vec<CellId>,
        add: Vec<CellId>,
    },
}

impl What {
    /// All cells that it is about.
    pub(in crate::bake) fn cells(&self) -> Vec<CellId> {
        match self {
            What::Advance(cell) => vec![*cell],
            What::Exchange { subtract, add } => [&subtract[..], add].concat(),
        }
    }
}

/// What tells which lights an edit made wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Priority {
    /// The paths that it changed (IBGI section 4.2), and the light that falls on the bounds of what it changed: that also
    /// finds what no path happened to meet.
    #[default]
    Bounds,
    /// The paths alone.
    Paths,
}

/// How what several updates show adds up, as a power: 2 if what is wrong in one place had nothing to do with what is wrong in
/// another, 1 if all of it did: many faint shadows of one wall add up. Between the two, walls take the least work, up to a fifth
/// less than at either.
const TOGETHER: f64 = 1.25;
/// Of what paths found wrong in a light, how much counts at least if rays do not find it.
const UNSURE: f64 = 0.1;
/// Of a virtual light that only changed its shape, how much of its flux counts as wrong: its place in the cell is new,
/// most of what it lights is not.
const RESHAPED: f64 = 0.1;

/// Groups of cells to exchange, from held to wanted: cells that overlap go together, and so do a cell that loses a VPL and its
/// neighbour that gets it. Cells that are held as they are wanted are in no group.
pub(in crate::bake) fn exchanges(
    held: &BTreeMap<CellId, Held>,
    wanted: &BTreeMap<CellId, Arc<Selected>>,
    parent: impl Fn(&CellId) -> Option<CellId>,
) -> Vec<(Vec<CellId>, Vec<CellId>)> {
    let leaving: BTreeSet<CellId> = held
        .iter()
        .filter(|(id, h)| !wanted.get(id).is_some_and(|w| is_same(&h.selected, w)))
        .map(|(id, _)| *id)
        .collect();
    let coming: BTreeSet<CellId> = wanted
        .iter()
        .filter(|(id, w)| !held.get(id).is_some_and(|h| is_same(&h.selected, w)))
        .map(|(id, _)| *id)
        .collect();
    let mut groups = Groups::default();
    for (cells, others) in [(&leaving, &coming), (&coming, &leaving)] {
        for cell in cells {
            groups.root(*cell);
            let above = std::iter::successors(parent(cell), &parent);
            if let Some(top) = above.into_iter().find(|a| others.contains(a)) {
                groups.join(*cell, top);
            }
        }
    }
    // Who had the VPLs that a cell loses, and who gets them.
    let none: &[u64] = &[];
    let of = |cell: &CellId| {
        let old = held.get(cell).map_or(none, |h| &h.selected.vpls);
        (old, wanted.get(cell).map_or(none, |w| &w.vpls))
    };
    let mut had: HashMap<u64, CellId> = HashMap::new();
    for cell in &leaving {
        let (old, new) = of(cell);
        had.extend(without(old, new).map(|vpl| (vpl, *cell)));
    }
    for cell in &coming {
        let (old, new) = of(cell);
        for vpl in without(new, old) {
            if let Some(from) = had.get(&vpl) {
                groups.join(*cell, *from);
            }
        }
    }
    let mut out: BTreeMap<CellId, (Vec<CellId>, Vec<CellId>)> = BTreeMap::new();
    for cell in &leaving {
        out.entry(groups.root(*cell)).or_default().0.push(*cell);
    }
    for cell in &coming {
        out.entry(groups.root(*cell)).or_default().1.push(*cell);
    }
    out.into_values().collect()
}

fn is_same(a: &Arc<Selected>, b: &Arc<Selected>) -> bool {
    Arc::ptr_eq(a, b) || a == b
}

/// Numbers of one ascending list that are not in another.
fn without<'a>(list: &'a [u64], other: &'a [u64]) -> impl Iterator<Item = u64> + 'a {
    let mut others = other.iter().peekable();
    list.iter().copied().filter(move |number| {
        while others.next_if(|other| *other < number).is_some() {}
        others.peek() != Some(&number)
    })
}

/// Disjoint sets of cells.
#[derive(Default)]
struct Groups(BTreeMap<CellId, CellId>);

impl Groups {
    fn root(&mut self, cell: CellId) -> CellId {
        let up = *self.0.entry(cell).or_insert(cell);
        if up == cell {
            return cell;
        }
        let root = self.root(up);
        self.0.insert(cell, root);
        root
    }

    fn join(&mut self, a: CellId, b: CellId) {
        let (a, b) = (self.root(a), self.root(b));
        // The smaller name leads, so that the result does not depend on the order of joins.
        self.0.insert(a.max(b), a.min(b));
    }
}

/// The update that exchanges cells in some parts of the map. `key`: the balancing metric. `ledger`: lumens that validation found invalid in a cell.
pub(in crate::bake) fn exchange(
    (subtract, add): (Vec<CellId>, Vec<CellId>),
    parts: Parts,
    held: &BTreeMap<CellId, Held>,
    wanted: &BTreeMap<CellId, Arc<Selected>>,
    judge: Judge,
    key: impl Fn(&CellId) -> f64,
    ledger: impl Fn(&CellId) -> f64,
) -> Update {
    let old: Vec<Shining> = subtract
        .iter()
        .flat_map(|c| judge.brightness.of(&held[c].selected))
        .collect();
    let new: Vec<Shining> = add
        .iter()
        .flat_map(|c| judge.brightness.of(&wanted[c]))
        .collect();
    let invalid: f64 = subtract.iter().map(ledger).sum();
    let sum = |lights: &[Shining]| lights.iter().map(|(l, _)| l.flux).sum::<Vec3>();
    let (flux_old, flux_new) = (sum(&old), sum(&new));
    let (gone, come) = (alone(&old, &new), alone(&new, &old));
    let moved = |lights: &[Shining]| -> f64 {
        let share = |l: &VirtualLight| if l.direct { 1.0 } else { RESHAPED };
        lights.iter().map(|(l, _)| share(l) * lumens(l.flux)).sum()
    };
    let wrong = lumens((flux_new - flux_old).abs()).max(moved(&gone).max(moved(&come)));
    let whole = lumens(flux_old).max(lumens(flux_new));
    let keys = |cells: &[CellId]| cells.iter().map(&key).sum::<f64>();
    // The same light in other cells.
    let balancing = !subtract.is_empty() && subtract != add && invalid == 0.0;
    let changing = || gone.iter().chain(&come).map(|(l, _)| *l);
    // What stays has to follow the scene.
    let stays = new
        .iter()
        .filter(|(l, _)| !come.iter().any(|(c, _)| c == l));
    let dimmed = |light: &VirtualLight, others: &[Shining]| -> bool {
        others.iter().any(|(other, _)| other.is_dimmed(light))
    };
    let comes = |l: &VirtualLight| match gone.iter().find(|(old, _)| old.sees_as(l)) {
        _ if dimmed(l, &gone) => Work::dim(l),
        Some(_) => Work::replace(l),
        None => Work::add(l),
    };
    let goes = gone.iter().filter(|(l, _)| !dimmed(l, &come));
    let work = (come.iter().map(|(l, _)| comes(l)))
        .chain(goes.map(|(l, _)| Work::subtract(l)))
        .chain(stays.map(|(l, _)| Work::follow(l, &[])));
    let gain = if balancing {
        (keys(&subtract) - keys(&add)).abs()
    } else {
        wrong
    };
    Update {
        kind: if balancing {
            Kind::Balancing
        } else {
            Kind::Validation
        },
        gain,
        parts,
        shown: difference(&gone, &come, judge.around),
        invalid: share_of(wrong.max(invalid), whole),
        work: work.sum(),
        lights: changing().count() as u64,
        what: What::Exchange { subtract, add },
    }
}

/// The update that brings a held cell to the current version; `regions` is where that differs from the cell's, `invalid`
/// what validation found wrong in it, lumens, `towards` what of it goes to those regions.
pub(in crate::bake) fn advance(
    cell: CellId,
    parts: Parts,
    held: &Held,
    regions: &[Region],
    invalid: f64,
    towards: Option<Towards>,
) -> Update {
    let lights = &held.selected.lights;
    // Lumens that are spread over what the regions show.
    let all: f64 = regions.iter().map(shown).sum();
    let spread = invalid / all.max(f64::MIN_POSITIVE).sqrt();
    let gain = invalid.max(towards.map_or(0.0, |t| t.met));
    Update {
        kind: Kind::Validation,
        what: What::Advance(cell),
        gain,
        parts,
        shown: towards.map_or([spread; 2], |t| {
            t.shown.map(|shown| shown.max(UNSURE * spread))
        }),
        invalid: share_of(gain, lights.iter().map(|l| lumens(l.flux)).sum()),
        work: lights.iter().map(|l| Work::follow(l, regions)).sum(),
        lights: lights.len() as u64,
    }
}

fn share_of(part: f64, whole: f64) -> f64 {
    if whole > 0.0 {
        (part / whole).min(1.0)
    } else {
        0.0
    }
}

/// Whether an update is about direct light alone.
pub(in crate::bake) fn all_direct(subtract: &[CellId], add: &[CellId]) -> bool {
    let mut cells = subtract.iter().chain(add);
    cells.all(|c| matches!(c, CellId::Aperture { .. }))
}

#[cfg(test)]
mod tests;

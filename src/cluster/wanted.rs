//! What should be held now: the fixed point's cells and their lights, made again only where something changed.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use rayon::prelude::*;

use super::border::{Border, Stray, crossing, strays};
use super::cell::{Cell, Place};
use super::similarity::Groups;
use super::{Budget, CellId, Clusters, Selected};

/// The cells that stand for all light, with their virtual lights: always what [`Clusters::select`] and
/// [`Clusters::virtual_lights`] make from nothing, but a cell's VPLs are grouped again only if one was added or removed, and
/// its lights are made again only if, besides, what crosses its border differs.
#[derive(Clone, Debug, Default)]
pub struct Wanted {
    cells: BTreeMap<CellId, Arc<Selected>>,
    /// Of the octree cells.
    entries: BTreeMap<Cell, Entry>,
    /// Of the parts of apertures, the version of their trees.
    apertures: BTreeMap<CellId, u64>,
    error: f64,
}

/// What a cell's lights are made from.
#[derive(Clone, Debug)]
struct Entry {
    /// Of the octree's node.
    version: u64,
    groups: Groups,
    strays: Vec<Stray>,
    border: Border,
}

impl Wanted {
    /// Nothing; for a budget and clusters, call [`Self::update`].
    pub fn new() -> Self {
        Self::default()
    }

    /// The cells in order.
    pub fn cells(&self) -> &BTreeMap<CellId, Arc<Selected>> {
        &self.cells
    }

    /// The largest key of a cell that has parts, as in [`super::Cut::error`].
    pub fn error(&self) -> f64 {
        self.error
    }

    /// Follows the clusters, which must be those of the last update, changed by [`Clusters::apply`]. Returns the cells that
    /// came, went or have other lights or VPLs than before, in order.
    pub fn update(&mut self, clusters: &Clusters, budget: Budget) -> BTreeSet<CellId> {
        let cut = clusters.select(budget);
        self.error = cut.error;
        let (octree, apertures): (Vec<CellId>, Vec<CellId>) = cut
            .cells
            .iter()
            .partition(|c| matches!(c, CellId::Octree(_)));
        let octree: Vec<Cell> = octree
            .into_iter()
            .filter_map(|c| match c {
                CellId::Octree(cell) => Some(cell),
                CellId::Aperture { .. } => None,
            })
            .collect();

        let mut selected = self.update_apertures(clusters, &apertures);
        let relit = self.update_borders(clusters, &octree);
        selected.par_extend(
            relit
                .par_iter()
                .filter_map(|cell| self.entries.get(cell))
                .map(|entry| clusters.indirect(&entry.groups, &entry.border)),
        );

        let mut changed = BTreeSet::new();
        self.cells.retain(|id, _| {
            let stays = cut.cells.binary_search(id).is_ok();
            if !stays {
                changed.insert(*id);
            }
            stays
        });
        for new in selected {
            if self.cells.get(&new.cell).is_none_or(|old| **old != new) {
                changed.insert(new.cell);
                self.cells.insert(new.cell, Arc::new(new));
            }
        }
        changed
    }

    /// The parts of apertures whose trees were made again, or that are new.
    fn update_apertures(&mut self, clusters: &Clusters, cells: &[CellId]) -> Vec<Selected> {
        let version = |id: &CellId| match id {
            CellId::Aperture { light, .. } => clusters.apertures.get(light).map_or(0, |a| a.0),
            CellId::Octree(_) => 0,
        };
        let before = std::mem::take(&mut self.apertures);
        self.apertures = cells.iter().map(|id| (*id, version(id))).collect();
        let stale: Vec<CellId> = cells
            .iter()
            .filter(|id| before.get(id) != Some(&version(id)))
            .copied()
            .collect();
        stale.par_iter().map(|&id| clusters.direct(id)).collect()
    }

    /// Groups the VPLs of cells that are new or changed, and exchanges them over these cells' borders. Returns the cells whose
    /// lights are to be made again.
    fn update_borders(&mut self, clusters: &Clusters, cut: &[Cell]) -> BTreeSet<Cell> {
        let mut relit: BTreeSet<Cell> = BTreeSet::new();
        let gone: Vec<Cell> = self
            .entries
            .keys()
            .filter(|c| cut.binary_search(c).is_err())
            .copied()
            .collect();
        for cell in gone {
            let Some(entry) = self.entries.remove(&cell) else {
                continue;
            };
            for other in entry.border.to.keys() {
                if let Some(other) = self.entries.get_mut(other) {
                    other.border.from.remove(&cell);
                }
                relit.insert(*other);
            }
            for other in entry.border.from.keys() {
                if let Some(other) = self.entries.get_mut(other) {
                    other.border.to.remove(&cell);
                }
                relit.insert(*other);
            }
        }
        let fresh: Vec<Entry> = cut
            .par_iter()
            .filter_map(|&cell| {
                let node = clusters.octree.node(&cell)?;
                let known = self.entries.get(&cell);
                if known.is_some_and(|e| e.version == node.version()) {
                    return None;
                }
                let groups = Groups::new(cell, node.vpls(), &clusters.settings);
                Some(Entry {
                    version: node.version(),
                    strays: strays(&groups),
                    groups,
                    border: Border::default(),
                })
            })
            .collect();
        let mut by_place: Vec<(Place, Cell)> = cut.iter().map(|c| (c.places().start, *c)).collect();
        by_place.par_sort_unstable();
        let mut pairs: Vec<(Cell, Cell)> = Vec::new();
        for mut entry in fresh {
            let cell = entry.groups.cell;
            relit.insert(cell);
            for beside in adjacent(&by_place, &cell) {
                pairs.extend([(cell, beside), (beside, cell)]);
            }
            if let Some(old) = self.entries.get_mut(&cell) {
                // Every pair of the cell is looked at again.
                entry.border = std::mem::take(&mut old.border);
            }
            self.entries.insert(cell, entry);
        }
        pairs.par_sort_unstable();
        pairs.dedup();
        let crossed: Vec<_> = pairs
            .par_iter()
            .filter_map(|(from, to)| {
                let (source, target) = (self.entries.get(from)?, self.entries.get(to)?);
                let moved = crossing(
                    &source.groups,
                    &source.strays,
                    &target.groups,
                    &clusters.settings,
                );
                let vpl = |i: u32| source.groups.vpls[i as usize];
                let left: Vec<u32> = moved.iter().map(|m| m.0).collect();
                let joined: Vec<_> = moved.iter().map(|&(i, plane)| (plane, vpl(i))).collect();
                Some((*from, *to, left, joined))
            })
            .collect();
        for (from, to, left, joined) in crossed {
            if let Some(source) = self.entries.get_mut(&from)
                && exchange(&mut source.border.to, to, left)
            {
                relit.insert(from);
            }
            if let Some(target) = self.entries.get_mut(&to)
                && exchange(&mut target.border.from, from, joined)
            {
                relit.insert(to);
            }
        }
        relit
    }
}

/// Puts a list in its place, an empty one out of it; whether that changed anything.
fn exchange<T: PartialEq>(map: &mut BTreeMap<Cell, Vec<T>>, cell: Cell, list: Vec<T>) -> bool {
    if list.is_empty() {
        return map.remove(&cell).is_some();
    }
    if map.get(&cell) == Some(&list) {
        return false;
    }
    map.insert(cell, list);
    true
}

/// The cells of a cut, sorted by their places, behind the faces of one of them: and, where these are smaller, others beside
/// them.
fn adjacent(by_place: &[(Place, Cell)], cell: &Cell) -> Vec<Cell> {
    let mut found = Vec::new();
    for face in 0..6 {
        let places = cell.across(face).places();
        let after = by_place.partition_point(|(start, _)| *start <= places.start);
        match by_place[..after].last() {
            Some((_, larger)) if larger.places().end >= places.end => found.push(*larger),
            _ => {
                let first = by_place.partition_point(|(start, _)| *start < places.start);
                let inside = by_place[first..].iter();
                found.extend(
                    inside
                        .take_while(|(start, _)| *start < places.end)
                        .map(|c| c.1),
                );
            }
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}

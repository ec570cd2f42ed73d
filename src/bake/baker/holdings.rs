//! What the map holds: in all of it the same, or, while what a camera sees follows an edit first, other lights there than in the rest.

use std::collections::{BTreeMap, BTreeSet};

use crate::bake::device::records::Parts;
use crate::bake::order::schedule::Held;
use crate::cluster::{CellId, Clusters, Ledger};
use crate::transport::Differences;

/// The lights of a part of the map.
#[derive(Clone, Debug)]
pub(in crate::bake) struct Holding {
    pub cells: BTreeMap<CellId, Held>,
    /// Flux of these that is known to be invalid.
    pub ledger: Ledger,
}

/// The lights of both parts.
#[derive(Debug)]
pub(in crate::bake) struct Holdings {
    seen: Holding,
    /// Where it differs from that of what is seen.
    rest: Option<Holding>,
    /// Cells that the two hold in different ways.
    apart: BTreeSet<CellId>,
}

impl Holdings {
    /// Nothing.
    pub fn new(clusters: &Clusters) -> Self {
        Self {
            seen: Holding {
                cells: BTreeMap::new(),
                ledger: Ledger::new(clusters),
            },
            rest: None,
            apart: BTreeSet::new(),
        }
    }

    /// The parts that hold lights of their own, with these.
    pub fn parts(&self) -> impl Iterator<Item = (Parts, &Holding)> {
        let seen = match self.rest {
            Some(_) => Parts::SEEN,
            None => Parts::ALL,
        };
        let rest = self.rest.iter().map(|rest| (Parts::REST, rest));
        std::iter::once((seen, &self.seen)).chain(rest)
    }

    /// What the part holds that is seen: where nothing differs, the whole map.
    pub fn seen(&self) -> &BTreeMap<CellId, Held> {
        &self.seen.cells
    }

    /// Whether both parts hold the same.
    pub fn are_one(&self) -> bool {
        self.rest.is_none()
    }

    /// Whether both parts hold a cell in the same way.
    pub fn is_one(&self, cell: &CellId) -> bool {
        !self.apart.contains(cell)
    }

    /// All that is held in any part.
    pub fn all(&self) -> impl Iterator<Item = &Held> {
        let cells = self.parts().map(|(_, holding)| &holding.cells);
        cells.flat_map(BTreeMap::values)
    }

    fn each(&mut self) -> impl Iterator<Item = (Parts, &mut Holding)> {
        let rest = self.rest.iter_mut().map(|rest| (Parts::REST, rest));
        std::iter::once((Parts::SEEN, &mut self.seen)).chain(rest)
    }

    /// Notes what validation found.
    pub fn note(&mut self, clusters: &Clusters, differences: &Differences) {
        for (_, holding) in self.each() {
            holding.ledger.note(clusters, &holding.cells, differences);
        }
    }

    /// What is known to be invalid is not known any more.
    pub fn forget_invalid(&mut self, clusters: &Clusters) {
        for (_, holding) in self.each() {
            holding.ledger = Ledger::new(clusters);
        }
    }

    /// Changes some cells in some parts of the map, by `change`, which is asked once for all of these if they hold the cells in
    /// the same way; the cells are valid there afterwards. Returns what it returned.
    pub fn change<T>(
        &mut self,
        parts: Parts,
        cells: &[CellId],
        mut change: impl FnMut(&mut BTreeMap<CellId, Held>) -> T,
    ) -> Vec<(Parts, T)> {
        let together = parts == Parts::ALL && cells.iter().all(|cell| self.is_one(cell));
        if !together && self.rest.is_none() {
            self.rest = Some(self.seen.clone());
        }
        let mut done = Vec::new();
        if together {
            done.push((parts, change(&mut self.seen.cells)));
            if let Some(rest) = &mut self.rest {
                for cell in cells {
                    rest.cells.remove(cell);
                    let held = self.seen.cells.get(cell).cloned();
                    rest.cells.extend(held.map(|held| (*cell, held)));
                }
            }
        }
        for (part, holding) in self.each().filter(|(part, _)| parts.hold(*part)) {
            if !together {
                done.push((part, change(&mut holding.cells)));
            }
            for cell in cells {
                holding.ledger.take(cell);
            }
        }
        let Some(rest) = &self.rest else {
            return done;
        };
        for cell in cells {
            let same = match [&self.seen, rest].map(|part| part.cells.get(cell)) {
                [Some(a), Some(b)] => a.is_same(b),
                [a, b] => a.is_none() && b.is_none(),
            };
            if same {
                self.apart.remove(cell);
            } else {
                self.apart.insert(*cell);
            }
        }
        if self.apart.is_empty() {
            self.rest = None;
        }
        done
    }
}

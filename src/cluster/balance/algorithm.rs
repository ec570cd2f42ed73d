//! Algorithm 1 as IBGI writes it, one operation at a time from any state: the oracle of [`super::select`].

use std::cmp::Reverse;
use std::collections::BTreeSet;

use super::{Budget, Forest, Priority, meets, priority, relative};

/// An operation on the selected cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step<Id> {
    /// The cell is replaced by its parts.
    Refine(Id),
    /// The cell replaces its parts.
    Merge(Id),
}

/// Keeps a cut and brings it to the fixed point step by step, also after the forest has changed.
#[derive(Clone, Debug)]
pub struct Balancer<Id: Ord> {
    /// Cells that are replaced by their parts, and so are all cells above them. The cut follows from it.
    refined: BTreeSet<Id>,
    selected: BTreeSet<Id>,
    refinable: BTreeSet<Priority<Id>>,
    mergeable: BTreeSet<Priority<Id>>,
}

impl<Id: Copy + Ord + std::fmt::Debug> Balancer<Id> {
    /// Starts with the roots selected.
    pub fn new<F: Forest<Id = Id>>(forest: &F) -> Self {
        let mut balancer = Self {
            refined: BTreeSet::new(),
            selected: BTreeSet::new(),
            refinable: BTreeSet::new(),
            mergeable: BTreeSet::new(),
        };
        balancer.update(forest);
        balancer
    }

    /// Takes in a changed forest: what was refined stays so where it still has parts; new cells are selected where
    /// they appear below refined ones, and cells that are gone are dropped.
    pub fn update<F: Forest<Id = Id>>(&mut self, forest: &F) {
        let before = std::mem::take(&mut self.refined);
        self.selected.clear();
        self.refinable.clear();
        self.mergeable.clear();
        let mut open = forest.roots();
        while let Some(id) = open.pop() {
            let children = forest.children(&id);
            if !children.is_empty() && before.contains(&id) {
                self.refined.insert(id);
                open.extend(children);
            } else {
                self.put(forest, id, !children.is_empty());
            }
        }
        let mergeable = self.refined.iter().filter(|id| self.can_merge(forest, id));
        self.mergeable = mergeable.map(|&id| priority(forest, id)).collect();
    }

    /// The selected cells, in order.
    pub fn cells(&self) -> impl Iterator<Item = &Id> {
        self.selected.iter()
    }

    /// The largest key of a cell that has parts, relative to [`Forest::scale`].
    pub fn error<F: Forest<Id = Id>>(&self, forest: &F) -> f64 {
        relative(forest, self.refinable.last().map(|p| p.0))
    }

    /// Does the next operation of Algorithm 1; none once balanced. The forest must be the one of the last update.
    pub fn step<F: Forest<Id = Id>>(&mut self, forest: &F, budget: Budget) -> Option<Step<Id>> {
        let largest = self.refinable.last().copied();
        let key = largest.map(|l| l.0);
        if !meets(forest, &budget, self.selected.len(), key) {
            let (_, _, Reverse(id)) = largest?;
            self.refine(forest, id);
            return Some(Step::Refine(id));
        }
        let smallest = *self.mergeable.first()?;
        let (_, _, Reverse(id)) = smallest;
        let merged = self.selected.len() + 1 - forest.children(&id).len();
        // Merge what was never needed, and what is worth less than the cell that could be refined instead.
        if meets(forest, &budget, merged, key.max(Some(smallest.0)))
            || largest.is_some_and(|l| smallest < l)
        {
            self.merge(forest, id);
            return Some(Step::Merge(id));
        }
        None
    }

    fn put<F: Forest<Id = Id>>(&mut self, forest: &F, id: Id, refinable: bool) {
        self.selected.insert(id);
        if refinable {
            self.refinable.insert(priority(forest, id));
        }
    }

    fn take<F: Forest<Id = Id>>(&mut self, forest: &F, id: &Id) {
        self.selected.remove(id);
        self.refinable.remove(&priority(forest, *id));
    }

    fn can_merge<F: Forest<Id = Id>>(&self, forest: &F, id: &Id) -> bool {
        forest
            .children(id)
            .iter()
            .all(|c| self.selected.contains(c))
    }

    fn refine<F: Forest<Id = Id>>(&mut self, forest: &F, id: Id) {
        self.take(forest, &id);
        self.refined.insert(id);
        for child in forest.children(&id) {
            let refinable = !forest.children(&child).is_empty();
            self.put(forest, child, refinable);
        }
        self.mergeable.insert(priority(forest, id));
        if let Some(parent) = forest.parent(&id) {
            self.mergeable.remove(&priority(forest, parent));
        }
    }

    fn merge<F: Forest<Id = Id>>(&mut self, forest: &F, id: Id) {
        for child in forest.children(&id) {
            self.take(forest, &child);
        }
        self.refined.remove(&id);
        self.put(forest, id, true);
        self.mergeable.remove(&priority(forest, id));
        if let Some(parent) = forest.parent(&id).filter(|p| self.can_merge(forest, p)) {
            self.mergeable.insert(priority(forest, parent));
        }
    }
}

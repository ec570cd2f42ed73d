//! Which cells stand for the light (IBGI sections 4.3 and 5, Algorithm 1): refine the largest, merge the smallest.
//!
//! Keys fall down the tree, and ties fall to the cell of the higher level, then of the smaller name. So the nodes have one
//! order in which a parent always comes before its parts, and the fixed point of Algorithm 1 is the shortest prefix of that order
//! that meets the budget when refined: [`select`] goes there at once, which costs less than a step of the algorithm: what the map holds
//! then goes there refinement by refinement and merger by merger, in whatever order the schedule likes.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Trees of cells with keys.
pub trait Forest {
    /// Names a cell.
    type Id: Copy + Ord + std::fmt::Debug;
    /// The cells without parents.
    fn roots(&self) -> Vec<Self::Id>;
    /// The parts of a cell; none if it is a leaf or does not exist.
    fn children(&self, id: &Self::Id) -> Vec<Self::Id>;
    /// The cell that this one is a part of.
    fn parent(&self, id: &Self::Id) -> Option<Self::Id>;
    /// The balancing metric of a cell; at most that of its parent.
    fn key(&self, id: &Self::Id) -> u64;
    /// Number of cells above.
    fn depth(&self, id: &Self::Id) -> u32;
    /// What keys are relative to in [`Budget::Auto`]: the sum of all keys if cells had no end.
    fn scale(&self) -> f64;
}

/// How far to refine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// At least this many cells, where there are as many: Algorithm 1's N. The last refinement may go up to 7 beyond.
    Cells(usize),
    /// Until no cell that has parts has a key above this share of what all light lights up again ([`Forest::scale`]): the same
    /// threshold asks for few cells in a small scene and for many in a large one, and what it asks of a cell depends on no other.
    Auto {
        /// Relative, above 0.
        error: f64,
    },
}

/// The selected cells: no cell is part of another, and together they hold all light.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut<Id> {
    /// In order.
    pub cells: Vec<Id>,
    /// The largest key of a cell that has parts, relative to [`Forest::scale`]: what [`Budget::Auto`] bounds.
    pub error: f64,
}

type Priority<Id> = (u64, Reverse<u32>, Reverse<Id>);

/// With its parts.
type Refinable<Id> = (Priority<Id>, Vec<Id>);

fn priority<F: Forest>(forest: &F, id: F::Id) -> Priority<F::Id> {
    (forest.key(&id), Reverse(forest.depth(&id)), Reverse(id))
}

/// A largest key relative to all light; 0 without any.
fn relative<F: Forest>(forest: &F, largest: Option<u64>) -> f64 {
    largest.map_or(0.0, |key| {
        key as f64 / forest.scale().max(f64::MIN_POSITIVE)
    })
}

/// Whether a cut of `cells` cells is fine enough, whose largest key among those that can be refined is given.
fn meets<F: Forest>(forest: &F, budget: &Budget, cells: usize, largest: Option<u64>) -> bool {
    match *budget {
        Budget::Cells(n) => cells >= n,
        Budget::Auto { error } => relative(forest, largest) <= error,
    }
}

/// The fixed point of Algorithm 1, from the roots.
pub fn select<F: Forest>(forest: &F, budget: Budget) -> Cut<F::Id> {
    let mut heap: BinaryHeap<Refinable<F::Id>> = BinaryHeap::new();
    let mut leaves = Vec::new();
    let mut open = forest.roots();
    loop {
        for id in open.drain(..) {
            let children = forest.children(&id);
            if children.is_empty() {
                leaves.push(id);
            } else {
                heap.push((priority(forest, id), children));
            }
        }
        let largest = heap.peek().map(|((key, ..), _)| *key);
        if meets(forest, &budget, leaves.len() + heap.len(), largest) {
            break;
        }
        let Some((_, children)) = heap.pop() else {
            break;
        };
        open = children;
    }
    let error = relative(forest, heap.peek().map(|((key, ..), _)| *key));
    let mut cells = leaves;
    cells.extend(heap.into_iter().map(|((_, _, Reverse(id)), _)| id));
    cells.sort_unstable();
    Cut { cells, error }
}

#[cfg(test)]
mod algorithm;

#[cfg(test)]
mod tests {
    use super::algorithm::Balancer;
    use super::*;
    use proptest::prelude::*;
    use std::collections::{BTreeMap, BTreeSet};

    /// Nodes by name; a name's digits to base 9 (1 to 8) are the way from the root.
    #[derive(Clone, Debug, Default)]
    struct Trees(BTreeMap<u64, u64>);

    impl Trees {
        /// Every entry is a leaf's name and key; inner keys are the sums of their parts', ties included.
        fn new(leaves: &[(Vec<u8>, u64)]) -> Self {
            let mut trees = Self::default();
            for (way, key) in leaves {
                let mut name = 0;
                for &step in way {
                    name = name * 9 + 1 + u64::from(step % 8);
                    *trees.0.entry(name).or_default() += key;
                }
            }
            trees
        }
    }

    impl Forest for Trees {
        type Id = u64;
        fn roots(&self) -> Vec<u64> {
            (1..9).filter(|n| self.0.contains_key(n)).collect()
        }
        fn children(&self, id: &u64) -> Vec<u64> {
            (1..9)
                .map(|d| id * 9 + d)
                .filter(|n| self.0.contains_key(n))
                .collect()
        }
        fn parent(&self, id: &u64) -> Option<u64> {
            (*id > 8).then_some((id - 1) / 9)
        }
        fn key(&self, id: &u64) -> u64 {
            self.0.get(id).copied().unwrap_or(0)
        }
        fn depth(&self, id: &u64) -> u32 {
            self.parent(id).map_or(0, |p| 1 + self.depth(&p))
        }
        fn scale(&self) -> f64 {
            1000.0
        }
    }

    fn trees() -> impl Strategy<Value = Trees> {
        let leaf = (prop::collection::vec(0u8..8, 1..6), 0u64..20);
        prop::collection::vec(leaf, 1..60).prop_map(|l| Trees::new(&l))
    }

    fn budget() -> impl Strategy<Value = Budget> {
        prop_oneof![
            (0usize..80).prop_map(Budget::Cells),
            (0.0f64..0.1).prop_map(|error| Budget::Auto { error })
        ]
    }

    fn run(balancer: &mut Balancer<u64>, trees: &Trees, budget: Budget) {
        for _ in 0..2000 {
            if balancer.step(trees, budget).is_none() {
                return;
            }
        }
        panic!("no fixed point");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]
        #[test]
        fn every_way_ends_at_the_same_cut(a in trees(), b in trees(), first in budget(), second in budget()) {
            // Balanced for one forest and budget, then brought to another.
            let mut balancer = Balancer::new(&a);
            run(&mut balancer, &a, first);
            let direct = select(&a, first);
            prop_assert_eq!(balancer.cells().copied().collect::<Vec<_>>(), direct.cells);
            prop_assert_eq!(balancer.error(&a), direct.error);
            balancer.update(&b);
            run(&mut balancer, &b, second);
            prop_assert_eq!(balancer.cells().copied().collect::<Vec<_>>(), select(&b, second).cells);
        }

        #[test]
        fn a_cut_covers_every_leaf_once_and_is_a_threshold(trees in trees(), budget in budget()) {
            let cut = select(&trees, budget);
            let above = |id: &u64| std::iter::successors(Some(*id), |i| trees.parent(i));
            for leaf in trees.0.keys().filter(|id| trees.children(id).is_empty()) {
                prop_assert_eq!(above(leaf).filter(|a| cut.cells.contains(a)).count(), 1);
            }
            let refinable = cut.cells.iter().filter(|c| !trees.children(c).is_empty());
            let largest = refinable.map(|&c| priority(&trees, c)).max();
            let refined: BTreeSet<u64> = cut.cells.iter().flat_map(|c| above(c).skip(1)).collect();
            let smallest = refined.iter().map(|&c| priority(&trees, c)).min();
            prop_assert!(largest.is_none() || smallest.is_none() || largest < smallest);
            match budget {
                Budget::Cells(n) => prop_assert!(largest.is_none() || (cut.cells.len() >= n && cut.cells.len() < n.max(9) + 8)),
                Budget::Auto { error } => prop_assert!(largest.is_none() || cut.error <= error),
            }
        }
    }
}

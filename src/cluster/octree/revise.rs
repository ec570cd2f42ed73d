//! VPLs that stay where they are, and carry or reach something else: all of them in one descent.

use rayon::prelude::*;

use super::{Content, Node, Shared};
use crate::cluster::cell::octant;
use crate::cluster::sums::terms;
use crate::transport::Vpl;

/// VPLs before and after they were revised.
pub(super) struct Revision<'a> {
    pub(super) pairs: &'a [[Vpl; 2]],
    pub(super) shared: Shared,
}

/// Where one of them is to be found.
pub(super) struct Sought {
    pub(super) grid: [i64; 3],
    pub(super) pair: usize,
}

/// What became of those below a node.
#[derive(Default)]
pub(super) struct Revised {
    pub(super) found: usize,
    /// Units of [`crate::cluster::FluxScale`] that came.
    flux: [i64; 3],
    /// The flux of one is another.
    relit: bool,
    /// Those whose scatter is another.
    scattered: Vec<usize>,
}

impl Revised {
    fn take(&mut self, pair: usize, by: &Revision) {
        let [old, new] = &by.pairs[pair];
        let units = [old, new].map(|v| by.shared.scale.units(v.flux));
        (0..3).for_each(|c| self.flux[c] += units[1][c] - units[0][c]);
        self.found += 1;
        self.relit |= old.flux != new.flux;
        if old.scatter != new.scatter {
            self.scattered.push(pair);
        }
    }

    fn join(&mut self, mut other: Self) {
        (0..3).for_each(|c| self.flux[c] += other.flux[c]);
        self.found += other.found;
        self.relit |= other.relit;
        self.scattered.append(&mut other.scattered);
    }
}

impl Node {
    /// Descends once for all of them; what is not here changes nothing.
    pub(super) fn revise(&mut self, sought: Vec<Sought>, by: &Revision, level: u8) -> Revised {
        let mut done = Revised::default();
        match &mut self.content {
            Content::Leaf(vpls) => {
                for one in sought {
                    let [old, new] = &by.pairs[one.pair];
                    let at = vpls.binary_search_by_key(&old.key, |v| v.key);
                    let found = at.ok().map(|at| &mut vpls[at]);
                    if let Some(vpl) = found.filter(|v| **v == *old) {
                        *vpl = *new;
                        done.take(one.pair, by);
                    }
                }
            }
            Content::Inner(parts) => {
                let parallel = sought.len() > 4096;
                let mut each: [Vec<Sought>; 8] = Default::default();
                for one in sought {
                    each[octant(one.grid, level + 1)].push(one);
                }
                let follow = |(part, sought): (&mut Option<Node>, Vec<Sought>)| {
                    let part = part.as_mut().filter(|_| !sought.is_empty());
                    part.map(|part| part.revise(sought, by, level + 1))
                };
                let all: Vec<Option<Revised>> = if parallel {
                    parts.par_iter_mut().zip(each).map(follow).collect()
                } else {
                    parts.iter_mut().zip(each).map(follow).collect()
                };
                all.into_iter().flatten().for_each(|part| done.join(part));
            }
        }
        (0..3).for_each(|c| self.sums.flux[c] += done.flux[c]);
        for [old, new] in done.scattered.iter().map(|&pair| &by.pairs[pair]) {
            // Its flux is told of already.
            let old = Vpl {
                flux: new.flux,
                ..*old
            };
            self.sums.remove(&terms(&old, &by.shared.scale, level));
            self.sums.add(&terms(new, &by.shared.scale, level));
        }
        if done.relit {
            self.version = by.shared.version;
        }
        done
    }
}

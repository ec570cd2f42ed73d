//! Updates of the two parts of the map: what a camera sees goes first where that shows more, and what is the same in both is done once.

use std::collections::BTreeSet;

use super::schedule::{Update, What};
use crate::bake::device::records::Parts;
use crate::cluster::CellId;

/// Joins updates of either part of the map that are the same in both, cells being held there in the same way (`is_one`).
pub(in crate::bake) fn join(updates: Vec<Update>, is_one: impl Fn(&CellId) -> bool) -> Vec<Update> {
    let of = |parts| updates.iter().filter(move |u: &&Update| u.parts == parts);
    let rest: BTreeSet<&What> = of(Parts::REST).map(|u| &u.what).collect();
    let joined = of(Parts::SEEN)
        .map(|u| &u.what)
        .filter(|w| rest.contains(w));
    let joined = joined.filter(|what| what.cells().iter().all(&is_one));
    let joined: BTreeSet<What> = joined.cloned().collect();
    let once = |mut update: Update| {
        if joined.contains(&update.what) {
            if update.parts == Parts::REST {
                return None;
            }
            update.parts = Parts::ALL;
        }
        Some(update)
    };
    updates.into_iter().filter_map(once).collect()
}

/// What updates leave of the norm of all that is seen wrong, that they need not be done where it is seen first.
const HARDLY_SEEN: f64 = 0.01;

/// Does first what is seen of updates of the whole map: in two steps, where the first shows more for its work. What hardly
/// shows is done in one, which takes less in all, and so is direct light, which comes first anyhow.
pub(in crate::bake) fn seen_first(updates: Vec<Update>) -> Vec<Update> {
    let seen = |update: &Update| update.shown[0].powi(2);
    let left = HARDLY_SEEN.powi(2) * updates.iter().map(seen).sum::<f64>();
    let mut order: Vec<(f64, f64, usize)> = (0..)
        .zip(&updates)
        .filter(|(_, update)| update.parts == Parts::ALL && !update.is_direct())
        .map(|(i, update)| (update.within(Parts::SEEN).worth(), seen(update), i))
        .collect();
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(b.2.cmp(&a.2)));
    let mut sum = 0.0;
    let mut whole = vec![true; updates.len()];
    for (worth, seen, i) in order {
        sum += seen;
        whole[i] = sum <= left || worth <= updates[i].worth();
    }
    let steps = |(update, whole): (Update, bool)| {
        if whole {
            vec![update]
        } else {
            vec![update.within(Parts::SEEN), update.within(Parts::REST)]
        }
    };
    updates.into_iter().zip(whole).flat_map(steps).collect()
}

//! Updates in the order in which they are done: the most visible for their work first, balancing within its share of the work
//! (IBGI eq. 2).

use super::schedule::{Kind, Update, What};
use crate::cluster::CellId;

/// Everything that has to be done, in the order in which to do it, balancing apart from validation.
#[derive(Clone, Debug, Default)]
pub(in crate::bake) struct Plan {
    /// Of direct light, which needs no path to be known, and of all other.
    validation: [Queue; 2],
    balancing: Queue,
    /// Work that balancing may do by now (eq. 2): it waits until that is as much as its next update takes.
    owed: f64,
}

/// Updates in order, the next one at the end.
#[derive(Clone, Debug, Default)]
struct Queue {
    updates: Vec<Update>,
    /// What is known of the updates up to each: of what is left it is asked for after every update.
    left: Vec<Left>,
}

/// Of some updates.
#[derive(Clone, Copy, Debug, Default)]
struct Left {
    /// Lumens that are wrong.
    wrong: f64,
    /// The most of these in one update, and what share that is of its cells' flux.
    most: f64,
    invalid: f64,
}

impl Queue {
    /// Ties fall to the order given.
    fn new(mut updates: Vec<Update>) -> Self {
        updates.reverse();
        updates.sort_by(|a, b| a.worth().total_cmp(&b.worth()));
        let with = |left: &mut Left, update: &Update| {
            left.wrong += update.gain;
            if update.gain >= left.most {
                (left.most, left.invalid) = (update.gain, update.invalid);
            }
            Some(*left)
        };
        let left = updates.iter().scan(Left::default(), with).collect();
        Self { updates, left }
    }

    fn pop(&mut self) -> Option<Update> {
        self.left.pop();
        self.updates.pop()
    }

    fn next(&self) -> Option<&Update> {
        self.updates.last()
    }

    fn left(&self) -> Left {
        self.left.last().copied().unwrap_or_default()
    }
}

impl Plan {
    /// Puts updates in order; ties fall to direct light, then to the order given.
    pub(in crate::bake) fn new(updates: Vec<Update>, owed: f64) -> Self {
        let (validation, balancing): (Vec<_>, Vec<_>) = updates
            .into_iter()
            .partition(|u| u.kind == Kind::Validation);
        let (direct, other): (Vec<_>, Vec<_>) = validation.into_iter().partition(Update::is_direct);
        Self {
            validation: [direct, other].map(Queue::new),
            balancing: Queue::new(balancing),
            owed,
        }
    }

    /// Which of validation's queues has the next update.
    fn first(&self) -> usize {
        let [direct, other] = &self.validation;
        match (direct.next(), other.next()) {
            (Some(a), Some(b)) => usize::from(a.worth() < b.worth()),
            (direct, _) => usize::from(direct.is_none()),
        }
    }

    /// The next update. How much of the work balancing may have by now, the ratio rule (eq. 2) says: from nothing, where much
    /// is invalid, to half. Within that it goes by what shows, as validation does; IBGI, which cannot compare the two, takes strict
    /// turns. `t`: the share of invalid flux at which both may have as much.
    pub(in crate::bake) fn next(&mut self, t: f64) -> Option<Update> {
        let first = self.first();
        let (Some(next), Some(other)) = (self.validation[first].next(), self.balancing.next())
        else {
            return self.validation[first]
                .pop()
                .or_else(|| self.balancing.pop());
        };
        // Of the update with the most invalid flux: where that is the order, too, it is the next one (IBGI section 4.4).
        let [a, b] = self.validation.each_ref().map(Queue::left);
        let most = if a.most < b.most { b } else { a };
        // Shares of the work, not of the number of updates: those of balancing are the larger ones by far.
        let ratio = ratio(most.invalid, t);
        if self.owed < ratio * other.work() || other.worth() < next.worth() {
            self.owed += (1.0 - ratio) * next.work();
            self.validation[first].pop()
        } else {
            self.owed -= ratio * other.work();
            self.balancing.pop()
        }
    }

    /// The next update of direct light, which needs no path to be known.
    pub(in crate::bake) fn next_direct(&mut self) -> Option<Update> {
        self.validation[0].pop()
    }

    fn queues(&self) -> impl Iterator<Item = &Queue> {
        self.validation.iter().chain([&self.balancing])
    }

    pub(in crate::bake) fn owed(&self) -> f64 {
        self.owed
    }

    pub(in crate::bake) fn len(&self) -> usize {
        self.queues().map(|queue| queue.updates.len()).sum()
    }

    /// Lights to send to the device.
    pub(in crate::bake) fn lights(&self) -> u64 {
        let updates = self.queues().flat_map(|queue| &queue.updates);
        updates.map(|u| u.lights).sum()
    }

    /// Lumens that are wrong, estimated.
    pub(in crate::bake) fn invalid_flux(&self) -> f64 {
        self.validation.iter().map(|q| q.left().wrong).sum()
    }

    /// The same by cell; cells that are exchanged together share it.
    pub(in crate::bake) fn invalid_cells(&self) -> impl Iterator<Item = (CellId, f64)> {
        let updates = self.validation.iter().flat_map(|queue| &queue.updates);
        updates.flat_map(|update| {
            let cells = match &update.what {
                What::Advance(cell) => vec![*cell],
                What::Exchange { subtract, add } if add.is_empty() => subtract.clone(),
                What::Exchange { add, .. } => add.clone(),
            };
            let share = update.gain / cells.len().max(1) as f64;
            cells.into_iter().map(move |cell| (cell, share))
        })
    }
}

/// The share of updates that validation gets (eq. 2).
fn ratio(invalid: f64, t: f64) -> f64 {
    invalid
        .clamp(0.0, 1.0)
        .powf(0.5f64.ln() / t.clamp(1e-6, 0.999).ln())
        .max(0.5)
}

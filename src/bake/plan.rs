//! Updates in the order in which they are done: the most visible for their work first, validation and balancing in turns (IBGI
//! eq. 2).

use super::schedule::{Kind, Update, What, all_direct};
use crate::cluster::CellId;

/// Everything that has to be done, in the order in which to do it, balancing apart from validation.
#[derive(Clone, Debug, Default)]
pub(super) struct Plan {
    /// Of direct light, which needs no path to be known, and of all other.
    validation: [Queue; 2],
    balancing: Queue,
    /// Work that validation may do before it is balancing's turn (eq. 2).
    owed: f64,
}

/// Updates in order, the next one at the end.
#[derive(Clone, Debug, Default)]
struct Queue {
    updates: Vec<Update>,
    /// Lumens that are wrong in the updates up to each: what is left is asked for after every update.
    wrong: Vec<f64>,
}

impl Queue {
    /// Ties fall to the order given.
    fn new(mut updates: Vec<Update>) -> Self {
        updates.reverse();
        updates.sort_by(|a, b| a.worth().total_cmp(&b.worth()));
        let sum = |sum: &mut f64, update: &Update| {
            *sum += update.gain;
            Some(*sum)
        };
        let wrong = updates.iter().scan(0.0, sum).collect();
        Self { updates, wrong }
    }

    fn pop(&mut self) -> Option<Update> {
        self.wrong.pop();
        self.updates.pop()
    }

    fn next(&self) -> Option<&Update> {
        self.updates.last()
    }
}

impl Plan {
    /// Puts updates in order; ties fall to direct light, then to the order given.
    pub(super) fn new(updates: Vec<Update>, owed: f64) -> Self {
        let (validation, balancing): (Vec<_>, Vec<_>) = updates
            .into_iter()
            .partition(|u| u.kind == Kind::Validation);
        let (direct, other): (Vec<_>, Vec<_>) =
            validation.into_iter().partition(|u| match &u.what {
                What::Advance(cell) => matches!(cell, CellId::Aperture { .. }),
                What::Exchange { subtract, add } => all_direct(subtract, add),
            });
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

    /// The next update by the ratio rule (eq. 2): from validation alone, where much is invalid, to turns. `t`: the share of
    /// invalid flux at which both take turns.
    pub(super) fn next(&mut self, t: f64) -> Option<Update> {
        let validation = &mut self.validation[self.first()];
        let (Some(next), Some(_)) = (validation.next(), self.balancing.next()) else {
            return validation.pop().or_else(|| self.balancing.pop());
        };
        // Shares of the work, not of the number of updates: those of balancing are the larger ones by far.
        let ratio = ratio(next.invalid, t);
        if self.owed >= 0.0 {
            self.owed -= (1.0 - ratio) * next.cost;
            validation.pop()
        } else {
            let update = self.balancing.pop()?;
            self.owed += ratio * update.cost;
            Some(update)
        }
    }

    /// The next update of direct light, which needs no path to be known.
    pub(super) fn next_direct(&mut self) -> Option<Update> {
        self.validation[0].pop()
    }

    fn queues(&self) -> impl Iterator<Item = &Queue> {
        self.validation.iter().chain([&self.balancing])
    }

    pub(super) fn owed(&self) -> f64 {
        self.owed
    }

    pub(super) fn len(&self) -> usize {
        self.queues().map(|queue| queue.updates.len()).sum()
    }

    /// Lights to send to the device.
    pub(super) fn lights(&self) -> u64 {
        let updates = self.queues().flat_map(|queue| &queue.updates);
        updates.map(|u| u.lights).sum()
    }

    /// Lumens that are wrong, estimated.
    pub(super) fn invalid_flux(&self) -> f64 {
        let left = self.validation.iter().filter_map(|q| q.wrong.last());
        left.sum()
    }

    /// The same by cell; cells that are exchanged together share it.
    pub(super) fn invalid_cells(&self) -> impl Iterator<Item = (CellId, f64)> {
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

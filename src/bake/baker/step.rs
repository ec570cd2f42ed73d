//! The work on the map: what validation finds is planned, what is planned is done, and time is looked at in between.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use tracing::debug_span;

use super::journal::Entry;
use crate::bake::baker::Baker;
use crate::bake::order::schedule::{self, Held, What};
use crate::cluster::CellId;
use crate::gpu::GpuError;

/// Paths traced again at a time, between two looks at the clock.
const PATHS_AT_ONCE: usize = 4096;
/// The share of a step's time that tracing may take before the map is updated with what is known.
const TRACING_SHARE: f64 = 0.3;
/// What direct lights after the first take on the device, about, that are sent after an edit before its paths are traced: as
/// long as the host is busy with these.
const AHEAD: Duration = Duration::from_millis(100);

/// How far [`Baker::step`] goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// Until nothing is left to do.
    Converged,
    /// For about so long; at least one update, if there is one. Updates are sent whole and many at once, because that is fastest:
    /// where the device takes longer for them than this, so do steps. [`Limit::Slice`] is for those who draw frames meanwhile.
    Time(Duration),
    /// For so many updates.
    Updates(u64),
    /// For about so long on the host, and with no more than takes about so long on the device: the rest of an update that was
    /// begun waits for the next step, and [`Baker::is_whole`] says so. At least one light, if there is one.
    Slice {
        /// So long.
        time: Duration,
        /// Only finishes what was begun, because somebody waits to see the map.
        whole: bool,
    },
}

/// Where a baker stands.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Progress {
    /// Updates done by this step.
    pub updates: u64,
    /// Updates known to be left; more can come while paths are being validated.
    pub left: u64,
    /// Paths that wait to be validated.
    pub invalid_paths: u64,
    /// Lumens (mean over RGB) that are known or estimated to be wrong in the map.
    pub invalid_flux: f64,
    /// Nothing is left to do.
    pub converged: bool,
}

impl Baker {
    /// Whether the map is that of a fresh bake.
    pub fn is_converged(&self) -> bool {
        self.is_planned_out() && !self.illumination.is_behind()
    }

    /// Whether every update has been sent to the device wholly or not at all: only a [`Limit::Slice`] leaves it otherwise.
    pub fn is_whole(&self) -> bool {
        self.illumination.is_whole()
    }

    /// What the last [`Limit::Slice`] left of the device's time.
    pub fn slice_left(&self) -> Duration {
        self.illumination.left()
    }

    /// Whether no update is left to be begun.
    fn is_planned_out(&self) -> bool {
        self.settled && self.validator.is_valid() && self.plan.len() == 0
    }

    /// Works on the map.
    ///
    /// # Errors
    /// No memory, a lost device.
    pub fn step(&mut self, limit: Limit) -> Result<Progress, GpuError> {
        self.step_with(limit, &mut |_, _| {})
    }

    /// As [`Baker::step`]; `told` hears how many lights have been sent of how many.
    pub(crate) fn step_with(
        &mut self,
        limit: Limit,
        told: &mut dyn FnMut(u64, u64),
    ) -> Result<Progress, GpuError> {
        let start = Instant::now();
        let enough = |updates: u64| match limit {
            Limit::Converged => false,
            Limit::Time(time) => start.elapsed() >= time,
            Limit::Updates(n) => updates >= n,
            Limit::Slice { time, .. } => start.elapsed() >= time,
        };
        let _span = debug_span!("step").entered();
        let slice = match limit {
            Limit::Slice { time, whole } => Some((time, whole)),
            _ => None,
        };
        self.illumination
            .allow(slice.map(|s| s.0), slice.is_some_and(|s| s.1));
        if slice.is_some() {
            self.illumination.poll()?;
        }
        let before = self.illumination.lights_sent();
        let mut updates = 0;
        loop {
            // In a slice, only when all that was begun has been sent: what comes next is to wait no longer than that.
            let waits = |baker: &Self| slice.is_some() && baker.illumination.is_behind();
            let begun_only = slice.is_some_and(|s| s.1) || waits(self);
            if begun_only && (self.edited || enough(updates)) {
                break;
            }
            // After an edit, first what needs no path to be known: the device has work then while the host traces.
            let direct = std::mem::take(&mut self.edited);
            if direct {
                self.trace(0);
                self.plan_wanted(false)?;
            } else {
                let tracing = match limit {
                    Limit::Time(time) | Limit::Slice { time, .. } => {
                        Some(start + time.mul_f64(TRACING_SHARE))
                    }
                    _ => None,
                };
                self.settle(tracing)?;
            }
            if begun_only || limit == Limit::Updates(updates) {
                break;
            }
            let total = self.plan.lights();
            let mut first = true;
            while let Some(update) = self.next(direct) {
                self.perform(&update)?;
                updates += 1;
                self.illumination.poll()?;
                self.journal.reach(self.illumination.taken_and_done().1);
                let sent = self.illumination.lights_sent() - before;
                told(sent, sent + total);
                if enough(updates) || waits(self) {
                    self.illumination.send()?;
                    return Ok(self.standing(updates));
                }
                // What is seen first is not to wait for its batch to fill.
                if direct && first {
                    self.illumination.send()?;
                    first = false;
                }
                if direct && self.illumination.expected() >= AHEAD {
                    break;
                }
            }
            if direct {
                self.illumination.send()?;
                continue;
            }
            self.forget()?;
            if self.is_planned_out() && !waits(self) {
                self.illumination.flush()?;
                self.journal.reach(self.illumination.taken_and_done().1);
                self.holdings.forget_invalid(&self.clusters);
                self.brightness.forget();
                return Ok(self.standing(updates));
            }
            if enough(updates) {
                break;
            }
        }
        self.illumination.send()?;
        Ok(self.standing(updates))
    }

    fn next(&mut self, direct: bool) -> Option<schedule::Update> {
        if direct {
            self.plan.next_direct()
        } else {
            self.plan.next(self.turns_at)
        }
    }

    fn standing(&self, updates: u64) -> Progress {
        Progress {
            updates,
            left: self.plan.len() as u64,
            invalid_paths: self.validator.invalid_paths() as u64,
            invalid_flux: self.plan.invalid_flux() + self.validator.invalid_flux(),
            converged: self.is_converged(),
        }
    }

    /// Validates paths, until `until` or to the end, and plans what follows from them.
    fn settle(&mut self, until: Option<Instant>) -> Result<(), GpuError> {
        if self.settled && self.validator.is_valid() {
            return Ok(());
        }
        let start = Instant::now();
        while !self.validator.is_valid() {
            self.settled = false;
            self.trace(until.map_or(usize::MAX, |_| PATHS_AT_ONCE));
            if until.is_some_and(|until| Instant::now() >= until) {
                break;
            }
        }
        // A plan is made for all paths at once: while some are left, no more time goes into plans than into paths.
        self.traced += start.elapsed();
        if self.validator.is_valid() || self.plan.len() == 0 || self.traced >= self.planning {
            let start = Instant::now();
            self.plan_wanted(true)?;
            (self.traced, self.planning) = (Duration::ZERO, start.elapsed());
            self.settled = true;
        }
        Ok(())
    }

    /// Traces so many paths again, and brings the octree and the ledger to what they found.
    fn trace(&mut self, paths: usize) {
        let _span = debug_span!("validate").entered();
        let scene = self.editor.scene().clone();
        let differences = self.validator.step(&scene, &self.bvh, paths);
        let paths = self.validator.paths();
        debug_span!("octree").in_scope(|| self.clusters.apply(&scene, paths, &differences));
        debug_span!("ledger").in_scope(|| self.holdings.note(&self.clusters, &differences));
    }

    /// Scenes that no light is held under any more make room.
    fn forget(&mut self) -> Result<(), GpuError> {
        if self.journal.is_on() {
            return Ok(());
        }
        let current = self.illumination.version();
        let held = self.holdings.all().map(|h| h.version).min();
        let oldest = held.into_iter().chain(self.illumination.oldest_waiting());
        self.forget_before(oldest.min().unwrap_or(current))
    }

    /// Does an update: all of it is sent before anything else is.
    fn perform(&mut self, update: &schedule::Update) -> Result<(), GpuError> {
        let _span = debug_span!("update", kind = update.kind.name()).entered();
        let version = self.illumination.version();
        let wanted = self.wanted.cells();
        let change = |held: &mut BTreeMap<CellId, Held>| match &update.what {
            What::Advance(cell) => {
                // It may have been exchanged since it was planned.
                let old = held.get(cell).filter(|h| h.version != version).cloned();
                let new = old.clone().map(|old| Held { version, ..old });
                held.extend(new.clone().map(|new| (*cell, new)));
                (Vec::from_iter(old), Vec::from_iter(new))
            }
            What::Exchange { subtract, add } => {
                let old = subtract.iter().filter_map(|cell| held.remove(cell));
                let old: Vec<Held> = old.collect();
                let selected = add.iter().filter_map(|cell| wanted.get(cell).cloned());
                let new = selected.map(|selected| Held { selected, version });
                let new: Vec<Held> = new.collect();
                held.extend(new.iter().map(|new| (new.selected.cell, new.clone())));
                (old, new)
            }
        };
        let done = self
            .holdings
            .change(update.parts, &update.what.cells(), change);
        let lights = |cells: &[Held]| cells.iter().flat_map(Held::lights).collect::<Vec<_>>();
        for (parts, (old, new)) in done {
            if old.is_empty() && new.is_empty() {
                continue;
            }
            let (leaving, coming) = (lights(&old), lights(&new));
            let mut entry = Entry::new(update.kind, parts);
            (entry.subtracted, entry.added) = (old, new);
            entry.lights = self.illumination.exchange(parts, leaving, coming)?;
            let (taken, _) = self.illumination.taken_and_done();
            self.journal.note(entry, self.plan.invalid_flux(), taken);
        }
        Ok(())
    }

    /// Evaluations of lights that the map still needs, all paths validated.
    ///
    /// # Errors
    /// No memory, a lost device.
    pub fn lights_left(&mut self) -> Result<u64, GpuError> {
        self.settle(None)?;
        Ok(self.plan.lights())
    }
}

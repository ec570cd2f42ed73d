//! Lights on their way to the device: in batches of one kind, the next recorded while one runs.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use super::allowance::{Allowance, Counts};
use super::kept::Keeping;
use super::pending::{Pending, Sign};
use super::{Flight, Illumination};
use crate::bake::device::records::{
    self, Light, Region, Surroundings, hemicube_bytes, parallel_bytes,
};
use crate::bake::device::shared::{BATCH, KEPT_ALL, KEPT_BESIDE, KEPT_BOTH, KEPT_NOTHING};
use crate::bake::passes::accumulate::Batch;
use crate::bake::passes::shadow::{MAX_VIEWS, Maps, Place};
use crate::bake::world::versions::Version;
use crate::cluster::{Shape, VirtualLight};
use crate::gpu::{Result, Stage};

/// No submission on a GPU should run longer: drivers kill those that run for seconds.
const SUBMISSION: Duration = Duration::from_millis(400);
/// Submissions in flight: one runs while the next is recorded.
const IN_FLIGHT: usize = 2;

/// Batches of the other kind that a light waits for at most: what comes first is to be seen first.
const PATIENCE: u32 = 2;

impl Illumination {
    pub(super) fn enter(&mut self, mut new: Pending) -> Result<()> {
        let queue = new.queue();
        new.keeping = self.kept.note(&new);
        let waiting = &mut self.queues[queue].pending;
        waiting.push(new);
        let all = waiting.len();
        // What is sent little by little waits here.
        if self.allowance.is_none() {
            let fitting = self.fitting(queue);
            if fitting < all {
                self.send_batch(queue, fitting)?;
            }
        }
        Ok(())
    }

    /// From now on sends no more than what takes so long on the device, until the next call; with `whole`, begins no update.
    /// What must wait is sent with what is allowed then. None: sends everything, as fast as it can.
    pub(in crate::bake) fn allow(&mut self, time: Option<Duration>, whole: bool) {
        self.allowance = time.map(|time| Allowance::new(time, whole));
    }

    /// What is left of that time.
    pub(in crate::bake) fn left(&self) -> Duration {
        self.allowance.map_or(Duration::ZERO, |a| a.left())
    }

    /// What the lights that wait will take on the device, about.
    pub(in crate::bake) fn expected(&self) -> Duration {
        let mut kinds = Counts::default();
        let waiting = self.queues.iter().flat_map(|q| &q.pending);
        waiting.for_each(|p| kinds[p.kind()] += 1);
        Duration::from_secs_f64(self.costs.of(&kinds) * 1e-3)
    }

    /// Whether lights wait that were taken in.
    pub(in crate::bake) fn is_behind(&self) -> bool {
        self.queues.iter().any(|q| !q.pending.is_empty())
    }

    /// Whether every update is in what has been sent wholly or not at all.
    pub(in crate::bake) fn is_whole(&self) -> bool {
        self.broken().is_none()
    }

    /// The queue that holds what is missing of updates that were begun.
    fn broken(&self) -> Option<usize> {
        let begun = |q: &usize| {
            let first = self.queues[*q].pending.first();
            first.is_some_and(|p| p.update <= self.touched)
        };
        [1, 0].into_iter().find(begun)
    }

    /// The oldest version that lights wait to be evaluated in.
    pub(in crate::bake) fn oldest_waiting(&self) -> Option<Version> {
        let waiting = self.queues.iter().flat_map(|q| &q.pending);
        waiting.map(|p| p.version.min(p.begins())).min()
    }

    /// Sends what is pending and waits for everything.
    pub fn flush(&mut self) -> Result<()> {
        self.allowance = None;
        self.send()?;
        while !self.in_flight.is_empty() {
            self.retire()?;
        }
        Ok(())
    }

    /// Views of a light, and how many bytes those of them take together that have no place of their own.
    fn depth_maps(&self, pending: &Pending) -> (u64, u64) {
        let light = &pending.light;
        let views = u64::from(views_of(light));
        let size = self.sizes.of(light);
        let bytes = match light.shape {
            Shape::Directional { .. } => parallel_bytes(size),
            _ => hemicube_bytes(size),
        };
        let [own, other] = pending
            .keeping
            .places()
            .map(|slot| u64::from(slot.is_none()));
        let (versions, drawn) = match (pending.version == pending.other, pending.keeping.load_other)
        {
            (true, None) => (1, own),
            (true, Some(_)) => (2, own),
            (false, _) => (2, own + other),
        };
        (versions * views, drawn * views * bytes)
    }

    /// How many of the first lights of a queue go into its next batch.
    fn fitting(&self, queue: usize) -> usize {
        let most = self.batch_limit.unwrap_or(BATCH).max(1) as usize;
        let most = most.min(self.batch);
        let (mut views, mut bytes, mut kinds) = (0, 0, Counts::default());
        let fits = |(before, p): &(usize, &Pending)| {
            let needs = self.depth_maps(p);
            (views, bytes) = (views + needs.0, bytes + needs.1);
            kinds[p.kind()] += 1;
            let waits = |q: &Pending| p.keeping.waits_for(&q.keeping);
            if self.queues[queue].pending[..*before].iter().any(waits) {
                return false;
            }
            let allowed = |a: Allowance| {
                a.holds(self.costs.of(&kinds), before + 1) && !(a.whole && p.update > self.touched)
            };
            self.allowance.is_none_or(allowed)
                && (*before == 0
                    || *before < most && views <= MAX_VIEWS && bytes <= self.shadow.room())
        };
        let pending = self.queues[queue].pending.iter().enumerate();
        pending.take_while(fits).count()
    }

    /// Sends what is pending, or what is allowed of it, without waiting for it.
    pub fn send(&mut self) -> Result<()> {
        // What was begun, then direct light.
        while let Some(queue) = self.broken().or_else(|| {
            let waiting = |q: &usize| !self.queues[*q].pending.is_empty();
            [1, 0].into_iter().find(waiting)
        }) {
            let lights = self.fitting(queue);
            if lights == 0 {
                break;
            }
            self.send_batch(queue, lights)?;
        }
        Ok(())
    }

    /// Sends the first lights of a queue.
    fn send_batch(&mut self, queue: usize, lights: usize) -> Result<()> {
        while self.in_flight.len() >= IN_FLIGHT {
            self.retire()?;
        }
        let soft = queue == 1;
        let sending: Vec<Pending> = self.queues[queue].pending.drain(..lights).collect();
        let mut kinds = Counts::default();
        for pending in &sending {
            kinds[pending.kind()] += 1;
            self.touched = self.touched.max(pending.update);
        }
        if let Some(allowance) = &mut self.allowance {
            allowance.take(self.costs.of(&kinds));
        }
        let _span = tracing::debug_span!("record batch", lights, soft).entered();
        let mut views = Vec::new();
        let mut places = HashMap::new();
        let mut regions: Vec<Region> = Vec::new();
        let mut lookups: Vec<Region> = Vec::new();
        let mut lights = Vec::new();
        let mut between = (0, 0, 0..0);
        let mut alone = [false; 2];
        for pending in &sending {
            let begins = pending.begins();
            let (a, b) = (pending.version.min(begins), pending.version.max(begins));
            if (a, b) != (between.0, between.1) {
                let first = regions.len();
                lookups.clear();
                if a != b {
                    let differ = self.versions.between(a, b);
                    regions.extend(&differ.occluders);
                    lookups.clone_from(&differ.lookups);
                    alone = differ.alone;
                }
                between = (a, b, first..regions.len());
            }
            let around = Surroundings {
                version: pending.version,
                other: pending.other,
                begins,
                parts: pending.parts,
                kept: kept(pending, alone),
                regions: &lookups,
                first_occluder: between.2.start as u32,
                occluders: between.2.len() as u32,
                bounds: self.versions.bounds(pending.version),
                soft,
                moved: self.accumulate.moved(),
            };
            let sign = if pending.sign == Sign::Add { 1 } else { -1 };
            let light = records::record(&pending.light, sign, &self.sizes, &around, &mut views);
            let count = views_of(&pending.light);
            for (first, slot) in (light.view..)
                .step_by(count as usize)
                .zip(pending.keeping.places())
            {
                let Some(slot) = slot else { continue };
                let (buffer, mut at) = self.kept.at(slot);
                for view in first..first + count {
                    places.insert(view, Place { buffer, at });
                    at += views[view as usize].bytes();
                }
            }
            let other_flux = pending.flux.unwrap_or_default().to_array();
            lights.push(Light {
                other_flux,
                ..light
            });
        }
        let mut cmd = self.gpu.commands()?;
        cmd.barrier(Stage::All, Stage::All);
        let instances = self.versions.address();
        self.shadow.record(
            &self.gpu,
            &mut cmd,
            &self.occluders,
            instances,
            &Maps {
                views: &views,
                kept: &places,
                blocks: !soft,
            },
        )?;
        let batch = Batch {
            lights: &lights,
            regions: &regions,
            soft,
        };
        self.accumulate.record(
            &self.gpu,
            &mut cmd,
            &self.receivers,
            &self.shadow,
            instances,
            &batch,
        )?;
        let mut sent = [0; 2];
        sent[queue] = lights.len() as u64;
        self.in_flight.push_back(Flight {
            ticket: cmd.submit()?,
            sent: Instant::now(),
            lights: sent,
            kinds,
        });
        self.lights[queue] += sent[queue];
        self.queues[queue].waited = 0;
        let other = 1 - queue;
        let waiting = &mut self.queues[other];
        if self.allowance.is_none() && !waiting.pending.is_empty() {
            waiting.waited += 1;
            if waiting.waited >= PATIENCE {
                return self.send_batch(other, self.fitting(other));
            }
        }
        Ok(())
    }

    /// Takes note of submissions that have finished; sends what is pending if the device has nothing to do, or if that is
    /// allowed.
    pub(in crate::bake) fn poll(&mut self) -> Result<()> {
        while let Some(flight) = self.in_flight.front() {
            if !flight.ticket.is_done()? {
                break;
            }
            self.retire()?;
        }
        if self.in_flight.is_empty() || self.allowance.is_some() {
            self.send()?;
        }
        Ok(())
    }

    /// Lights taken in, indirect and direct ones, and of these those that are in the map.
    pub(in crate::bake) fn taken_and_done(&self) -> ([u64; 2], [u64; 2]) {
        let taken = [0, 1].map(|q| self.lights[q] + self.queues[q].pending.len() as u64);
        let flying = |q: usize| self.in_flight.iter().map(|f| f.lights[q]).sum::<u64>();
        (taken, [0, 1].map(|q| self.lights[q] - flying(q)))
    }

    /// Waits for the oldest submission and learns from the time it took.
    fn retire(&mut self) -> Result<()> {
        let Some(flight) = self.in_flight.pop_front() else {
            return Ok(());
        };
        flight.ticket.wait()?;
        if let Some(took) = flight.ticket.device_time() {
            self.costs.learn(&flight.kinds, took);
        }
        if self.gpu.info().kind == "CPU" {
            return Ok(());
        }
        // A batch waits for the one before it: the span holds both.
        let took = flight.sent.elapsed() / IN_FLIGHT as u32;
        if took > SUBMISSION {
            self.batch = (self.batch / 2).max(1);
        } else if took * 3 < SUBMISSION && flight.lights.iter().sum::<u64>() >= self.batch as u64 {
            self.batch = (self.batch * 2).min(BATCH as usize);
        }
        Ok(())
    }
}

/// Views of a light in one version of the scene.
fn views_of(light: &VirtualLight) -> u32 {
    match light.shape {
        Shape::Point => 2,
        _ => 1,
    }
}

/// What of a light's views was kept, and of those in the other version. `alone`: whether anything stands in the earlier of the two
/// alone, and in the later one.
fn kept(pending: &Pending, alone: [bool; 2]) -> [u32; 2] {
    let Keeping {
        load, load_other, ..
    } = pending.keeping;
    let goes = alone[usize::from(pending.begins() > pending.version)];
    let own = match (load, load_other) {
        (Some(_), _) => KEPT_ALL,
        (None, Some(_)) if goes => KEPT_BESIDE,
        (None, Some(_)) => KEPT_BOTH,
        (None, None) => KEPT_NOTHING,
    };
    let other = load_other.map_or(KEPT_NOTHING, |_| KEPT_ALL);
    [own, other]
}

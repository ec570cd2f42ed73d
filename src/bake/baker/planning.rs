//! What is to be done: the updates that lead from what the map holds, in each of its parts, to what it should hold.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;
use tracing::debug_span;

use super::holdings::Holding;
use crate::bake::baker::Baker;
use crate::bake::device::records::Parts;
use crate::bake::order::brightness::{Brightness, Judge};
use crate::bake::order::eye::Eye;
use crate::bake::order::parts;
use crate::bake::order::places::Around;
use crate::bake::order::plan::Plan;
use crate::bake::order::schedule::{self, Held, Priority};
use crate::bake::order::sight::{Division, Sight};
use crate::cluster::{CellId, Forest as _, Ledger};
use crate::gpu::GpuError;

/// A cell with a larger share of invalid flux is exchanged, not brought to the current scene before that.
const LEAVES: f64 = 0.3;
/// Nor is one whose exchange takes less work than this for a light that leaves: hardly more than bringing it there.
const CHEAP: f64 = 0.5;

impl Baker {
    /// Finds out what should be held by now, and plans the way there; `looks`: the map may be divided for it.
    pub(super) fn plan_wanted(&mut self, looks: bool) -> Result<(), GpuError> {
        let _span = debug_span!("plan").entered();
        debug_span!("wanted").in_scope(|| self.wanted.update(&self.clusters, self.target));
        if looks {
            debug_span!("look").in_scope(|| self.look())?;
        }
        let mut brightness = std::mem::take(&mut self.brightness);
        let mut updates = Vec::new();
        for (parts, Holding { cells, ledger }) in self.holdings.parts() {
            self.look_towards(&mut brightness, cells);
            let exchanges = self.exchanges(&mut brightness, parts, cells, ledger);
            let advances = self.advances(&mut brightness, parts, cells, ledger, &exchanges);
            updates.extend(exchanges);
            updates.extend(advances);
        }
        self.brightness = brightness;
        let mut updates = parts::join(updates, |cell| self.holdings.is_one(cell));
        if self.division().is_some() {
            updates = parts::seen_first(updates);
        }
        self.plan = Plan::new(updates, self.plan.owed());
        Ok(())
    }

    /// Divides the map into what is seen and the rest, where that is another division than before, and nothing is on its way.
    pub(in crate::bake) fn look(&mut self) -> Result<(), GpuError> {
        if !self.holdings.are_one() || self.illumination.is_behind() {
            return Ok(());
        }
        let (scene, size) = (self.editor.scene(), self.editor.scene().bounds().size());
        let same = match (&self.sight, &self.camera) {
            (Some(sight), Some(camera)) => {
                Eye::new(sight.camera()).is_like(&Eye::new(camera), size.length())
            }
            (sight, camera) => sight.is_none() && camera.is_none(),
        };
        if !same {
            let sight = |camera| Sight::new(scene, &self.bvh, &self.atlas, &self.texels, camera);
            self.sight = self.camera.as_ref().map(sight);
        }
        let tiles = |sight: &Sight| sight.tiles(&self.texels);
        let seen = self.sight.as_ref().map(tiles).unwrap_or_default();
        if seen != self.seen {
            self.illumination.divide(&seen)?;
            self.seen = seen;
            self.brightness.forget();
        }
        Ok(())
    }

    /// The scene around lights.
    fn around(&self) -> Around<'_> {
        let texel = 2.0 * self.illumination.pass().epsilon();
        Around::new(self.editor.scene(), &self.bvh, texel, self.division())
    }

    /// The parts of the map, if somebody looks.
    fn division(&self) -> Option<Division<'_>> {
        self.sight.as_ref().map(|sight| Division {
            slots: sight.slots(),
            atlas: &self.atlas,
            seen: &self.seen,
        })
    }

    /// Finds out what of the lights that are held under earlier versions goes towards what changed since.
    fn look_towards(&self, brightness: &mut Brightness, held: &BTreeMap<CellId, Held>) {
        if self.priority != Priority::Bounds {
            return;
        }
        let _span = debug_span!("towards").entered();
        let current = self.illumination.version();
        let held = held.values().filter(|held| held.version != current);
        let between = |version| self.illumination.between(version);
        brightness.learn_towards(&self.around(), current, held, between);
    }

    /// The updates that lead from what parts of the map hold to what is wanted.
    pub(in crate::bake) fn exchanges(
        &self,
        brightness: &mut Brightness,
        parts: Parts,
        held: &BTreeMap<CellId, Held>,
        ledger: &Ledger,
    ) -> Vec<schedule::Update> {
        let wanted = self.wanted.cells();
        let scale = self.clusters.scale().max(f64::MIN_POSITIVE);
        let clusters = &self.clusters;
        let key = |cell: &CellId| clusters.key(cell) as f64 / scale;
        let groups: Vec<_> = schedule::exchanges(held, wanted, |c| clusters.parent(c))
            .into_iter()
            .filter(|(subtract, add)| {
                !(self.settings.indirect_only && schedule::all_direct(subtract, add))
            })
            .collect();
        let changing = groups.iter().flat_map(|(subtract, add)| {
            let old = subtract.iter().map(|c| &held[c].selected);
            old.chain(add.iter().map(|c| &wanted[c]))
        });
        let around = self.around();
        debug_span!("brightness").in_scope(|| brightness.learn(&around, changing));
        let invalid = |cell: &CellId| ledger.flux(cell);
        let (current, brightness) = (self.illumination.version(), &*brightness);
        let judge = Judge {
            brightness,
            around: &around,
        };
        let update = |group| {
            let update = schedule::exchange(group, parts, held, wanted, judge, key, invalid);
            if !follows_by_itself(&update, held) {
                return update;
            }
            let leaving = update.leaving().iter().map(|cell| &held[cell]);
            let towards: Vec<_> = leaving
                .map(|held| brightness.towards(held, current))
                .collect();
            update.beside(&towards)
        };
        debug_span!("judge").in_scope(|| groups.into_par_iter().map(update).collect())
    }

    /// The updates that bring what stays held to the current scene.
    fn advances(
        &self,
        brightness: &mut Brightness,
        parts: Parts,
        held: &BTreeMap<CellId, Held>,
        ledger: &Ledger,
        exchanges: &[schedule::Update],
    ) -> Vec<schedule::Update> {
        let current = self.illumination.version();
        // What is about to leave anyhow need not follow the scene first.
        let leaving: BTreeSet<CellId> = exchanges
            .iter()
            .filter(|u| follows_by_itself(u, held))
            .flat_map(|u| u.leaving())
            .copied()
            .collect();
        let stays = |cell: &CellId, held: &Held| held.version != current && !leaving.contains(cell);
        let staying = || held.iter().filter(|(cell, held)| stays(cell, held));
        let illumination = &self.illumination;
        let bounds = self.priority == Priority::Bounds;
        let mut regions = BTreeMap::new();
        let update = |(&cell, held): (&CellId, &Held)| {
            let regions = regions
                .entry(held.version)
                .or_insert_with(|| illumination.between(held.version));
            let invalid = ledger.flux(&cell);
            let towards = bounds.then(|| brightness.towards(held, current));
            schedule::advance(cell, parts, held, regions, invalid, towards)
        };
        staying().map(update).collect()
    }
}

/// Whether an exchange takes cells that leave straight to the current scene, and not after they were brought there.
fn follows_by_itself(exchange: &schedule::Update, held: &BTreeMap<CellId, Held>) -> bool {
    let leaving = exchange.leaving().iter().map(|cell| &held[cell]);
    let lights: usize = leaving.map(|held| held.selected.lights.len()).sum();
    exchange.invalid > LEAVES || exchange.work() < CHEAP * lights as f64
}

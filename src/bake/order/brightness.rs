//! What is known of where virtual lights shine, and who looks. A lumen that is wrong is seen by how much irradiance it makes
//! wrong where: the plan goes by the root of its square over all surfaces, or those that a camera sees, which a few rays tell.

use std::collections::BTreeMap;
use std::sync::Arc;

use rayon::prelude::*;

use super::eye::Eye;
use super::places::Around;
use super::schedule::Held;
use super::shown::{Found, Shining};
use super::towards::{Towards, towards};
use crate::bake::device::records::Region;
use crate::bake::world::versions::Version;
use crate::cluster::Selected;
use crate::scene::Camera;

/// What is known of lights, by their cells.
#[derive(Debug, Default)]
pub(in crate::bake) struct Brightness {
    /// By address, which stays theirs as long as they are kept here.
    known: BTreeMap<usize, (Arc<Selected>, Vec<Found>)>,
    /// What goes towards what changed between two versions, likewise.
    towards: BTreeMap<(usize, Version, Version), (Arc<Selected>, Towards)>,
    /// Who looks, if anybody does, and who did when that was found out.
    eye: Option<Eye>,
    known_to: Option<Eye>,
}

/// What is known of lights, with the scene around them: who tells what of an update shows.
#[derive(Clone, Copy)]
pub(in crate::bake) struct Judge<'a> {
    pub brightness: &'a Brightness,
    pub around: &'a Around<'a>,
}

impl Brightness {
    /// What `camera` sees counts most from now on.
    pub(in crate::bake) fn look_from(&mut self, camera: Option<&Camera>) {
        self.eye = camera.map(Eye::new);
    }

    /// Finds out about cells that are not known yet.
    pub(in crate::bake) fn learn<'a>(
        &mut self,
        around: &Around,
        cells: impl IntoIterator<Item = &'a Arc<Selected>>,
    ) {
        self.look(around);
        let eye = self.known_to.as_ref();
        let cells = cells.into_iter();
        let new: Vec<_> = cells
            .filter(|cell| !self.known.contains_key(&key(cell)))
            .collect();
        let found: Vec<_> = new
            .par_iter()
            .map(|cell| {
                let lights = cell.lights.iter().enumerate();
                let found = lights.map(|light| Found::new(around, eye, light));
                ((*cell).clone(), found.collect())
            })
            .collect();
        for found in found {
            self.known.insert(key(&found.0), found);
        }
    }

    /// Finds out what of the light of cells, held under earlier versions, goes towards what changed since.
    /// `between`: boxes around that.
    pub(in crate::bake) fn learn_towards<'a>(
        &mut self,
        around: &Around,
        current: Version,
        held: impl IntoIterator<Item = &'a Held>,
        between: impl Fn(Version) -> Vec<Region>,
    ) {
        self.look(around);
        let eye = self.known_to.as_ref();
        self.towards.retain(|(_, _, to), _| *to == current);
        let mut regions = BTreeMap::new();
        let mut new = Vec::new();
        for held in held {
            let key = (key(&held.selected), held.version, current);
            if !self.towards.contains_key(&key) {
                regions
                    .entry(held.version)
                    .or_insert_with(|| between(held.version));
                new.push(held);
            }
        }
        let found: Vec<_> = new
            .par_iter()
            .map(|held| towards(around, eye, &held.selected.lights, &regions[&held.version]))
            .collect();
        for (held, found) in new.into_iter().zip(found) {
            let key = (key(&held.selected), held.version, current);
            self.towards.insert(key, (held.selected.clone(), found));
        }
    }

    /// What was found out about a cell; nothing, if that is not known.
    pub(in crate::bake) fn towards(&self, held: &Held, current: Version) -> Towards {
        let key = (key(&held.selected), held.version, current);
        self.towards.get(&key).map_or(Towards::default(), |t| t.1)
    }

    /// What is known is for who looks now.
    fn look(&mut self, around: &Around) {
        let size = around.far();
        let same = match (&self.eye, &self.known_to) {
            (Some(now), Some(then)) => now.is_like(then, size),
            (now, then) => now.is_none() && then.is_none(),
        };
        if !same {
            self.known.clear();
            self.towards.clear();
            self.known_to.clone_from(&self.eye);
        }
        if let Some(eye) = &mut self.known_to {
            eye.look(around.scene, around.bvh);
        }
    }

    /// The lights of a cell, and what is known of them.
    pub(super) fn of<'a>(&'a self, cell: &'a Selected) -> impl Iterator<Item = Shining<'a>> {
        let known: &[Found] = self.known.get(&key(cell)).map_or(&[], |known| &known.1);
        let found = known.iter().chain(std::iter::repeat(Found::NOTHING));
        cell.lights.iter().zip(found)
    }

    /// All lights are where they should be, or the map was divided anew: what is known is needed no more.
    pub(in crate::bake) fn forget(&mut self) {
        self.known.clear();
        self.towards.clear();
    }
}

fn key(cell: &Selected) -> usize {
    std::ptr::from_ref(cell) as usize
}

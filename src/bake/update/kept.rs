//! Depth maps of lights that the lightmap holds, kept so that they are drawn once: what takes a light away again, dims it, follows it
//! to another scene, or brings it to the other part of the lightmap finds its map there.

mod shelf;

use std::collections::HashMap;

use super::pending::{Pending, Sign};
use crate::bake::device::records::{Parts, ShadowSizes, Version, hemicube_bytes, parallel_bytes};
use crate::cluster::{Shape, VirtualLight};
use crate::gpu::{Buffer, Gpu};
use shelf::Shelf;

/// What a map shows, bit for bit: what its views see there of that scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Key {
    place: [u32; 3],
    pole: [u32; 3],
    /// A spot's outer angle: nothing is drawn beside it.
    cone: u32,
    size: Size,
    version: Version,
}

impl Key {
    fn new(light: &VirtualLight, version: Version) -> Self {
        let cone = match light.shape {
            Shape::Spot { outer, .. } => outer,
            _ => 0.0,
        };
        Self {
            place: light.position.to_array().map(f32::to_bits),
            pole: light.surface.to_array().map(f32::to_bits),
            cone: cone.to_bits(),
            size: Size::of(light),
            version,
        }
    }
}

/// Maps by how large they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Size {
    /// A hemicube of an indirect light.
    Indirect,
    /// One of a direct light.
    Direct,
    /// A point's two.
    Point,
    /// Of parallel light.
    Sun,
}

impl Size {
    const ALL: [Self; 4] = [Self::Indirect, Self::Direct, Self::Point, Self::Sun];

    fn of(light: &VirtualLight) -> Self {
        match light.shape {
            Shape::Directional { .. } => Self::Sun,
            Shape::Point => Self::Point,
            _ if light.direct => Self::Direct,
            _ => Self::Indirect,
        }
    }

    /// Bytes of one.
    fn bytes(self, sizes: &ShadowSizes) -> u64 {
        match self {
            Self::Indirect => hemicube_bytes(sizes.indirect),
            Self::Direct => hemicube_bytes(sizes.direct),
            Self::Point => 2 * hemicube_bytes(sizes.direct),
            Self::Sun => parallel_bytes(sizes.sun),
        }
    }
}

/// A map that lights of either part of the lightmap refer to, so many of each.
#[derive(Clone, Copy, Debug)]
struct Entry {
    slot: Slot,
    lights: [u32; 2],
}

/// A place for a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Slot {
    size: Size,
    place: u32,
}

/// Which maps of a light are there, and where one is to be kept once it is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Keeping {
    /// That of its version.
    pub load: Option<Slot>,
    /// That of the version which a difference takes it away from, or of a light that leaves: its own begins as that.
    pub load_other: Option<Slot>,
    /// Where that of its version goes.
    pub store: Option<Slot>,
}

impl Keeping {
    /// Whether its map begins with one that another light draws.
    pub fn waits_for(&self, other: &Self) -> bool {
        let begins = self.load_other.filter(|_| self.load.is_none());
        begins.is_some() && begins == other.store
    }

    /// Where the maps of its version, and of that which a difference takes it away from, are or are to be kept.
    pub fn places(&self) -> [Option<Slot>; 2] {
        [self.load.or(self.store), self.load_other]
    }
}

/// The maps.
pub(super) struct KeptMaps {
    /// By [`Size`].
    shelves: [Shelf; 4],
    /// Bytes that more of them may take: of all, and of those of direct lights.
    left: [u64; 2],
    entries: HashMap<Key, Entry>,
}

impl KeptMaps {
    /// `budget`: bytes that all of them may take. Those of direct lights take half of it at most: they are large.
    pub fn new(gpu: &Gpu, sizes: &ShadowSizes, budget: u64) -> Self {
        Self {
            shelves: Size::ALL.map(|size| Shelf::new(gpu, size.bytes(sizes))),
            left: [budget, budget / 2],
            entries: HashMap::new(),
        }
    }

    /// Where a map is, and how many bytes before it.
    pub fn at(&self, slot: Slot) -> (&Buffer, u64) {
        self.shelves[slot.size as usize].at(slot.place)
    }

    /// Nothing is held any more.
    pub fn clear(&mut self) {
        self.entries.clear();
        self.shelves.iter_mut().for_each(Shelf::clear);
    }

    /// Takes note of a light on its way to the device, in the order in which they are sent: which of its maps are there, and where
    /// a new one is kept.
    pub fn note(&mut self, new: &Pending) -> Keeping {
        let mut keeping = Keeping::default();
        let key = Key::new(&new.light, new.version);
        self.shelves[key.size as usize].tick();
        if new.version != new.other {
            let old = Key {
                version: new.other,
                ..key
            };
            // Without that, what stands in both versions has to be drawn for it.
            let Some(slot) = self.find(&old) else {
                return keeping;
            };
            keeping.load_other = Some(slot);
            self.release(&old, new.parts);
            (keeping.load, keeping.store) = self.hold(key, new.parts);
        } else if new.flux.is_some() && self.find(&key).is_some() {
            // What goes refers to it, and what comes will.
            keeping.load = self.find(&key);
        } else if new.sign == Sign::Add {
            (keeping.load, keeping.store) = self.hold(key, new.parts);
            if let (None, Some(version)) = (keeping.load, new.begins) {
                keeping.load_other = self.find(&Key { version, ..key });
            }
        } else {
            keeping.load = self.find(&key);
            self.release(&key, new.parts);
        }
        keeping
    }

    /// A light's map is the same in another version.
    pub fn rename(&mut self, light: &VirtualLight, parts: Parts, from: Version, to: Version) {
        let [from, to] = [from, to].map(|version| Key::new(light, version));
        let Some(slot) = self.find(&from) else { return };
        if !self.entries.contains_key(&to) {
            self.enter(to, slot);
        }
        self.release(&from, parts);
        self.count(&to, parts);
    }

    /// What a light sees in one version, it sees in another: what comes there finds the map of what leaves here.
    pub fn share(&mut self, light: &VirtualLight, from: Version, to: Version) {
        let [from, to] = [from, to].map(|version| Key::new(light, version));
        if let Some(slot) = self.find(&from)
            && !self.entries.contains_key(&to)
        {
            self.enter(to, slot);
        }
    }

    fn find(&self, key: &Key) -> Option<Slot> {
        self.entries.get(key).map(|entry| entry.slot)
    }

    /// Where a map is that lights of these parts refer to from here on; or else where it is to be kept, if there is room.
    fn hold(&mut self, key: Key, parts: Parts) -> (Option<Slot>, Option<Slot>) {
        let known = self.find(&key);
        let new = if known.is_none() {
            self.take(key.size)
        } else {
            None
        };
        if let Some(slot) = new {
            self.enter(key, slot);
        }
        self.count(&key, parts);
        (known, new)
    }

    fn enter(&mut self, key: Key, slot: Slot) {
        self.shelves[slot.size as usize].begin(slot.place);
        let lights = [0; 2];
        self.entries.insert(key, Entry { slot, lights });
    }

    fn count(&mut self, key: &Key, parts: Parts) {
        if let Some(entry) = self.entries.get_mut(key) {
            for (lights, part) in entry.lights.iter_mut().zip(Parts::EACH) {
                *lights += u32::from(parts.hold(part));
            }
        }
    }

    fn release(&mut self, key: &Key, parts: Parts) {
        let Some(entry) = self.entries.get_mut(key) else {
            return;
        };
        for (lights, part) in entry.lights.iter_mut().zip(Parts::EACH) {
            *lights = lights.saturating_sub(u32::from(parts.hold(part)));
        }
        if entry.lights == [0; 2] {
            let slot = entry.slot;
            self.entries.remove(key);
            self.shelves[slot.size as usize].end(slot.place);
        }
    }

    /// A free slot, if there is one, or memory for more.
    fn take(&mut self, size: Size) -> Option<Slot> {
        let shelf = &mut self.shelves[size as usize];
        // Of which budgets it takes: indirect light has the first to itself.
        let budgets = if size == Size::Indirect { 1 } else { 2 };
        let left = &mut self.left[..budgets];
        if !shelf.has_room() {
            match shelf.extend(left.iter().copied().min().unwrap_or(0)) {
                Ok(bytes) => left.iter_mut().for_each(|left| *left -= bytes),
                // What is drawn again takes time, no more.
                Err(error) => {
                    tracing::warn!("depth maps are not kept any more: {error}");
                    self.left = [0; 2];
                }
            }
        }
        let place = shelf.take()?;
        Some(Slot { size, place })
    }
}

#[cfg(test)]
mod tests;

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
    /// That of the version which a difference takes it away from.
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
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::bake::device::shared::BATCH;
    use crate::gpu::GpuOptions;

    fn pending(x: f32, sign: Sign, [other, version]: [Version; 2], parts: Parts) -> Pending {
        let light = VirtualLight {
            shape: Shape::Disk { area: 1.0 },
            position: Vec3::new(x, 0.0, 0.0),
            normal: Vec3::Y,
            surface: Vec3::Y,
            flux: Vec3::ONE,
            direct: false,
        };
        Pending {
            light,
            sign,
            version,
            other,
            flux: None,
            parts,
            update: 0,
            keeping: Keeping::default(),
        }
    }

    const SIZES: ShadowSizes = ShadowSizes {
        indirect: 8,
        direct: 16,
        sun: 8,
    };

    fn slot(size: Size, place: u32) -> Slot {
        Slot { size, place }
    }

    #[test]
    fn maps_stay_as_long_as_either_part_refers_to_them_and_slots_come_back() {
        let gpu = Gpu::new(&GpuOptions::default()).expect("a Vulkan device");
        let mut maps = KeptMaps::new(&gpu, &SIZES, 2 * hemicube_bytes(SIZES.indirect));
        let mut note = |x, sign, versions, parts| maps.note(&pending(x, sign, versions, parts));
        // As many lights as may be sent together: none of them may draw over a map that another one looks up.
        let others = |note: &mut dyn FnMut(f32, Sign, [Version; 2], Parts) -> Keeping| {
            for _ in 0..BATCH {
                let nothing = note(9.0, Sign::Subtract, [0, 0], Parts::ALL);
                assert_eq!(nothing, Keeping::default());
            }
        };
        let own = |place| Some(slot(Size::Indirect, place));
        let new = |place| Keeping {
            store: own(place),
            ..Keeping::default()
        };
        let known = |place| Keeping {
            load: own(place),
            ..Keeping::default()
        };
        let (add, subtract) = (Sign::Add, Sign::Subtract);
        assert_eq!(note(1.0, add, [0, 0], Parts::SEEN), new(0));
        assert_eq!(note(1.0, add, [0, 0], Parts::REST), known(0));
        assert_eq!(note(2.0, add, [0, 0], Parts::ALL), new(1));
        // There is no room for a third one, and so none for what follows from it.
        assert_eq!(note(3.0, add, [0, 0], Parts::ALL), Keeping::default());
        assert_eq!(note(3.0, add, [0, 1], Parts::ALL), Keeping::default());
        // A light goes from one part, and the map stays for the other; then its slot is free.
        assert_eq!(note(1.0, subtract, [0, 0], Parts::REST), known(0));
        assert_eq!(note(1.0, subtract, [0, 0], Parts::SEEN), known(0));
        assert_eq!(note(1.0, subtract, [0, 0], Parts::SEEN), Keeping::default());
        assert_eq!(note(3.0, add, [0, 0], Parts::ALL), Keeping::default());
        others(&mut note);
        // To another version, in one part after the other: drawn once.
        let there = note(2.0, add, [0, 1], Parts::SEEN);
        assert_eq!((there.load_other, there.store), (own(1), own(0)));
        let there = note(2.0, add, [0, 1], Parts::REST);
        assert_eq!((there.load_other, there.load), (own(1), own(0)));
        others(&mut note);
        assert_eq!(note(4.0, add, [1, 1], Parts::ALL), new(1));
        // Where nothing differs a map serves both versions.
        let light = pending(4.0, add, [1, 1], Parts::ALL).light;
        maps.rename(&light, Parts::SEEN, 1, 2);
        let mut note = |x, sign, versions, parts| maps.note(&pending(x, sign, versions, parts));
        assert_eq!(note(4.0, subtract, [1, 1], Parts::REST), known(1));
        assert_eq!(note(4.0, subtract, [2, 2], Parts::SEEN), known(1));
        others(&mut note);
        assert_eq!(note(5.0, add, [2, 2], Parts::ALL), new(1));
    }

    #[test]
    fn a_dimmed_light_finds_its_map_and_direct_light_leaves_half_of_the_room() {
        let gpu = Gpu::new(&GpuOptions::default()).expect("a Vulkan device");
        let all = Size::ALL.map(|size| size.bytes(&SIZES));
        let mut maps = KeptMaps::new(&gpu, &SIZES, 2 * all[2] + all[1]);
        let direct = |x, shape, flux: f32, sign| {
            let mut new = pending(x, sign, [0, 0], Parts::ALL);
            (new.light.shape, new.light.direct) = (shape, true);
            new.light.flux *= flux;
            new
        };
        let lamp = maps.note(&direct(0.0, Shape::Point, 2.0, Sign::Add));
        assert_eq!(lamp.store, Some(slot(Size::Point, 0)));
        // It is drawn neither for what comes nor for what goes.
        let dimmed = maps.note(&direct(0.0, Shape::Point, 1.0, Sign::Add));
        let gone = maps.note(&direct(0.0, Shape::Point, 2.0, Sign::Subtract));
        assert_eq!((dimmed.load, gone.load), (lamp.store, lamp.store));
        // A spot that opens shows more than its map does; and there is room for no more direct light.
        let spot = |outer| Shape::Spot { inner: 0.1, outer };
        let narrow = maps.note(&direct(1.0, spot(0.2), 1.0, Sign::Add));
        assert_eq!(narrow.store, None);
        let left = maps.note(&direct(0.0, Shape::Point, 1.0, Sign::Subtract));
        assert_eq!(left.load, lamp.store);
        for _ in 0..BATCH {
            maps.note(&direct(9.0, Shape::Point, 1.0, Sign::Subtract));
        }
        let (first, second) = (
            maps.note(&direct(2.0, Shape::Point, 1.0, Sign::Add)),
            maps.note(&pending(3.0, Sign::Add, [0, 0], Parts::ALL)),
        );
        assert_eq!(first.store, lamp.store);
        assert_eq!(second.store, Some(slot(Size::Indirect, 0)));
        let mut maps = KeptMaps::new(&gpu, &SIZES, 2 * 2 * all[1]);
        let narrow = maps.note(&direct(1.0, spot(0.2), 1.0, Sign::Add));
        let wide = maps.note(&direct(1.0, spot(0.3), 1.0, Sign::Add));
        assert_eq!(narrow.store, Some(slot(Size::Direct, 0)));
        assert_eq!(wide.store, Some(slot(Size::Direct, 1)));
    }
}

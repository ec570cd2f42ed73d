//! Depth maps of indirect lights that the lightmap holds, kept so that they are drawn once: what takes a light away again, follows
//! it to another scene, or brings it to the other part of the lightmap finds its map there.

use std::collections::HashMap;

use super::pending::{Pending, Sign};
use crate::bake::device::records::{Parts, Version};
use crate::cluster::{Shape, VirtualLight};
use crate::gpu::{Buffer, Gpu, Memory};

/// Maps of one allocation.
const CHUNK: u32 = 256;

/// What a map shows, bit for bit: what a hemicube sees there of that scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Key {
    place: [u32; 3],
    pole: [u32; 3],
    version: Version,
}

/// A map that lights of either part of the lightmap refer to, so many of each.
#[derive(Clone, Copy, Debug)]
struct Entry {
    slot: u32,
    lights: [u32; 2],
}

/// A place for a map.
pub(super) type Slot = u32;

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
    /// Whether it reads what another one writes.
    pub fn waits_for(&self, other: &Self) -> bool {
        other.store.is_some() && [self.load, self.load_other].contains(&other.store)
    }
}

/// The maps.
pub(super) struct KeptMaps {
    gpu: Gpu,
    /// Bytes of a map.
    bytes: u64,
    chunks: Vec<Buffer>,
    /// How many there may be.
    most: u32,
    /// How many entries refer to each.
    references: Vec<u32>,
    free: Vec<Slot>,
    entries: HashMap<Key, Entry>,
}

impl KeptMaps {
    /// `size`: pixels along a map's edge; `budget`: bytes that all of them may take.
    pub fn new(gpu: &Gpu, size: u32, budget: u64) -> Self {
        let bytes = 3 * u64::from(size) * u64::from(size) * 4;
        Self {
            gpu: gpu.clone(),
            bytes,
            chunks: Vec::new(),
            most: u32::try_from(budget / bytes).unwrap_or(u32::MAX),
            references: Vec::new(),
            free: Vec::new(),
            entries: HashMap::new(),
        }
    }

    /// Where a map is.
    pub fn at(&self, slot: Slot) -> (&Buffer, u64) {
        let (chunk, place) = (slot / CHUNK, slot % CHUNK);
        (&self.chunks[chunk as usize], u64::from(place) * self.bytes)
    }

    /// Nothing is held any more.
    pub fn clear(&mut self) {
        self.entries.clear();
        self.references.iter_mut().for_each(|n| *n = 0);
        self.free = (0..self.references.len() as Slot).rev().collect();
    }

    /// Takes note of a light on its way to the device, in the order in which they are sent: which of its maps are there, and where
    /// a new one is kept.
    pub fn note(&mut self, new: &Pending) -> Keeping {
        let mut keeping = Keeping::default();
        let Some(key) = self.key(&new.light, new.version) else {
            return keeping;
        };
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
        let keys = self.key(light, from).zip(self.key(light, to));
        let Some((from, to)) = keys else { return };
        let Some(slot) = self.find(&from) else { return };
        if !self.entries.contains_key(&to) {
            self.enter(to, slot);
        }
        self.release(&from, parts);
        self.count(&to, parts);
    }

    fn key(&self, light: &VirtualLight, version: Version) -> Option<Key> {
        let indirect = matches!(light.shape, Shape::Polygon { .. } | Shape::Disk { .. });
        (indirect && !light.direct && self.most > 0).then(|| Key {
            place: light.position.to_array().map(f32::to_bits),
            pole: light.normal.to_array().map(f32::to_bits),
            version,
        })
    }

    fn find(&self, key: &Key) -> Option<Slot> {
        self.entries.get(key).map(|entry| entry.slot)
    }

    /// Where a map is that lights of these parts refer to from here on; or else where it is to be kept, if there is room.
    fn hold(&mut self, key: Key, parts: Parts) -> (Option<Slot>, Option<Slot>) {
        let known = self.find(&key);
        let new = if known.is_none() { self.take() } else { None };
        if let Some(slot) = new {
            self.enter(key, slot);
        }
        self.count(&key, parts);
        (known, new)
    }

    fn enter(&mut self, key: Key, slot: Slot) {
        self.references[slot as usize] += 1;
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
            self.references[slot as usize] -= 1;
            if self.references[slot as usize] == 0 {
                self.free.push(slot);
            }
        }
    }

    /// A free slot, if there is one, or memory for more.
    fn take(&mut self) -> Option<Slot> {
        let have = self.references.len() as u32;
        if self.free.is_empty() && have < self.most {
            let more = CHUNK.min(self.most - have);
            let bytes = u64::from(more) * self.bytes;
            match self.gpu.buffer("kept depth maps", bytes, Memory::Device) {
                Ok(chunk) => {
                    self.chunks.push(chunk);
                    self.references.resize((have + more) as usize, 0);
                    self.free.extend((have..have + more).rev());
                }
                // What is drawn again takes time, no more.
                Err(error) => {
                    tracing::warn!("depth maps are not kept any more: {error}");
                    self.most = have;
                }
            }
        }
        self.free.pop()
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::gpu::GpuOptions;

    fn pending(x: f32, sign: Sign, [other, version]: [Version; 2], parts: Parts) -> Pending {
        let light = VirtualLight {
            shape: Shape::Disk { area: 1.0 },
            position: Vec3::new(x, 0.0, 0.0),
            normal: Vec3::Y,
            flux: Vec3::ONE,
            direct: false,
        };
        Pending {
            light,
            sign,
            version,
            other,
            parts,
            update: 0,
            keeping: Keeping::default(),
        }
    }

    #[test]
    fn maps_stay_as_long_as_either_part_refers_to_them_and_slots_come_back() {
        let gpu = Gpu::new(&GpuOptions::default()).expect("a Vulkan device");
        let mut maps = KeptMaps::new(&gpu, 8, 2 * 3 * 64 * 4);
        let mut note = |x, sign, versions, parts| maps.note(&pending(x, sign, versions, parts));
        let new = |slot| Keeping {
            store: Some(slot),
            ..Keeping::default()
        };
        let known = |slot| Keeping {
            load: Some(slot),
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
        // To another version, in one part after the other: drawn once.
        let there = note(2.0, add, [0, 1], Parts::SEEN);
        assert_eq!((there.load_other, there.store), (Some(1), Some(0)));
        let there = note(2.0, add, [0, 1], Parts::REST);
        assert_eq!((there.load_other, there.load), (Some(1), Some(0)));
        assert_eq!(note(4.0, add, [1, 1], Parts::ALL), new(1));
        // Where nothing differs a map serves both versions.
        let light = pending(4.0, add, [1, 1], Parts::ALL).light;
        maps.rename(&light, Parts::SEEN, 1, 2);
        let mut note = |x, sign, versions, parts| maps.note(&pending(x, sign, versions, parts));
        assert_eq!(note(4.0, subtract, [1, 1], Parts::REST), known(1));
        assert_eq!(note(4.0, subtract, [2, 2], Parts::SEEN), known(1));
        assert_eq!(note(5.0, add, [2, 2], Parts::ALL), new(1));
    }
}

//! Versions of the scene: which instances of its objects exist when.
//!
//! A light must be subtracted in the very scene that it was added to (IBGI section 4.4). So the device holds several
//! versions of the scene at once: an *instance* is an object in one place, with an interval of versions in which it
//! stands there; chunks of triangles and tiles of receivers name their instance, views and lights their version. An
//! edit adds instances for what it moves and shares all others. Where it changes what stands near some tiles of an object
//! that stays, these tiles alone get instances of their own: *parts* of the object, without triangles.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::changes::{Between, Changed, Changes};
use crate::bake::device::pool::Pool;
use crate::bake::device::records::Instance;
pub use crate::bake::device::records::Version;
use crate::gpu::{Address, Buffer, Commands, Gpu, Memory, Result};
use crate::scene::Bounds;

/// The versions that lights are held under.
pub(in crate::bake) struct Versions {
    current: Version,
    /// Scene bounds of each version.
    bounds: BTreeMap<Version, Bounds>,
    changes: Changes,
    /// By instance.
    table: Vec<Instance>,
    /// The object of each live instance.
    object: BTreeMap<u32, u32>,
    /// Numbers of instances.
    numbers: Pool,
    /// The number of one that stands nowhere.
    nobody: u32,
    /// The instances of each object in the current version, if it stands anywhere: itself, then parts of it.
    current_of: BTreeMap<u32, Vec<u32>>,
    buffer: Buffer,
}

impl Versions {
    /// Version 0: instance `i` is object `i`, if that is anywhere.
    pub(in crate::bake) fn new(gpu: &Gpu, standing: &[bool], bounds: Bounds) -> Result<Self> {
        let mut table: Vec<Instance> = standing
            .iter()
            .map(|stands| Instance {
                since: 0,
                until: if *stands { Version::MAX } else { 0 },
                crowded: 0,
            })
            .collect();
        let nobody = table.len() as u32;
        table.push(Instance::default());
        let mut numbers = Pool::default();
        numbers.take(table.len() as u32);
        let here = || (0..).zip(standing).filter(|(_, stands)| **stands);
        let buffer = gpu.buffer(
            "instances",
            (table.len() + 64) as u64 * size_of::<Instance>() as u64,
            Memory::Device,
        )?;
        buffer.write(0, &table)?;
        Ok(Self {
            current: 0,
            bounds: BTreeMap::from([(0, bounds)]),
            changes: Changes::default(),
            table,
            object: here().map(|(i, _)| (i, i)).collect(),
            numbers,
            nobody,
            current_of: here().map(|(i, _)| (i, vec![i])).collect(),
            buffer,
        })
    }

    pub(in crate::bake) fn current(&self) -> Version {
        self.current
    }

    pub(in crate::bake) fn address(&self) -> Address {
        self.buffer.address()
    }

    /// An instance that stands in no version.
    pub(in crate::bake) fn nobody(&self) -> u32 {
        self.nobody
    }

    /// Bounds of the scene in a version.
    pub(in crate::bake) fn bounds(&self, version: Version) -> &Bounds {
        &self.bounds[&version]
    }

    /// Begins a version, with scene bounds of its own.
    pub(in crate::bake) fn begin(&mut self, bounds: Bounds, changed: Changed) -> Version {
        self.current += 1;
        self.bounds.insert(self.current, bounds);
        self.changes.begin(self.current, changed);
        self.current
    }

    /// The object no longer stands where it stood.
    pub(in crate::bake) fn end_instance(&mut self, object: u32) {
        for instance in self.current_of.remove(&object).unwrap_or_default() {
            self.table[instance as usize].until = self.current;
        }
    }

    /// Some tiles of an instance are others from the current version on: returns the instance of the old ones, which ends
    /// now, and that of the new ones, which begins. `all`: none are left as they were, so that a part ends as a whole.
    pub(in crate::bake) fn begin_part(&mut self, instance: u32, all: bool) -> [u32; 2] {
        let (object, since) = (self.object[&instance], self.table[instance as usize].since);
        let parts = self.current_of.entry(object).or_default();
        // The object itself has triangles.
        let ended = if all && parts.first() != Some(&instance) {
            parts.retain(|part| *part != instance);
            self.table[instance as usize].until = self.current;
            instance
        } else {
            self.enter(object, since, self.current)
        };
        let begun = self.enter(object, self.current, Version::MAX);
        self.current_of.entry(object).or_default().push(begun);
        [ended, begun]
    }

    /// The object stands somewhere from the current version on.
    pub(in crate::bake) fn begin_instance(&mut self, object: u32) -> u32 {
        let instance = self.enter(object, self.current, Version::MAX);
        self.current_of.insert(object, vec![instance]);
        instance
    }

    fn enter(&mut self, object: u32, since: Version, until: Version) -> u32 {
        let instance = self.numbers.take(1).start;
        if self.table.len() <= instance as usize {
            let all = instance as usize + 1;
            self.table.resize(all, Instance::default());
        }
        self.table[instance as usize] = Instance {
            since,
            until,
            crowded: 0,
        };
        self.object.insert(instance, object);
        instance
    }

    /// Versions before `oldest` are no longer referred to: returns the instances that stand in no other. Their numbers are
    /// others' from here on: nothing on the device may name them any more when [`Versions::begin`] is called next.
    pub(in crate::bake) fn forget(&mut self, oldest: Version) -> Vec<u32> {
        let gone: Vec<u32> = self
            .object
            .keys()
            .copied()
            .filter(|&i| self.table[i as usize].until <= oldest)
            .collect();
        for &instance in &gone {
            self.object.remove(&instance);
            self.table[instance as usize] = Instance::default();
            self.numbers.give(instance..instance + 1);
        }
        self.bounds.retain(|&version, _| version >= oldest);
        self.changes.forget(oldest);
        gone
    }

    /// Sends the table to the device.
    pub(in crate::bake) fn upload(&mut self, gpu: &Gpu, cmd: &mut Commands) -> Result<()> {
        // Those that have ended add to the same texels as those that stand now; of these, each has its own.
        let ended: BTreeSet<u32> = self
            .object
            .iter()
            .filter(|(instance, _)| self.table[**instance as usize].until != Version::MAX)
            .map(|(_, object)| *object)
            .collect();
        for (&instance, object) in &self.object {
            self.table[instance as usize].crowded = u32::from(ended.contains(object));
        }
        let bytes = std::mem::size_of_val(&self.table[..]) as u64;
        crate::bake::device::pool::grow(gpu, cmd, &mut self.buffer, bytes)?;
        cmd.upload(&self.buffer, 0, &self.table)
    }

    /// Where anything differs between two versions.
    pub(in crate::bake) fn between(&self, a: Version, b: Version) -> Arc<Between> {
        self.changes.between(a, b)
    }
}

//! Puts object-space texels into the world: receivers of every instance, and the box and normal cone of every tile.

use std::collections::BTreeMap;
use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use crate::bake::device::pool::{Pool, grow, vacate};
use crate::bake::device::records::{Placement, Receiver, Replaced, Tile};
use crate::bake::device::shaders;
use crate::bake::device::shared::{NONE, PART_REST, PART_SEEN, TILE};
use crate::gpu::{Address, Buffer, Commands, Gpu, Memory, Pipeline, Result, Stage};
use crate::lightmap::texels::Texels;
use crate::lightmap::{Clearance, Texel};
use crate::scene::Scene;

/// Receivers in world space and their tiles, on the device.
pub struct Receivers {
    pub(in crate::bake) receivers: Buffer,
    pub(in crate::bake) tiles: Buffer,
    /// By tile of texels, the part of the map that it belongs to (`PART_*`).
    pub(in crate::bake) parts: Buffer,
    texels: Buffer,
    clearances: Buffer,
    placements: Buffer,
    pipeline: Pipeline,
    pool: Pool,
    /// By instance: ranges apart from each other.
    taken: BTreeMap<u32, Vec<Range<u32>>>,
    /// By tile of texels: where its receivers stand now, and their instance.
    now: Vec<[u32; 2]>,
    replaced: Buffer,
    /// Tiles of texels, that is of sums.
    texel_tiles: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    texels: Address,
    clearances: Address,
    placements: Address,
    receivers: Address,
    tiles: Address,
    first_texels: u32,
    first_receivers: u32,
    instance: u32,
    replacing: u32,
    replaced: Address,
}

/// Workgroups per dispatch, below the guaranteed limit.
const STRIDE: u32 = 1 << 15;

impl Receivers {
    /// `texels` of all objects; object `i` is instance `i`, if it is `standing`.
    pub fn new(gpu: &Gpu, scene: &Scene, standing: &[bool], texels: &Texels) -> Result<Self> {
        let tiles = texels.list.len() as u32 / TILE;
        let placements: Vec<Placement> = scene
            .objects
            .iter()
            .map(|o| placement(&o.transform))
            .collect();
        let clearances = texels.clearances_of(0..texels.list.len());
        let (receiver, tile) = (size_of::<Receiver>() as u64, size_of::<Tile>() as u64);
        let mut pool = Pool::default();
        pool.take(tiles);
        let mut taken = BTreeMap::new();
        let mut now = vec![[NONE; 2]; tiles as usize];
        let standing = (0..).zip(&texels.tiles).zip(standing).filter(|t| *t.1);
        for ((object, own), _) in standing {
            for tile in own.clone() {
                now[tile as usize] = [tile, object];
            }
            taken.insert(object, vec![own.clone()]);
        }
        let out = Self {
            receivers: gpu.buffer(
                "receivers",
                texels.list.len() as u64 * receiver,
                Memory::Device,
            )?,
            tiles: gpu.buffer("tiles", u64::from(tiles) * tile, Memory::Device)?,
            parts: gpu.buffer_with("parts", &vec![PART_REST; tiles.max(1) as usize])?,
            texels: gpu.buffer_with("texels", &texels.list)?,
            clearances: gpu.buffer_with("clearances", &clearances)?,
            placements: gpu.buffer_with("placements", &placements)?,
            pipeline: gpu.pipeline(shaders::PLACE, &[])?,
            pool,
            taken,
            now,
            replaced: gpu.buffer("replaced tiles", 16, Memory::Device)?,
            texel_tiles: tiles,
        };
        let mut cmd = gpu.commands()?;
        // Tiles of objects that are nowhere are no instance's.
        cmd.fill(&out.tiles, 0, out.tiles.size() & !3, NONE);
        cmd.barrier(Stage::Transfer, Stage::Compute);
        let ranges: Vec<&Range<u32>> = (out.taken.values().flatten())
            .filter(|r| !r.is_empty())
            .collect();
        for run in ranges.chunk_by(|a, b| a.end == b.start) {
            let range = run[0].start..run[run.len() - 1].end;
            out.dispatch(&mut cmd, range.clone(), range.start, NONE);
        }
        cmd.barrier(Stage::Compute, Stage::Compute);
        cmd.submit()?.wait()?;
        Ok(out)
    }

    /// Tiles of receivers to go through; some may be no instance's.
    pub(in crate::bake) fn count(&self) -> u32 {
        self.pool.end()
    }

    pub(in crate::bake) fn texels(&self) -> &Buffer {
        &self.texels
    }

    /// Tiles of texels, and of sums.
    pub(in crate::bake) fn texel_tiles(&self) -> u32 {
        self.texel_tiles
    }

    /// Takes tiles of texels in that came.
    pub(in crate::bake) fn bring(
        &mut self,
        gpu: &Gpu,
        cmd: &mut Commands,
        texels: &Texels,
        new: &[Range<u32>],
    ) -> Result<()> {
        let (entries, texel) = (texels.list.len() as u64, size_of::<Texel>() as u64);
        grow(gpu, cmd, &mut self.texels, entries * texel)?;
        grow(gpu, cmd, &mut self.parts, entries / u64::from(TILE) * 4)?;
        for tiles in new {
            let own = (tiles.start * TILE) as usize..(tiles.end * TILE) as usize;
            cmd.upload(&self.texels, own.start as u64 * texel, &texels.list[own])?;
            let bytes = tiles.len() as u64 * 4;
            cmd.fill(&self.parts, u64::from(tiles.start) * 4, bytes, PART_REST);
        }
        let bytes = entries * size_of::<Clearance>() as u64;
        grow(gpu, cmd, &mut self.clearances, bytes)?;
        self.texel_tiles = texels.list.len() as u32 / TILE;
        self.now.resize(self.texel_tiles as usize, [NONE; 2]);
        Ok(())
    }

    /// Says which tiles of texels are of the part [`PART_SEEN`]; the others are of the rest. What was sent before does not see it.
    pub(in crate::bake) fn divide(&self, cmd: &mut Commands, seen: &[bool]) -> Result<()> {
        let part = |seen: &bool| if *seen { PART_SEEN } else { PART_REST };
        let mut parts: Vec<u32> = seen.iter().map(part).collect();
        parts.resize(self.texel_tiles as usize, PART_REST);
        cmd.barrier(Stage::All, Stage::All);
        cmd.upload(&self.parts, 0, &parts)?;
        cmd.barrier(Stage::Transfer, Stage::All);
        Ok(())
    }

    /// Adds an instance of an object whose texels are the tiles `own`.
    pub(in crate::bake) fn add(
        &mut self,
        gpu: &Gpu,
        cmd: &mut Commands,
        instance: u32,
        transform: &glam::Affine3A,
        texels: &Texels,
        own: Range<u32>,
    ) -> Result<()> {
        let range = self.pool.take(own.len() as u32);
        self.make_room(gpu, cmd, instance)?;
        self.upload_placement(cmd, instance, transform)?;
        self.upload_clearances(cmd, texels, own.clone())?;
        cmd.barrier(Stage::Transfer, Stage::Compute);
        self.dispatch(cmd, own.clone(), range.start, instance);
        cmd.barrier(Stage::Compute, Stage::All);
        for (slot, tile) in range.clone().zip(own) {
            self.now[tile as usize] = [slot, instance];
        }
        self.taken.insert(instance, vec![range]);
        Ok(())
    }

    /// Puts other receivers in the place of those of some tiles of texels (ascending) that stand somewhere, with what stands
    /// near them now. `begin` names the instances, for one that tiles belonged to, and that may keep none: that of its old tiles
    /// from here on, and that of the new ones.
    pub(in crate::bake) fn replace(
        &mut self,
        gpu: &Gpu,
        cmd: &mut Commands,
        scene: &Scene,
        texels: &Texels,
        tiles: &[u32],
        begin: &mut dyn FnMut(u32, bool) -> [u32; 2],
    ) -> Result<()> {
        let mut owners = BTreeMap::<u32, Vec<u32>>::new();
        for &tile in tiles {
            let [_, instance] = self.now[tile as usize];
            owners.entry(instance).or_default().push(tile);
        }
        let mut entries = Vec::with_capacity(tiles.len());
        for (owner, tiles) in owners {
            let slot = |tile: &u32| self.now[*tile as usize][0];
            let mut old: Vec<u32> = tiles.iter().map(slot).collect();
            old.sort_unstable();
            let left = without(self.taken.get(&owner).map_or(&[], |own| own), &old);
            let [ended, instance] = begin(owner, left.is_empty());
            let range = self.pool.take(tiles.len() as u32);
            self.make_room(gpu, cmd, instance)?;
            let object = texels.list[tiles[0] as usize * Texel::TILE].object;
            self.upload_placement(cmd, instance, &scene.objects[object as usize].transform)?;
            for (&tile, new) in tiles.iter().zip(range.clone()) {
                let [old, _] = std::mem::replace(&mut self.now[tile as usize], [new, instance]);
                entries.push(Replaced {
                    tile,
                    old,
                    ended,
                    new,
                    instance,
                });
            }
            self.taken.insert(owner, left);
            let old = old.into_iter().map(|slot| slot..slot + 1).collect();
            self.taken.insert(ended, old);
            self.taken.insert(instance, vec![range]);
        }
        for run in tiles.chunk_by(|a, b| a + 1 == *b) {
            self.upload_clearances(cmd, texels, run[0]..run[run.len() - 1] + 1)?;
        }
        let bytes = std::mem::size_of_val(&entries[..]) as u64;
        grow(gpu, cmd, &mut self.replaced, bytes)?;
        cmd.upload(&self.replaced, 0, &entries)?;
        cmd.barrier(Stage::Transfer, Stage::Compute);
        cmd.scope("place", |cmd| {
            for (i, part) in (0..).zip(entries.chunks(STRIDE as usize)) {
                let bytes = i * u64::from(STRIDE) * size_of::<Replaced>() as u64;
                let push = Push {
                    replacing: 1,
                    replaced: self.replaced.address_at(bytes),
                    ..self.push()
                };
                cmd.dispatch(&self.pipeline, &push, [part.len() as u32 * TILE, 1, 1]);
            }
        });
        cmd.barrier(Stage::Compute, Stage::All);
        Ok(())
    }

    /// Gives back what the instances took: nothing on the device names them any more.
    pub(in crate::bake) fn remove(&mut self, cmd: &mut Commands, instances: &[u32]) {
        let taken = instances.iter().filter_map(|i| self.taken.remove(i));
        let free: Vec<Range<u32>> = taken.flatten().collect();
        for range in &free {
            self.pool.give(range.clone());
        }
        vacate(cmd, &self.tiles, size_of::<Tile>(), free, NONE);
    }

    /// Makes room for all receivers, and for the placement of `instance`.
    fn make_room(&mut self, gpu: &Gpu, cmd: &mut Commands, instance: u32) -> Result<()> {
        let end = u64::from(self.pool.end());
        let receivers = end * u64::from(TILE) * size_of::<Receiver>() as u64;
        grow(gpu, cmd, &mut self.receivers, receivers)?;
        grow(gpu, cmd, &mut self.tiles, end * size_of::<Tile>() as u64)?;
        let placements = u64::from(instance + 1) * size_of::<Placement>() as u64;
        grow(gpu, cmd, &mut self.placements, placements)?;
        Ok(())
    }

    fn upload_placement(
        &self,
        cmd: &mut Commands,
        instance: u32,
        transform: &glam::Affine3A,
    ) -> Result<()> {
        let offset = u64::from(instance) * size_of::<Placement>() as u64;
        cmd.upload(&self.placements, offset, &[placement(transform)])
    }

    /// Sends what stands near some tiles of texels.
    fn upload_clearances(
        &self,
        cmd: &mut Commands,
        texels: &Texels,
        tiles: Range<u32>,
    ) -> Result<()> {
        let entries = (tiles.start * TILE) as usize..(tiles.end * TILE) as usize;
        let offset = entries.start as u64 * size_of::<Clearance>() as u64;
        cmd.upload(&self.clearances, offset, &texels.clearances_of(entries))
    }

    fn dispatch(&self, cmd: &mut Commands, texels: Range<u32>, first: u32, instance: u32) {
        cmd.scope("place", |cmd| {
            for done in (0..texels.len() as u32).step_by(STRIDE as usize) {
                let push = Push {
                    first_texels: texels.start + done,
                    first_receivers: first + done,
                    instance,
                    ..self.push()
                };
                let tiles = STRIDE.min(texels.len() as u32 - done);
                cmd.dispatch(&self.pipeline, &push, [tiles * TILE, 1, 1]);
            }
        });
    }

    fn push(&self) -> Push {
        Push {
            texels: self.texels.address(),
            clearances: self.clearances.address(),
            placements: self.placements.address(),
            receivers: self.receivers.address(),
            tiles: self.tiles.address(),
            first_texels: 0,
            first_receivers: 0,
            instance: NONE,
            replacing: 0,
            replaced: self.replaced.address(),
        }
    }
}

/// Ranges without some of their slots (ascending).
fn without(ranges: &[Range<u32>], slots: &[u32]) -> Vec<Range<u32>> {
    let mut left = Vec::new();
    for range in ranges {
        let mut start = range.start;
        let from = slots.partition_point(|s| *s < range.start);
        for &slot in slots[from..].iter().take_while(|s| **s < range.end) {
            left.push(start..slot);
            start = slot + 1;
        }
        left.push(start..range.end);
    }
    left.retain(|range| !range.is_empty());
    left
}

/// Rows of the transform, and of its inverse transpose: that carries front normals to front normals, mirrored or not.
fn placement(transform: &glam::Affine3A) -> Placement {
    let rows = transform.matrix3.transpose();
    let t = transform.translation;
    // The inverse transpose, given by its rows: the columns of the inverse.
    let normals = transform.matrix3.inverse();
    Placement {
        row: [
            [rows.x_axis.x, rows.x_axis.y, rows.x_axis.z, t.x],
            [rows.y_axis.x, rows.y_axis.y, rows.y_axis.z, t.y],
            [rows.z_axis.x, rows.z_axis.y, rows.z_axis.z, t.z],
        ],
        normal_row: [
            normals.x_axis.to_array(),
            normals.y_axis.to_array(),
            normals.z_axis.to_array(),
        ],
    }
}

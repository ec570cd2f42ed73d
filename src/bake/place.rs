//! Puts object-space texels into the world: receivers of every instance, and the box and normal cone of every tile.

use std::collections::BTreeMap;
use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use super::pool::{Pool, grow};
use super::records::{Placement, Receiver, Tile};
use super::shaders;
use super::shared::{NONE, TILE};
use crate::gpu::{Address, Buffer, Commands, Gpu, Memory, Pipeline, Result, Stage};
use crate::lightmap::{Clearance, Texel};
use crate::lightmap::texels::Texels;
use crate::scene::Scene;

/// Receivers in world space and their tiles, on the device.
pub struct Receivers {
    pub(super) receivers: Buffer,
    pub(super) tiles: Buffer,
    texels: Buffer,
    clearances: Buffer,
    placements: Buffer,
    pipeline: Pipeline,
    pool: Pool,
    /// By instance.
    taken: BTreeMap<u32, Range<u32>>,
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
        let mut clearances = texels.clearances.clone();
        clearances.resize(texels.list.len(), Clearance::OPEN);
        let (receiver, tile) = (size_of::<Receiver>() as u64, size_of::<Tile>() as u64);
        let mut pool = Pool::default();
        pool.take(tiles);
        let taken: BTreeMap<u32, Range<u32>> = (0..)
            .zip(texels.tiles.iter().cloned())
            .zip(standing)
            .filter_map(|(taken, stands)| stands.then_some(taken))
            .collect();
        let out = Self {
            receivers: gpu.buffer(
                "receivers",
                texels.list.len() as u64 * receiver,
                Memory::Device,
            )?,
            tiles: gpu.buffer("tiles", u64::from(tiles) * tile, Memory::Device)?,
            texels: gpu.buffer_with("texels", &texels.list)?,
            clearances: gpu.buffer_with("clearances", &clearances)?,
            placements: gpu.buffer_with("placements", &placements)?,
            pipeline: gpu.pipeline(shaders::PLACE, &[])?,
            pool,
            taken,
            texel_tiles: tiles,
        };
        let mut cmd = gpu.commands()?;
        // Tiles of objects that are nowhere are no instance's.
        cmd.fill(&out.tiles, 0, out.tiles.size() & !3, NONE);
        cmd.barrier(Stage::Transfer, Stage::Compute);
        let ranges: Vec<&Range<u32>> = out.taken.values().filter(|r| !r.is_empty()).collect();
        for run in ranges.chunk_by(|a, b| a.end == b.start) {
            let range = run[0].start..run[run.len() - 1].end;
            out.dispatch(&mut cmd, range.clone(), range.start, NONE);
        }
        cmd.barrier(Stage::Compute, Stage::Compute);
        cmd.submit()?.wait()?;
        Ok(out)
    }

    /// Tiles of receivers to go through; some may be no instance's.
    pub(super) fn count(&self) -> u32 {
        self.pool.end()
    }

    /// Tiles of texels, and of sums.
    pub(super) fn texel_tiles(&self) -> u32 {
        self.texel_tiles
    }

    /// Appends tiles of texels.
    pub(super) fn append(&mut self, gpu: &Gpu, cmd: &mut Commands, texels: &[Texel]) -> Result<()> {
        let before = u64::from(self.texel_tiles * TILE) * size_of::<Texel>() as u64;
        let bytes = std::mem::size_of_val(texels) as u64;
        grow(gpu, cmd, &mut self.texels, before + bytes)?;
        cmd.upload(&self.texels, before, texels)?;
        self.texel_tiles += texels.len() as u32 / TILE;
        Ok(())
    }

    /// Adds an instance of an object whose texels are the tiles `texels`.
    pub(super) fn add(
        &mut self,
        gpu: &Gpu,
        cmd: &mut Commands,
        instance: u32,
        transform: &glam::Affine3A,
        texels: Range<u32>,
    ) -> Result<()> {
        let range = self.pool.take(texels.len() as u32);
        let end = u64::from(self.pool.end());
        let stride = size_of::<Placement>() as u64;
        grow(
            gpu,
            cmd,
            &mut self.receivers,
            end * u64::from(TILE) * size_of::<Receiver>() as u64,
        )?;
        grow(gpu, cmd, &mut self.tiles, end * size_of::<Tile>() as u64)?;
        grow(
            gpu,
            cmd,
            &mut self.placements,
            u64::from(instance + 1) * stride,
        )?;
        cmd.upload(
            &self.placements,
            u64::from(instance) * stride,
            &[placement(transform)],
        )?;
        cmd.barrier(Stage::Transfer, Stage::Compute);
        self.dispatch(cmd, texels, range.start, instance);
        cmd.barrier(Stage::Compute, Stage::All);
        self.taken.insert(instance, range);
        Ok(())
    }

    /// Gives back what the instances took.
    pub(super) fn remove(&mut self, instances: &[u32]) {
        for instance in instances {
            if let Some(range) = self.taken.remove(instance) {
                self.pool.give(range);
            }
        }
    }

    fn dispatch(&self, cmd: &mut Commands, texels: Range<u32>, first: u32, instance: u32) {
        cmd.scope("place", |cmd| {
            for done in (0..texels.len() as u32).step_by(STRIDE as usize) {
                let push = Push {
                    texels: self.texels.address(),
                    clearances: self.clearances.address(),
                    placements: self.placements.address(),
                    receivers: self.receivers.address(),
                    tiles: self.tiles.address(),
                    first_texels: texels.start + done,
                    first_receivers: first + done,
                    instance,
                };
                let tiles = STRIDE.min(texels.len() as u32 - done);
                cmd.dispatch(&self.pipeline, &push, [tiles * TILE, 1, 1]);
            }
        });
    }
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

//! Puts object-space texels into the world: receivers, and the box and normal cone of every tile.

use bytemuck::{Pod, Zeroable};

use super::records::{Placement, Receiver, Tile};
use super::shaders;
use super::shared::TILE;
use crate::gpu::{Address, Buffer, Gpu, Memory, Result, Stage};
use crate::lightmap::Texel;
use crate::scene::Scene;

/// Receivers in world space and their tiles, on the device.
pub struct Receivers {
    pub(super) receivers: Buffer,
    pub(super) tiles: Buffer,
    pub(super) tile_count: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    texels: Address,
    placements: Address,
    receivers: Address,
    tiles: Address,
    first_tile: u32,
}

/// Workgroups per dispatch, below the guaranteed limit.
const STRIDE: u32 = 1 << 15;

impl Receivers {
    /// `texels`: whole tiles, as [`crate::lightmap::texels`] lists them.
    pub fn new(gpu: &Gpu, scene: &Scene, texels: &[Texel]) -> Result<Self> {
        let tile_count = texels.len() as u32 / TILE;
        let placements: Vec<Placement> = scene
            .objects
            .iter()
            .map(|o| placement(&o.transform))
            .collect();
        let pipeline = gpu.pipeline(shaders::PLACE, &[])?;
        let texel_buffer = gpu.buffer_with("texels", texels)?;
        let placement_buffer = gpu.buffer_with("placements", &placements)?;
        let out = Self {
            receivers: gpu.buffer(
                "receivers",
                texels.len() as u64 * size_of::<Receiver>() as u64,
                Memory::Device,
            )?,
            tiles: gpu.buffer(
                "tiles",
                u64::from(tile_count) * size_of::<Tile>() as u64,
                Memory::Device,
            )?,
            tile_count,
        };
        let mut cmd = gpu.commands()?;
        cmd.barrier(Stage::Transfer, Stage::Compute);
        cmd.scope("place", |cmd| {
            for first_tile in (0..tile_count).step_by(STRIDE as usize) {
                let push = Push {
                    texels: texel_buffer.address(),
                    placements: placement_buffer.address(),
                    receivers: out.receivers.address(),
                    tiles: out.tiles.address(),
                    first_tile,
                };
                cmd.dispatch(
                    &pipeline,
                    &push,
                    [STRIDE.min(tile_count - first_tile) * TILE, 1, 1],
                );
            }
        });
        cmd.barrier(Stage::Compute, Stage::Compute);
        cmd.submit()?.wait()?;
        Ok(out)
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

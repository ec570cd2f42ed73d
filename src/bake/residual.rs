//! How far the map is from another state of itself: the curve of a convergence.

use bytemuck::{Pod, Zeroable};

use super::accumulate::AccumulatePass;
use super::shaders;
use crate::gpu::{Address, Buffer, Gpu, Memory, Pipeline, Result, Stage};

/// A state of the sums, kept on the device to compare with.
pub(super) struct Residual {
    target: Buffer,
    residuals: Buffer,
    pipeline: Pipeline,
    tiles: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    sums: Address,
    target: Address,
    residuals: Address,
    tile_count: u32,
    unit: f32,
}

impl Residual {
    /// Keeps what the sums are now, of `tiles` tiles.
    pub(super) fn new(gpu: &Gpu, pass: &AccumulatePass, tiles: u32) -> Result<Self> {
        let size = pass.sums().size();
        let target = gpu.buffer("converged sums", size, Memory::Device)?;
        let mut cmd = gpu.commands()?;
        cmd.barrier(Stage::All, Stage::All);
        cmd.copy(pass.sums(), 0, &target, 0, size);
        cmd.barrier(Stage::Transfer, Stage::All);
        cmd.submit()?.wait()?;
        Ok(Self {
            target,
            residuals: gpu.buffer("residuals", u64::from(tiles) * 4, Memory::Device)?,
            pipeline: gpu.pipeline(shaders::RESIDUAL, &[])?,
            tiles,
        })
    }

    /// Per tile, the sum of squared differences over its 192 values, lux².
    pub(super) fn measure(&self, gpu: &Gpu, pass: &AccumulatePass) -> Result<Vec<f32>> {
        let mut cmd = gpu.commands()?;
        cmd.barrier(Stage::All, Stage::Compute);
        cmd.scope("residual", |cmd| {
            let push = Push {
                sums: pass.sums().address(),
                target: self.target.address(),
                residuals: self.residuals.address(),
                tile_count: self.tiles,
                unit: 1.0 / pass.scale(),
            };
            cmd.dispatch(&self.pipeline, &push, [self.tiles, 1, 1]);
        });
        cmd.submit()?.wait()?;
        self.residuals.read(0..self.tiles as usize)
    }

    /// Makes the sums what they were when this was made.
    pub(super) fn restore(self, gpu: &Gpu, pass: &AccumulatePass) -> Result<()> {
        let mut cmd = gpu.commands()?;
        cmd.barrier(Stage::All, Stage::All);
        cmd.copy(&self.target, 0, pass.sums(), 0, self.target.size());
        cmd.barrier(Stage::Transfer, Stage::All);
        cmd.submit()?.wait()
    }
}

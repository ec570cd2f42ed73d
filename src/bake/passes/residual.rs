//! How far the map is from another state of itself: the curve of a convergence.

use bytemuck::{Pod, Zeroable};

use super::accumulate::AccumulatePass;
use crate::bake::device::shaders;
use crate::gpu::{Address, Buffer, Gpu, Memory, Pipeline, Result, Stage};

/// A state of the sums, kept on the device to compare with.
pub(in crate::bake) struct Residual {
    target: Buffer,
    first: Option<Buffer>,
    weights: Buffer,
    residuals: Buffer,
    pipeline: Pipeline,
    tiles: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    sums: Address,
    target: Address,
    first: Address,
    weights: Address,
    residuals: Address,
    tile_count: u32,
    unit: f32,
}

impl Residual {
    /// Keeps what the sums are now, of `tiles` tiles. `first`: what they were once, else what they are now. `weights`: by texel.
    pub(in crate::bake) fn new(
        gpu: &Gpu,
        pass: &AccumulatePass,
        tiles: u32,
        first: Option<&[i64]>,
        weights: &[f32],
    ) -> Result<Self> {
        let size = pass.sums().size();
        let target = gpu.buffer("converged sums", size, Memory::Device)?;
        let mut cmd = gpu.commands()?;
        cmd.barrier(Stage::All, Stage::All);
        cmd.copy(pass.sums(), 0, &target, 0, size);
        cmd.barrier(Stage::Transfer, Stage::All);
        cmd.submit()?.wait()?;
        let bytes = std::mem::size_of_val(weights) as u64;
        let kept = gpu.buffer("viewport weights", bytes, Memory::Device)?;
        kept.write(0, weights)?;
        let first = first.map(|sums| gpu.buffer_with("first sums", sums));
        Ok(Self {
            target,
            first: first.transpose()?,
            weights: kept,
            residuals: gpu.buffer("residuals", u64::from(tiles) * 16, Memory::Device)?,
            pipeline: gpu.pipeline(shaders::RESIDUAL, &[])?,
            tiles,
        })
    }

    /// Per tile, the sum of squared differences over its 192 values, lux², the same by weight, the sum of the values, lux, and how
    /// far one is at most outside of what lies between the first sums and the kept ones, lux.
    pub(in crate::bake) fn measure(
        &self,
        gpu: &Gpu,
        pass: &AccumulatePass,
    ) -> Result<Vec<[f32; 4]>> {
        let mut cmd = gpu.commands()?;
        cmd.barrier(Stage::All, Stage::Compute);
        cmd.scope("residual", |cmd| {
            let push = Push {
                sums: pass.sums().address(),
                target: self.target.address(),
                first: self.first.as_ref().unwrap_or(&self.target).address(),
                weights: self.weights.address(),
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
    pub(in crate::bake) fn restore(self, gpu: &Gpu, pass: &AccumulatePass) -> Result<()> {
        let mut cmd = gpu.commands()?;
        cmd.barrier(Stage::All, Stage::All);
        cmd.copy(&self.target, 0, pass.sums(), 0, self.target.size());
        cmd.barrier(Stage::Transfer, Stage::All);
        cmd.submit()?.wait()
    }
}

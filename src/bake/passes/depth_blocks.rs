//! What hides, block by block, in depth maps as they are drawn so far.

use bytemuck::{Pod, Zeroable};

use super::shadow::MAX_VIEWS;
use super::shadow_groups::Uploaded;
use crate::bake::device::shaders;
use crate::bake::device::shared::VIEW_BLOCKS;
use crate::gpu::{Address, Buffer, Commands, Gpu, Memory, Pipeline, Result, Stage};

/// The pass, and what it finds.
pub(super) struct BlockPass {
    /// For views without limits, and with.
    pipelines: [Pipeline; 2],
    blocks: Buffer,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    views: Address,
    depth: Address,
    blocks: Address,
}

impl BlockPass {
    pub(super) fn new(gpu: &Gpu) -> Result<Self> {
        let pipeline = |limited| gpu.pipeline(shaders::DEPTH_BLOCKS, &[limited]);
        let bytes = MAX_VIEWS * u64::from(VIEW_BLOCKS) * 4;
        Ok(Self {
            pipelines: [pipeline(0)?, pipeline(1)?],
            blocks: gpu.buffer("shadow blocks", bytes, Memory::Device)?,
        })
    }

    /// Finds it in all maps of the views at `depth`.
    pub(super) fn record(&self, cmd: &mut Commands, views: &Uploaded, depth: Address) {
        cmd.barrier(Stage::Compute, Stage::Compute);
        cmd.scope("depth blocks", |cmd| {
            let push = Push {
                views: views.at,
                depth,
                blocks: self.blocks.address(),
            };
            let pipeline = &self.pipelines[usize::from(views.limited)];
            cmd.dispatch(pipeline, &push, [VIEW_BLOCKS, views.count, 1]);
        });
        cmd.barrier(Stage::All, Stage::All);
    }

    /// What was found last.
    pub(super) fn found(&self) -> Address {
        self.blocks.address()
    }
}

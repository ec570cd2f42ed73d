//! What hides, block by block, in depth maps as they are drawn so far.

use bytemuck::{Pod, Zeroable};

use super::shadow_groups::Uploaded;
use crate::bake::device::shaders;
use crate::bake::device::shared::{BLOCKS, VIEW_BLOCKS};
use crate::gpu::{Address, Commands, Gpu, Pipeline, Result, Stage};

/// The pass.
pub(super) struct BlockPass {
    /// For views without limits, and with.
    pipelines: [Pipeline; 2],
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    views: Address,
}

impl BlockPass {
    pub(super) fn new(gpu: &Gpu) -> Result<Self> {
        let pipeline = |limited| gpu.pipeline(shaders::DEPTH_BLOCKS, &[limited]);
        Ok(Self {
            pipelines: [pipeline(0)?, pipeline(1)?],
        })
    }

    /// Finds it in the maps of all views that are drawn into.
    pub(super) fn record(&self, cmd: &mut Commands, views: &Uploaded) {
        cmd.barrier(Stage::Compute, Stage::Compute);
        cmd.scope("depth blocks", |cmd| {
            let push = Push { views: views.at };
            let pipeline = &self.pipelines[usize::from(views.limited)];
            cmd.dispatch(pipeline, &push, [2 * VIEW_BLOCKS / BLOCKS, views.count, 1]);
        });
        cmd.barrier(Stage::All, Stage::All);
    }
}

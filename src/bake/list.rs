//! Lists that one pass appends to and the next is dispatched over, without the host in between.

use bytemuck::{Pod, Zeroable};

use super::records::ListHead;
use super::shaders;
use crate::gpu::{Address, Buffer, Commands, Gpu, Memory, Pipeline, Result, Stage};

/// Heads of several lists, and the pass that turns their lengths into workgroup counts.
pub(super) struct Heads {
    buffer: Buffer,
    count: u32,
    pipeline: Pipeline,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    heads: Address,
    count: u32,
}

impl Heads {
    pub(super) fn new(gpu: &Gpu, name: &str, count: u32) -> Result<Self> {
        Ok(Self {
            buffer: gpu.buffer(
                name,
                u64::from(count) * size_of::<ListHead>() as u64,
                Memory::Device,
            )?,
            count,
            pipeline: gpu.pipeline(shaders::LIST_ARGS, &[])?,
        })
    }

    pub(super) fn address(&self, list: u32) -> Address {
        self.buffer
            .address_at(u64::from(list) * size_of::<ListHead>() as u64)
    }

    /// Empties every list.
    pub(super) fn clear(&self, cmd: &mut Commands) {
        cmd.fill(&self.buffer, 0, self.buffer.size() & !3, 0);
    }

    /// After the appending pass: makes the lists ready for [`Heads::dispatch`].
    pub(super) fn finish(&self, cmd: &mut Commands) {
        cmd.barrier(Stage::Compute, Stage::Compute);
        let push = Push {
            heads: self.buffer.address(),
            count: self.count,
        };
        cmd.dispatch(&self.pipeline, &push, [self.count, 1, 1]);
        cmd.barrier(Stage::Compute, Stage::Indirect);
    }

    /// One workgroup for each entry of `list`.
    pub(super) fn dispatch<P: Pod>(
        &self,
        cmd: &mut Commands,
        pipeline: &Pipeline,
        push: &P,
        list: u32,
    ) {
        cmd.dispatch_indirect(
            pipeline,
            push,
            &self.buffer,
            u64::from(list) * size_of::<ListHead>() as u64,
        );
    }
}

//! Lists that one pass appends to and the next is dispatched over, without the host in between.

use bytemuck::{Pod, Zeroable};

use super::records::ListHead;
use super::shaders;
use crate::gpu::{Address, Buffer, Commands, Gpu, Memory, Pipeline, Result, Stage};

/// Heads of several lists, and the pass that turns their lengths into workgroup counts.
pub(in crate::bake) struct Heads {
    buffer: Buffer,
    /// Of each list, entries and what they hold, over all batches.
    totals: Buffer,
    count: u32,
    pipeline: Pipeline,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    heads: Address,
    totals: Address,
    count: u32,
    counted: u32,
}

impl Heads {
    pub(in crate::bake) fn new(gpu: &Gpu, name: &str, count: u32) -> Result<Self> {
        Ok(Self {
            buffer: gpu.buffer(
                name,
                u64::from(count) * size_of::<ListHead>() as u64,
                Memory::Device,
            )?,
            totals: gpu.buffer_with(&format!("{name}, totals"), &vec![0u64; 2 * count as usize])?,
            count,
            pipeline: gpu.pipeline(shaders::LIST_ARGS, &[])?,
        })
    }

    pub(in crate::bake) fn address(&self, list: u32) -> Address {
        self.buffer
            .address_at(u64::from(list) * size_of::<ListHead>() as u64)
    }

    /// Empties every list.
    pub(in crate::bake) fn clear(&self, cmd: &mut Commands) {
        cmd.fill(&self.buffer, 0, self.buffer.size() & !3, 0);
    }

    /// After the appending pass: makes the lists ready for [`Heads::dispatch`], and adds those of `counted` to the totals.
    pub(in crate::bake) fn finish(&self, cmd: &mut Commands, counted: &[u32]) {
        cmd.barrier(Stage::Compute, Stage::Compute);
        let push = Push {
            heads: self.buffer.address(),
            totals: self.totals.address(),
            count: self.count,
            counted: counted.iter().fold(0, |bits, list| bits | 1 << list),
        };
        cmd.dispatch(&self.pipeline, &push, [self.count, 1, 1]);
        cmd.barrier(Stage::Compute, Stage::Indirect);
    }

    /// Waits, then reads how many entries each list had and what they held, as counted so far.
    pub(in crate::bake) fn totals(&self) -> Result<Vec<[u64; 2]>> {
        self.totals.read(0..self.count as usize)
    }

    /// One workgroup for each entry of `list`.
    pub(in crate::bake) fn dispatch<P: Pod>(
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

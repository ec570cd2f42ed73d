//! Groups of chunks that views see, before their chunks are looked at: of what stands in both versions of a light, and of what one
//! of them has alone.

use bytemuck::{Pod, Zeroable};

use crate::bake::device::list::Heads;
use crate::bake::device::pool::renew;
use crate::bake::device::shaders;
use crate::bake::world::occluders::Occluders;
use crate::gpu::{Address, Buffer, Commands, Gpu, Memory, Pipeline, Result, Stage};

/// The pass, and its lists.
pub(super) struct GroupPass {
    /// For views without limits, and with.
    pipelines: [Pipeline; 2],
    /// Groups of an invocation.
    each: u32,
    heads: Heads,
    /// Of whole triangles and of masked ones: the groups that stand in both of a light's versions, in one.
    lists: [[Buffer; 2]; 2],
}

/// Where a group stands: in both of a light's versions, or in one alone.
#[derive(Clone, Copy)]
pub(super) enum Standing {
    Both,
    Own,
}

/// Views on the device.
pub(super) struct Uploaded {
    pub at: Address,
    pub count: u32,
    /// Some may have limits.
    pub limited: bool,
    /// The table that says what stands in a view's version.
    pub instances: Address,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    groups: Address,
    instances: Address,
    views: Address,
    both: Address,
    both_head: Address,
    own: Address,
    own_head: Address,
    group_count: u32,
}

impl GroupPass {
    pub(super) fn new(gpu: &Gpu) -> Result<Self> {
        // On lavapipe every invocation reads the view by itself.
        let each = if gpu.info().kind == "CPU" { 8 } else { 1 };
        let pipeline = |limited| gpu.pipeline(shaders::SHADOW_GROUPS, &[limited, each]);
        let list = || gpu.buffer("shadow groups", 16, Memory::Device);
        Ok(Self {
            pipelines: [pipeline(0)?, pipeline(1)?],
            each,
            heads: Heads::new(gpu, "shadow group lists", 4)?,
            lists: [[list()?, list()?], [list()?, list()?]],
        })
    }

    /// Lists the groups that the views see.
    pub(super) fn record(
        &mut self,
        gpu: &Gpu,
        cmd: &mut Commands,
        occluders: &Occluders,
        views: &Uploaded,
    ) -> Result<()> {
        let all = [&occluders.whole, &occluders.masked];
        for (lists, chunks) in self.lists.iter_mut().zip(all) {
            for list in lists {
                let entries = u64::from(chunks.group_count()) * u64::from(views.count);
                renew(gpu, list, entries * 8)?;
            }
        }
        self.heads.clear(cmd);
        cmd.barrier(Stage::Transfer, Stage::Compute);
        cmd.scope("shadow groups", |cmd| {
            for (kind, chunks) in all.into_iter().enumerate() {
                let [both, own] = [0, 1].map(|list| self.lists[kind][list].address());
                let push = Push {
                    groups: chunks.groups.address(),
                    instances: views.instances,
                    views: views.at,
                    both,
                    both_head: self.heads.address(head(kind, Standing::Both)),
                    own,
                    own_head: self.heads.address(head(kind, Standing::Own)),
                    group_count: chunks.group_count(),
                };
                let pipeline = &self.pipelines[usize::from(views.limited)];
                let threads = chunks.group_count().div_ceil(self.each);
                cmd.dispatch(pipeline, &push, [threads, views.count, 1]);
            }
            self.heads.finish(cmd, &[]);
        });
        Ok(())
    }

    /// The list of a kind of triangle, and its head.
    pub(super) fn list(&self, kind: usize, standing: Standing) -> [Address; 2] {
        let list = self.lists[kind][standing as usize].address();
        [list, self.heads.address(head(kind, standing))]
    }

    /// One workgroup for each entry of it.
    pub(super) fn dispatch<P: Pod>(
        &self,
        cmd: &mut Commands,
        pipeline: &Pipeline,
        push: &P,
        kind: usize,
        standing: Standing,
    ) {
        let list = head(kind, standing);
        self.heads.dispatch(cmd, pipeline, push, list);
    }
}

fn head(kind: usize, standing: Standing) -> u32 {
    2 * kind as u32 + standing as u32
}

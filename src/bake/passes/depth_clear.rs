//! Depth maps that are kept from one batch to another: fetched before others are drawn, and stored afterwards.

use bytemuck::{Pod, Zeroable};

use super::shadow::pixels;
use crate::bake::device::records::View;
use crate::bake::device::shaders;
use crate::bake::device::shared::KEPT_BESIDE;
use crate::gpu::{Address, Buffer, Commands, Gpu, Pipeline, Result, Stage};

/// Where the map of a view is kept.
pub(in crate::bake) struct KeptMap<'a> {
    /// Index of the view.
    pub view: u32,
    pub buffer: &'a Buffer,
    /// Bytes before it.
    pub at: u64,
}

impl KeptMap<'_> {
    /// Where the view's depths begin among those of all views, and how many they are, bytes.
    fn place(&self, views: &[View]) -> (u64, u64) {
        let view = &views[self.view as usize];
        (u64::from(view.offset) * 4, pixels(view) * 4)
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ClearPush {
    views: Address,
    depth: Address,
}

/// The pass that clears what is drawn anew.
pub(super) struct KeepPass {
    clear: Pipeline,
}

impl KeepPass {
    pub(super) fn new(gpu: &Gpu) -> Result<Self> {
        let clear = gpu.pipeline(shaders::DEPTH_CLEAR, &[])?;
        Ok(Self { clear })
    }

    /// Copies kept maps to `depth`, where they are looked up, and clears what of them is drawn anew. `at`: the views on the device.
    pub(super) fn fetch(
        &self,
        cmd: &mut Commands,
        (depth, at): (&Buffer, &Buffer),
        views: &[View],
        kept: &[KeptMap],
    ) {
        if kept.is_empty() {
            return;
        }
        cmd.barrier(Stage::Transfer, Stage::Transfer);
        cmd.scope("shadow fetch", |cmd| {
            for map in kept {
                let (to, bytes) = map.place(views);
                cmd.copy(map.buffer, map.at, depth, to, bytes);
            }
            if views.iter().any(|v| v.kept == KEPT_BESIDE) {
                cmd.barrier(Stage::Transfer, Stage::Compute);
                let most = views.iter().map(pixels).max().unwrap_or(0) as u32;
                let push = ClearPush {
                    views: at.address(),
                    depth: depth.address(),
                };
                cmd.dispatch(&self.clear, &push, [most, views.len() as u32, 1]);
                cmd.barrier(Stage::Compute, Stage::Compute);
            }
        });
    }

    /// Copies maps of `depth` to where they are kept.
    pub(super) fn store(cmd: &mut Commands, depth: &Buffer, views: &[View], maps: &[KeptMap]) {
        if maps.is_empty() {
            return;
        }
        cmd.barrier(Stage::All, Stage::Transfer);
        cmd.scope("shadow keep", |cmd| {
            for map in maps {
                let (from, bytes) = map.place(views);
                cmd.copy(depth, from, map.buffer, map.at, bytes);
            }
        });
    }
}

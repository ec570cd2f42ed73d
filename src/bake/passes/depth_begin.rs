//! What depth maps begin with before anything is drawn into them: nothing, or what another version's map shows.

use bytemuck::{Pod, Zeroable};

use crate::bake::device::records::View;
use crate::bake::device::shaders;
use crate::bake::device::shared::KEPT_BESIDE;
use crate::gpu::{Address, Buffer, Commands, Gpu, Pipeline, Result, Stage};

/// Where a view's map is.
#[derive(Clone, Copy)]
pub(in crate::bake) struct Place<'a> {
    pub buffer: &'a Buffer,
    /// Bytes before it.
    pub at: u64,
}

/// The pass.
pub(super) struct BeginPass {
    clear: Pipeline,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ClearPush {
    views: Address,
}

impl BeginPass {
    pub(super) fn new(gpu: &Gpu) -> Result<Self> {
        let clear = gpu.pipeline(shaders::DEPTH_BEGIN, &[])?;
        Ok(Self { clear })
    }

    /// For the views that do not borrow: `at`, all of them on the device. Their maps can be drawn into afterwards.
    pub(super) fn record(&self, cmd: &mut Commands, views: &[View], places: &[Place], at: Address) {
        cmd.scope("shadow begin", |cmd| {
            for (view, place) in views.iter().zip(places).filter(|(v, _)| v.begins_empty()) {
                cmd.fill(place.buffer, place.at, view.bytes(), 0);
            }
            copy(cmd, views, places, |view| view.base > 0);
            cmd.barrier(Stage::Transfer, Stage::Compute);
            let cleared = views.iter().filter(|v| v.kept == KEPT_BESIDE);
            if let Some(size) = cleared.map(|v| v.size).max() {
                let threads = [3 * size, views.len() as u32, 1];
                cmd.dispatch(&self.clear, &ClearPush { views: at }, threads);
                cmd.barrier(Stage::Compute, Stage::Compute);
            }
        });
    }

    /// For those that borrow: once what stands in both versions is drawn in the views that they borrow from.
    pub(super) fn lend(cmd: &mut Commands, views: &[View], places: &[Place]) {
        if views.iter().all(|v| v.base >= 0) {
            return;
        }
        cmd.barrier(Stage::Compute, Stage::Transfer);
        cmd.scope("shadow lend", |cmd| {
            copy(cmd, views, places, |view| view.base < 0)
        });
        cmd.barrier(Stage::Transfer, Stage::Compute);
    }
}

/// Copies to some of the views what they begin with.
fn copy(cmd: &mut Commands, views: &[View], places: &[Place], which: impl Fn(&View) -> bool) {
    for (index, (view, to)) in views.iter().zip(places).enumerate() {
        if which(view) {
            let from = &places[index.wrapping_add_signed(view.base as isize)];
            cmd.copy(from.buffer, from.at, to.buffer, to.at, view.bytes());
        }
    }
}

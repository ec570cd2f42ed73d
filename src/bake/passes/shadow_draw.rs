//! Draws triangles of one kind, whole ones or those with cutouts, into depth maps: small ones each by an invocation, and what is too
//! large for that in a second pass by rows.

use bytemuck::{Pod, Zeroable};

use super::shadow::MAX_VIEWS;
use crate::bake::device::list::Heads;
use crate::bake::device::pool::renew;
use crate::bake::device::shaders;
use crate::bake::device::shared::CHUNK;
use crate::bake::world::occluders::{Chunks, Occluders};
use crate::gpu::{Address, Buffer, Commands, Gpu, Memory, Pipeline, Result};

/// Entries of the list of large triangles; what does not fit is drawn, more slowly, by the pass for small ones.
const LARGE_CAPACITY: u32 = 1 << 20;
/// Pixels of a triangle's bounding rectangle up to which it counts as small.
const SMALL_PIXELS: u32 = 96;
/// Lists of chunks and of large triangles, by the kind of triangle.
pub(super) const CHUNKS: [u32; 2] = [0, 1];
pub(super) const LARGE: [u32; 2] = [2, 3];

/// The passes and lists for one kind of triangle; made when the first one comes.
pub(super) struct Drawing {
    /// 0: whole triangles; 1: masked ones.
    kind: usize,
    made: Option<Made>,
}

pub(super) struct Made {
    /// For views without limits, and with.
    small: [Pipeline; 2],
    large: [Pipeline; 2],
    /// Chunks that views see.
    pub list: Buffer,
    large_list: Buffer,
}

/// A kind of triangle of which there are some, with room for what views see of them.
pub(super) struct Ready<'a> {
    pub kind: usize,
    pub made: &'a Made,
    pub chunks: &'a Chunks,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct SmallPush {
    chunks: Address,
    list: Address,
    head: Address,
    both: LargePush,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct LargePush {
    triangles: Address,
    views: Address,
    large: Address,
    large_head: Address,
    cutouts: Address,
    bits: Address,
    large_capacity: u32,
}

impl Drawing {
    pub(super) fn new(kind: usize) -> Self {
        Self { kind, made: None }
    }

    /// Ready to draw from among `chunks`.
    pub(super) fn ready<'a>(&'a mut self, gpu: &Gpu, chunks: &'a Chunks) -> Result<Ready<'a>> {
        let entries = u64::from(chunks.count()) * 5 * MAX_VIEWS * 8;
        let mut made = match self.made.take() {
            Some(made) => made,
            None => Made::new(gpu, self.kind, entries)?,
        };
        renew(gpu, &mut made.list, entries)?;
        Ok(Ready {
            kind: self.kind,
            made: self.made.insert(made),
            chunks,
        })
    }
}

impl Made {
    fn new(gpu: &Gpu, kind: usize, entries: u64) -> Result<Self> {
        // A SIMD register of lavapipe, where every invocation reads a view by itself, so that several triangles share the
        // reading; elsewhere what runs together, and a triangle an invocation.
        let [lanes, small] = match gpu.info().kind {
            "CPU" => [8, 8],
            _ => [32, CHUNK],
        };
        let masked = kind as u32;
        let smalls = |limited| {
            let constants = [SMALL_PIXELS, masked, small, limited];
            gpu.pipeline(shaders::SHADOW_SMALL, &constants)
        };
        let larges = |limited| gpu.pipeline(shaders::SHADOW_LARGE, &[masked, lanes, limited]);
        let large_bytes = u64::from(LARGE_CAPACITY) * 8;
        Ok(Self {
            small: [smalls(0)?, smalls(1)?],
            large: [larges(0)?, larges(1)?],
            list: gpu.buffer("shadow chunks", entries, Memory::Device)?,
            large_list: gpu.buffer("shadow large triangles", large_bytes, Memory::Device)?,
        })
    }
}

/// What chunks are drawn into.
pub(super) struct Target<'a> {
    pub heads: &'a Heads,
    pub occluders: &'a Occluders,
    pub views: Address,
    /// 1 where some views have limits.
    pub limited: usize,
}

impl Ready<'_> {
    /// Draws the small triangles of the listed chunks, and lists the large ones.
    pub(super) fn small(&self, cmd: &mut Commands, target: &Target) {
        let (heads, list) = (target.heads, CHUNKS[self.kind]);
        let push = SmallPush {
            chunks: self.chunks.chunks.address(),
            list: self.made.list.address(),
            head: heads.address(list),
            both: self.both(target),
        };
        heads.dispatch(cmd, &self.made.small[target.limited], &push, list);
    }

    /// Draws the large triangles that were listed.
    pub(super) fn large(&self, cmd: &mut Commands, target: &Target) {
        let push = self.both(target);
        let pipeline = &self.made.large[target.limited];
        target
            .heads
            .dispatch(cmd, pipeline, &push, LARGE[self.kind]);
    }

    fn both(&self, target: &Target) -> LargePush {
        LargePush {
            triangles: self.chunks.triangles.address(),
            views: target.views,
            large: self.made.large_list.address(),
            large_head: target.heads.address(LARGE[self.kind]),
            cutouts: self.chunks.cutouts.address(),
            bits: target.occluders.bits.address(),
            large_capacity: LARGE_CAPACITY,
        }
    }
}

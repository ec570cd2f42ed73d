//! Depth maps of a batch of lights: cull chunks per face, draw small triangles, then large ones.

use bytemuck::{Pod, Zeroable};

use super::list::Heads;
use super::occluders::Occluders;
use super::records::View;
use super::shaders;
use super::shared::{BATCH, VIEW_HEMICUBE};
use crate::gpu::{Address, Buffer, Commands, Gpu, Memory, Pipeline, Result, Stage};

/// Entries of the list of large triangles; what does not fit is drawn, more slowly, by the pass for small ones.
const LARGE_CAPACITY: u32 = 1 << 20;
/// Pixels of a triangle's bounding rectangle up to which it counts as small.
const SMALL_PIXELS: u32 = 96;
/// Most views of a batch: points have two.
const MAX_VIEWS: u64 = 2 * BATCH as u64;

/// The shadow passes and their buffers.
pub(super) struct ShadowPass {
    cull: Pipeline,
    whole: Drawing,
    /// For triangles with cutouts, if there are any.
    masked: Option<Drawing>,
    heads: Heads,
    views: Buffer,
    depth: Buffer,
}

/// The passes and lists for one kind of triangle.
struct Drawing {
    small: Pipeline,
    large: Pipeline,
    list: Buffer,
    large_list: Buffer,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct CullPush {
    chunks: Address,
    views: Address,
    list: Address,
    masked_list: Address,
    head: Address,
    masked_head: Address,
    chunk_count: u32,
    first_masked: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct SmallPush {
    triangles: Address,
    chunks: Address,
    views: Address,
    list: Address,
    head: Address,
    large: Address,
    large_head: Address,
    depth: Address,
    cutouts: Address,
    bits: Address,
    large_capacity: u32,
    first_masked: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct LargePush {
    triangles: Address,
    views: Address,
    large: Address,
    large_head: Address,
    depth: Address,
    cutouts: Address,
    bits: Address,
    large_capacity: u32,
    first_masked: u32,
}

/// Lists, of whole triangles and of masked ones.
const CHUNKS: [u32; 2] = [0, 1];
const LARGE: [u32; 2] = [2, 3];

impl Drawing {
    fn new(gpu: &Gpu, masked: bool, chunks: u32) -> Result<Self> {
        // A SIMD register of lavapipe; elsewhere what runs together.
        let lanes = if gpu.info().kind == "CPU" { 8 } else { 32 };
        let large_bytes = u64::from(LARGE_CAPACITY) * 8;
        Ok(Self {
            small: gpu.pipeline(shaders::SHADOW_SMALL, &[SMALL_PIXELS, masked.into()])?,
            large: gpu.pipeline(shaders::SHADOW_LARGE, &[masked.into(), lanes])?,
            list: gpu.buffer(
                "shadow chunks",
                u64::from(chunks) * 5 * MAX_VIEWS * 8,
                Memory::Device,
            )?,
            large_list: gpu.buffer("shadow large triangles", large_bytes, Memory::Device)?,
        })
    }
}

impl ShadowPass {
    /// `depth_elements`: pixels that the depth maps of one batch may take together.
    pub(super) fn new(gpu: &Gpu, occluders: &Occluders, depth_elements: u64) -> Result<Self> {
        let whole = occluders.first_masked_chunk;
        let masked = occluders.chunk_count - whole;
        Ok(Self {
            cull: gpu.pipeline(shaders::SHADOW_CULL, &[])?,
            whole: Drawing::new(gpu, false, whole)?,
            masked: (masked > 0)
                .then(|| Drawing::new(gpu, true, masked))
                .transpose()?,
            heads: Heads::new(gpu, "shadow lists", 4)?,
            views: gpu.buffer(
                "shadow views",
                MAX_VIEWS * size_of::<View>() as u64,
                Memory::Device,
            )?,
            depth: gpu.buffer("shadow depth", depth_elements * 4, Memory::Device)?,
        })
    }

    pub(super) fn views(&self) -> Address {
        self.views.address()
    }

    /// Pixels that one batch's depth maps may take together.
    pub(super) fn elements(&self) -> u64 {
        self.depth.size() / 4
    }

    /// The first `elements` of the depth maps drawn last.
    pub(super) fn read_depth(&self, elements: usize) -> Result<Vec<f32>> {
        self.depth.read(0..elements)
    }

    pub(super) fn depth(&self) -> Address {
        self.depth.address()
    }

    /// Draws `views`; the maps can be read by compute shaders after the next barrier.
    pub(super) fn record(
        &self,
        cmd: &mut Commands,
        occluders: &Occluders,
        views: &[View],
    ) -> Result<()> {
        let elements: u64 = views
            .iter()
            .map(|v| {
                u64::from(v.size) * u64::from(v.size) * if v.kind == VIEW_HEMICUBE { 3 } else { 1 }
            })
            .sum();
        cmd.upload(&self.views, 0, views)?;
        cmd.fill(&self.depth, 0, elements * 4, 0);
        self.heads.clear(cmd);
        cmd.barrier(Stage::Transfer, Stage::Compute);
        let drawings = || std::iter::once(&self.whole).chain(&self.masked).zip(0..);
        cmd.scope("shadow cull", |cmd| {
            let masked = self.masked.as_ref().unwrap_or(&self.whole);
            let push = CullPush {
                chunks: occluders.chunks.address(),
                views: self.views.address(),
                list: self.whole.list.address(),
                masked_list: masked.list.address(),
                head: self.heads.address(CHUNKS[0]),
                masked_head: self.heads.address(CHUNKS[1]),
                chunk_count: occluders.chunk_count,
                first_masked: occluders.first_masked_chunk,
            };
            cmd.dispatch(
                &self.cull,
                &push,
                [occluders.chunk_count, views.len() as u32, 1],
            );
            self.heads.finish(cmd);
        });
        cmd.scope("shadow small", |cmd| {
            for (drawing, kind) in drawings() {
                let push = SmallPush {
                    triangles: occluders.triangles.address(),
                    chunks: occluders.chunks.address(),
                    views: self.views.address(),
                    list: drawing.list.address(),
                    head: self.heads.address(CHUNKS[kind]),
                    large: drawing.large_list.address(),
                    large_head: self.heads.address(LARGE[kind]),
                    depth: self.depth.address(),
                    cutouts: occluders.cutouts.address(),
                    bits: occluders.bits.address(),
                    large_capacity: LARGE_CAPACITY,
                    first_masked: occluders.first_masked_triangle,
                };
                self.heads
                    .dispatch(cmd, &drawing.small, &push, CHUNKS[kind]);
            }
            self.heads.finish(cmd);
        });
        cmd.scope("shadow large", |cmd| {
            for (drawing, kind) in drawings() {
                let push = LargePush {
                    triangles: occluders.triangles.address(),
                    views: self.views.address(),
                    large: drawing.large_list.address(),
                    large_head: self.heads.address(LARGE[kind]),
                    depth: self.depth.address(),
                    cutouts: occluders.cutouts.address(),
                    bits: occluders.bits.address(),
                    large_capacity: LARGE_CAPACITY,
                    first_masked: occluders.first_masked_triangle,
                };
                self.heads.dispatch(cmd, &drawing.large, &push, LARGE[kind]);
            }
        });
        Ok(())
    }
}

//! Depth maps of a batch of lights: cull chunks per face, draw what is left of them; first those chunks that hide much, then what
//! they do not hide.

use bytemuck::{Pod, Zeroable};

use super::depth_blocks::BlockPass;
use super::depth_clear::KeepPass;
pub(in crate::bake) use super::depth_clear::KeptMap;
use super::shadow_draw::{CHUNKS, Drawing, LARGE, Target};
use super::shadow_groups::{GroupPass, Standing, Uploaded};
use crate::bake::device::list::Heads;
use crate::bake::device::records::View;
use crate::bake::device::shaders;
use crate::bake::device::shared::{BATCH, GROUP, VIEW_HEMICUBE};
use crate::bake::job::report::ShadowCounts;
use crate::bake::world::occluders::Occluders;
use crate::gpu::{Address, Buffer, Commands, Gpu, Memory, Pipeline, Result, Stage};

/// Pixels that a chunk's triangles cover on average if it is drawn before it is told what is hidden.
const FIRST_PIXELS: f32 = 4.0;
/// Scenes of fewer chunks are drawn at once.
const FEW_CHUNKS: u32 = 256;
/// Most views of a batch: points have two, their differences four.
pub(in crate::bake) const MAX_VIEWS: u64 = 2 * BATCH as u64;

/// The shadow passes and their buffers.
pub(in crate::bake) struct ShadowPass {
    /// Of everything, of what is drawn first, of the rest, of what one of a light's two versions has alone; for views without
    /// limits, and with.
    cull: [[Pipeline; 4]; 2],
    keep: KeepPass,
    groups: GroupPass,
    blocks: BlockPass,
    /// For whole triangles, and for those with cutouts.
    drawings: [Drawing; 2],
    heads: Heads,
    views: Buffer,
    depth: Buffer,
    /// Scenes of fewer chunks are drawn at once: nothing is looked for that is hidden.
    few: u32,
    /// Maps and faces drawn so far, and triangles that were there to be drawn into them.
    drawn: [u64; 3],
}

/// What is drawn.
pub(in crate::bake) struct Maps<'a> {
    /// Those that borrow after those they borrow from.
    pub views: &'a [View],
    /// What is there already of some, to be copied into them before.
    pub kept: &'a [KeptMap<'a>],
    /// [`ShadowPass::blocks`] will be asked for.
    pub blocks: bool,
}

/// Which chunks are drawn.
#[derive(Clone, Copy)]
enum Which {
    All,
    First,
    Rest,
    Own,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct CullPush {
    chunks: Address,
    groups: Address,
    views: Address,
    from: [Address; 2],
    list: Address,
    head: Address,
    blocks: Address,
}

impl ShadowPass {
    /// `depth_elements`: pixels that the depth maps of one batch may take together.
    pub(in crate::bake) fn new(gpu: &Gpu, depth_elements: u64) -> Result<Self> {
        // A SIMD register of lavapipe, where what an invocation does more shares the reading of the view.
        let lanes = if gpu.info().kind == "CPU" { 8 } else { GROUP };
        let cull = |which, limited| {
            let constants = [which, FIRST_PIXELS.to_bits(), limited, lanes];
            gpu.pipeline(shaders::SHADOW_CULL, &constants)
        };
        let culls = |limited| {
            Ok([
                cull(0, limited)?,
                cull(1, limited)?,
                cull(2, limited)?,
                cull(3, limited)?,
            ])
        };
        Ok(Self {
            cull: [culls(0)?, culls(1)?],
            keep: KeepPass::new(gpu)?,
            blocks: BlockPass::new(gpu)?,
            groups: GroupPass::new(gpu)?,
            drawings: [Drawing::new(0), Drawing::new(1)],
            heads: Heads::new(gpu, "shadow lists", 4)?,
            views: gpu.buffer(
                "shadow views",
                MAX_VIEWS * size_of::<View>() as u64,
                Memory::Device,
            )?,
            depth: gpu.buffer("shadow depth", depth_elements * 4, Memory::Device)?,
            few: FEW_CHUNKS,
            drawn: [0; 3],
        })
    }

    /// Whether what is hidden is left out, in scenes of any size.
    #[cfg(test)]
    pub(in crate::bake) fn set_occlusion(&mut self, on: bool) {
        self.few = if on { 0 } else { u32::MAX };
    }

    pub(super) fn views(&self) -> Address {
        self.views.address()
    }

    /// Pixels that one batch's depth maps may take together.
    pub(in crate::bake) fn elements(&self) -> u64 {
        self.depth.size() / 4
    }

    /// The first `elements` of the depth maps drawn last.
    pub(in crate::bake) fn read_depth(&self, elements: usize) -> Result<Vec<f32>> {
        self.depth.read(0..elements)
    }

    /// Waits, then says what was drawn so far.
    pub(in crate::bake) fn counts(&self) -> Result<ShadowCounts> {
        let totals = self.heads.totals()?;
        let sum = |lists: [u32; 2], of: usize| lists.map(|l| totals[l as usize][of]).iter().sum();
        let [maps, faces, offered] = self.drawn;
        Ok(ShadowCounts {
            maps,
            faces,
            offered,
            chunks: sum(CHUNKS, 0),
            triangles: sum(CHUNKS, 1),
            large: sum(LARGE, 0),
        })
    }

    /// What hides in the maps drawn last: see [`crate::bake::device::shared::VIEW_BLOCKS`].
    pub(super) fn blocks(&self) -> Address {
        self.blocks.found()
    }

    pub(super) fn depth(&self) -> Address {
        self.depth.address()
    }

    /// Draws maps, which can be read by compute shaders after the next barrier. `instances`: the table that says what stands in a
    /// view's version.
    pub(in crate::bake) fn record(
        &mut self,
        gpu: &Gpu,
        cmd: &mut Commands,
        occluders: &Occluders,
        instances: Address,
        &Maps {
            views,
            kept,
            blocks,
        }: &Maps,
    ) -> Result<()> {
        let elements: u64 = views.iter().map(pixels).sum();
        let faces = |v: &View| if v.kind == VIEW_HEMICUBE { 5 } else { 1 };
        let faces: u64 = views.iter().map(faces).sum();
        let new = [views.len() as u64, faces, faces * occluders.triangles()];
        (0..3).for_each(|i| self.drawn[i] += new[i]);
        cmd.upload(&self.views, 0, views)?;
        cmd.fill(&self.depth, 0, elements * 4, 0);
        self.keep
            .fetch(cmd, (&self.depth, &self.views), views, kept);
        let uploaded = Uploaded {
            at: self.views.address(),
            count: views.len() as u32,
            limited: limited(views) != 0,
            instances,
        };
        self.groups.record(gpu, cmd, occluders, &uploaded)?;
        let few = occluders.whole.count().max(occluders.masked.count()) < self.few;
        if few {
            self.draw(gpu, cmd, occluders, views, Which::All, Standing::Both)?;
        } else {
            self.draw(gpu, cmd, occluders, views, Which::First, Standing::Both)?;
            self.blocks.record(cmd, &uploaded, self.depth.address());
            self.draw(gpu, cmd, occluders, views, Which::Rest, Standing::Both)?;
        }
        if views.iter().any(|v| v.version != v.other) {
            if views.iter().any(|v| v.borrows != 0) {
                self.lend(cmd, views);
            }
            let which = if few { Which::All } else { Which::Own };
            self.draw(gpu, cmd, occluders, views, which, Standing::Own)?;
        }
        if blocks {
            self.blocks.record(cmd, &uploaded, self.depth.address());
        }
        Ok(())
    }

    /// Copies maps drawn last to where they are kept.
    pub(in crate::bake) fn keep(&self, cmd: &mut Commands, views: &[View], maps: &[KeptMap]) {
        KeepPass::store(cmd, &self.depth, views, maps);
    }

    /// Copies what is drawn so far, which stands in both versions of a light, to the views that show it in the other version.
    fn lend(&self, cmd: &mut Commands, views: &[View]) {
        cmd.barrier(Stage::Compute, Stage::Transfer);
        cmd.scope("shadow lend", |cmd| {
            for (at, view) in views.iter().enumerate().filter(|(_, v)| v.borrows != 0) {
                let from = u64::from(views[at - view.borrows as usize].offset) * 4;
                let to = u64::from(view.offset) * 4;
                cmd.copy(&self.depth, from, &self.depth, to, pixels(view) * 4);
            }
        });
        cmd.barrier(Stage::Transfer, Stage::Compute);
    }

    /// Draws some of the chunks of listed groups into `views`.
    fn draw(
        &mut self,
        gpu: &Gpu,
        cmd: &mut Commands,
        occluders: &Occluders,
        views: &[View],
        which: Which,
        standing: Standing,
    ) -> Result<()> {
        let limited = limited(views);
        self.heads.clear(cmd);
        let target = Target {
            heads: &self.heads,
            occluders,
            views: self.views.address(),
            depth: self.depth.address(),
            limited,
        };
        let mut drawings = Vec::new();
        for (drawing, chunks) in self
            .drawings
            .iter_mut()
            .zip([&occluders.whole, &occluders.masked])
        {
            if chunks.count() > 0 {
                drawings.push(drawing.ready(gpu, cmd, chunks)?);
            }
        }
        cmd.barrier(Stage::Transfer, Stage::Compute);
        cmd.scope("shadow cull", |cmd| {
            for drawing in &drawings {
                let push = CullPush {
                    chunks: drawing.chunks.chunks.address(),
                    groups: drawing.chunks.groups.address(),
                    views: target.views,
                    from: self.groups.list(drawing.kind, standing),
                    list: drawing.made.list.address(),
                    head: self.heads.address(CHUNKS[drawing.kind]),
                    blocks: self.blocks.found(),
                };
                let pipeline = &self.cull[limited][which as usize];
                self.groups
                    .dispatch(cmd, pipeline, &push, drawing.kind, standing);
            }
            self.heads.finish(cmd, &CHUNKS);
        });
        cmd.scope("shadow small", |cmd| {
            for drawing in &drawings {
                drawing.small(cmd, &target);
            }
            self.heads.finish(cmd, &LARGE);
        });
        cmd.scope("shadow large", |cmd| {
            for drawing in &drawings {
                drawing.large(cmd, &target);
            }
        });
        Ok(())
    }
}

/// 1 where some of the views may have limits, those of differences: else nobody need ask for them.
fn limited(views: &[View]) -> usize {
    usize::from(views.iter().any(|v| v.version != v.other))
}

/// Pixels of a view's depth map.
pub(super) fn pixels(view: &View) -> u64 {
    let faces = if view.kind == VIEW_HEMICUBE { 3 } else { 1 };
    faces * u64::from(view.size) * u64::from(view.size)
}

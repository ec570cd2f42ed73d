//! Depth maps of a batch of lights: cull chunks per face, draw what is left of them; first those chunks that hide much, then what
//! they do not hide.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};

use super::depth_begin::BeginPass;
pub(in crate::bake) use super::depth_begin::Place;
use super::depth_blocks::BlockPass;
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
    begin: BeginPass,
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
    /// Those that borrow after those they borrow from. Where their maps are is found out later.
    pub views: &'a [View],
    /// Where maps are, or are to be, that are kept: by the index of their view.
    pub kept: &'a HashMap<u32, Place<'a>>,
    /// What hides in them will be asked for.
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
}

impl ShadowPass {
    /// `depth`: bytes that the depth maps of one batch may take together, but for those that are kept.
    pub(in crate::bake) fn new(gpu: &Gpu, depth: u64) -> Result<Self> {
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
            begin: BeginPass::new(gpu)?,
            blocks: BlockPass::new(gpu)?,
            groups: GroupPass::new(gpu)?,
            drawings: [Drawing::new(0), Drawing::new(1)],
            heads: Heads::new(gpu, "shadow lists", 4)?,
            views: gpu.buffer(
                "shadow views",
                MAX_VIEWS * size_of::<View>() as u64,
                Memory::Device,
            )?,
            depth: gpu.buffer("shadow depth", depth, Memory::Device)?,
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

    /// Bytes that one batch's depth maps may take together, but for those that are kept.
    pub(in crate::bake) fn room(&self) -> u64 {
        self.depth.size()
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
        let faces = |v: &View| if v.kind == VIEW_HEMICUBE { 5 } else { 1 };
        let faces: u64 = views.iter().map(faces).sum();
        let new = [views.len() as u64, faces, faces * occluders.triangles()];
        (0..3).for_each(|i| self.drawn[i] += new[i]);
        let at = places(&self.depth, views, kept);
        let placed = |(view, place): (&View, &Place)| View {
            depth: place.buffer.address_at(place.at),
            ..*view
        };
        let views: &Vec<View> = &views.iter().zip(&at).map(placed).collect();
        cmd.upload(&self.views, 0, views)?;
        self.begin.record(cmd, views, &at, self.views.address());
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
            self.blocks.record(cmd, &uploaded);
            self.draw(gpu, cmd, occluders, views, Which::Rest, Standing::Both)?;
        }
        if views.iter().any(|v| v.version != v.other) {
            BeginPass::lend(cmd, views, &places(&self.depth, views, kept));
            let which = if few { Which::All } else { Which::Own };
            self.draw(gpu, cmd, occluders, views, which, Standing::Own)?;
        }
        if blocks {
            self.blocks.record(cmd, &uploaded);
        }
        Ok(())
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
            limited,
        };
        let mut drawings = Vec::new();
        for (drawing, chunks) in self
            .drawings
            .iter_mut()
            .zip([&occluders.whole, &occluders.masked])
        {
            if chunks.count() > 0 {
                drawings.push(drawing.ready(gpu, chunks)?);
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

/// Where the maps of views are: where they are kept, or else one after the other in `room`.
fn places<'a>(room: &'a Buffer, views: &[View], kept: &HashMap<u32, Place<'a>>) -> Vec<Place<'a>> {
    let mut free = 0;
    (0..)
        .zip(views)
        .map(|(index, view)| {
            kept.get(&index).copied().unwrap_or_else(|| {
                let at = free;
                free += view.bytes();
                Place { buffer: room, at }
            })
        })
        .collect()
}

/// 1 where some of the views may have limits, those of differences: else nobody need ask for them.
fn limited(views: &[View]) -> usize {
    usize::from(views.iter().any(|v| v.version != v.other))
}

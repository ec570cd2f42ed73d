//! Draws marks over the picture: lines, points and filled shapes, hidden by what stands before them.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::shaders;
use crate::gpu::{
    Address, Blend, Buffer, Commands, DepthTarget, DepthUse, Drawing, Edge, Format, Gpu,
    GraphicsOptions, GraphicsPipeline, Image, ImageOptions, Memory, Result, Sampler, Stage,
    Targets, Textures, Topology,
};

/// A line, or a point: as in `view_marks.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(super) struct Stroke {
    pub(super) from: [f32; 3],
    pub(super) to: [f32; 3],
    pub(super) color: u32,
    pub(super) width: f32,
}

/// A corner of a triangle: as in `view_marks.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(super) struct Corner {
    pub(super) position: [f32; 3],
    pub(super) color: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    picture: Address,
    strokes: Address,
    corners: Address,
    size: [f32; 2],
}

/// Marks on the device.
pub(super) struct Marks {
    strokes: Buffer,
    corners: Buffer,
    /// Strokes, corners of shapes that hide what lies behind, corners of shapes that do not.
    counts: [u32; 3],
}

impl Marks {
    pub(super) fn new(
        gpu: &Gpu,
        strokes: &[Stroke],
        [solid, veils]: [&[Corner]; 2],
    ) -> Result<Self> {
        let corners = [solid, veils].concat();
        let buffer = |name, bytes: usize| gpu.buffer(name, bytes.max(4) as u64, Memory::Device);
        let marks = Self {
            strokes: buffer("strokes", size_of_val(strokes))?,
            corners: buffer("corners", size_of_val(&corners[..]))?,
            counts: [strokes.len(), solid.len(), veils.len()].map(|n| n as u32),
        };
        let mut cmd = gpu.commands()?;
        cmd.upload(&marks.strokes, 0, strokes)?;
        cmd.upload(&marks.corners, 0, &corners)?;
        cmd.barrier(Stage::Transfer, Stage::All);
        let _in_order = cmd.submit()?;
        Ok(marks)
    }
}

/// What marks are drawn into, and how.
pub(super) struct Marker {
    strokes: GraphicsPipeline,
    solid: GraphicsPipeline,
    veils: GraphicsPipeline,
    over: GraphicsPipeline,
    samples: u32,
    sampler: Arc<Sampler>,
    sheet: Option<Sheet>,
    gpu: Gpu,
}

/// What marks are drawn into.
struct Sheet {
    /// More than one sample a pixel; none where that is not offered.
    samples: Option<Image>,
    image: Arc<Image>,
    read: Textures,
}

impl Marker {
    /// For targets of a format.
    pub(super) fn new(gpu: &Gpu, samples: u32, target: Format) -> Result<Self> {
        let marks = GraphicsOptions {
            format: Format::Rgba8,
            samples,
            textures: 0,
            depth: DepthUse::Test,
            blend: Blend::Premultiplied,
            topology: Topology::Triangles,
        };
        let over = GraphicsOptions {
            format: target,
            samples: 1,
            textures: 1,
            depth: DepthUse::None,
            ..marks
        };
        let hiding = GraphicsOptions {
            depth: DepthUse::Write,
            ..marks
        };
        let (shapes, frag) = (shaders::VIEW_SHAPES_VERT, shaders::VIEW_MARKS_FRAG);
        let (screen, over_frag) = (shaders::VIEW_SCREEN_VERT, shaders::VIEW_OVER_FRAG);
        Ok(Self {
            strokes: gpu.graphics(shaders::VIEW_STROKES_VERT, frag, &[], &marks)?,
            solid: gpu.graphics(shapes, frag, &[], &hiding)?,
            veils: gpu.graphics(shapes, frag, &[], &marks)?,
            over: gpu.graphics(screen, over_frag, &[], &over)?,
            samples,
            sampler: Arc::new(gpu.sampler(true, [Edge::Clamp; 2])?),
            sheet: None,
            gpu: gpu.clone(),
        })
    }

    /// For pictures of a size from now on.
    pub(super) fn fit(&mut self, size: [u32; 2]) -> Result<()> {
        if self.sheet.as_ref().is_some_and(|s| s.image.size() == size) {
            return Ok(());
        }
        let image = |name, samples| {
            let options = ImageOptions {
                size,
                layers: 1,
                mips: false,
                samples,
                format: Format::Rgba8,
            };
            self.gpu.image(name, &options)
        };
        let plain = Arc::new(image("marks", 1)?);
        self.sheet = Some(Sheet {
            samples: match self.samples {
                1 => None,
                samples => Some(image("mark samples", samples)?),
            },
            read: self
                .gpu
                .textures(&[(Arc::clone(&plain), Arc::clone(&self.sampler))])?,
            image: plain,
        });
        Ok(())
    }

    /// Records the marks in the light of the picture's depth.
    pub(super) fn record(
        &self,
        cmd: &mut Commands,
        marks: &Marks,
        picture: Address,
        depth: &Image,
    ) {
        let Some(sheet) = &self.sheet else { return };
        let targets = Targets {
            color: sheet.samples.as_ref().unwrap_or(&sheet.image),
            resolve: sheet.samples.as_ref().map(|_| &*sheet.image),
            depth: Some(DepthTarget {
                image: depth,
                goes_on: true,
                kept: false,
            }),
            clear: Some([0.0; 4]),
        };
        let push = Push {
            picture,
            strokes: marks.strokes.address(),
            corners: marks.corners.address(),
            size: sheet.image.size().map(|s| s as f32),
        };
        let [strokes, solid, veils] = marks.counts;
        cmd.scope("view marks", |cmd| {
            cmd.draw(&targets, |drawing| {
                for (pipeline, vertices) in [
                    (&self.solid, 0..solid),
                    (&self.veils, solid..solid + veils),
                    (&self.strokes, 0..strokes * 6),
                ] {
                    drawing.pipeline(pipeline);
                    drawing.push(&push);
                    drawing.vertices(vertices);
                }
            });
        });
    }

    /// Lays what was recorded over the picture.
    pub(super) fn lay_over(&self, drawing: &mut Drawing) {
        if let Some(sheet) = &self.sheet {
            drawing.pipeline(&self.over);
            drawing.textures(&self.over, &sheet.read);
            drawing.vertices(0..3);
        }
    }
}

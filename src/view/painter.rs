//! Draws egui's output: textured triangles, clipped to rectangles.

use std::collections::BTreeMap;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use egui::TextureId;
use egui::epaint::{ClippedPrimitive, ImageData, ImageDelta, Primitive, Vertex};

use super::shaders;
use crate::gpu::{
    Address, Blend, Buffer, Commands, DepthUse, Edge, Format, Gpu, GraphicsOptions,
    GraphicsPipeline, Image, ImageOptions, Memory, Result, Sampler, Stage, Targets, Textures,
    Topology,
};

/// Draws panels.
pub(super) struct Painter {
    gpu: Gpu,
    pipeline: GraphicsPipeline,
    sampler: Arc<Sampler>,
    images: BTreeMap<TextureId, (Arc<Image>, Textures)>,
    vertices: Buffer,
    indices: Buffer,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    vertices: Address,
    scale: [f32; 2],
}

impl Painter {
    /// For targets of a format.
    pub(super) fn new(gpu: &Gpu, format: Format) -> Result<Self> {
        let options = GraphicsOptions {
            format,
            samples: 1,
            textures: 1,
            depth: DepthUse::None,
            blend: Blend::Premultiplied,
            topology: Topology::Triangles,
        };
        let (vert, frag) = (shaders::VIEW_PANELS_VERT, shaders::VIEW_PANELS_FRAG);
        Ok(Self {
            pipeline: gpu.graphics(vert, frag, &[], &options)?,
            sampler: Arc::new(gpu.sampler(true, [Edge::Clamp; 2])?),
            images: BTreeMap::new(),
            vertices: gpu.buffer("panel vertices", 0, Memory::Device)?,
            indices: gpu.buffer("panel indices", 0, Memory::Device)?,
            gpu: gpu.clone(),
        })
    }

    /// Takes in changes of textures, and records the triangles onto what `target` holds.
    pub(super) fn record(
        &mut self,
        cmd: &mut Commands,
        target: &Image,
        changes: &egui::TexturesDelta,
        primitives: &[ClippedPrimitive],
        points: f32,
    ) -> Result<()> {
        cmd.barrier(Stage::All, Stage::All);
        for (id, delta) in &changes.set {
            self.change(cmd, *id, delta)?;
        }
        let (mut vertices, mut indices) = (Vec::<Vertex>::new(), Vec::<u32>::new());
        let mut draws = Vec::new();
        for clipped in primitives {
            if let Primitive::Mesh(mesh) = &clipped.primitive {
                let (first, base) = (indices.len() as u32, vertices.len() as u32);
                indices.extend(mesh.indices.iter().map(|i| i + base));
                vertices.extend(&mesh.vertices);
                draws.push((
                    clipped.clip_rect,
                    mesh.texture_id,
                    first..indices.len() as u32,
                ));
            }
        }
        let grow = |buffer: &mut Buffer, bytes: usize| -> Result<()> {
            if buffer.size() < bytes as u64 {
                let size = (bytes as u64).next_power_of_two();
                *buffer = self.gpu.buffer(buffer.name(), size, Memory::Device)?;
            }
            Ok(())
        };
        grow(&mut self.vertices, size_of_val(&vertices[..]))?;
        grow(&mut self.indices, size_of_val(&indices[..]))?;
        cmd.upload::<u8>(&self.vertices, 0, bytemuck::cast_slice(&vertices))?;
        cmd.upload(&self.indices, 0, &indices)?;
        cmd.barrier(Stage::Transfer, Stage::All);
        let size = target.size();
        let targets = Targets {
            color: target,
            resolve: None,
            depth: None,
            clear: None,
        };
        cmd.scope("view panels", |cmd| {
            cmd.draw(&targets, |drawing| {
                drawing.pipeline(&self.pipeline);
                drawing.indices(&self.indices);
                drawing.push(&Push {
                    vertices: self.vertices.address(),
                    scale: size.map(|s| 2.0 * points / s as f32),
                });
                for (clip, texture, range) in draws {
                    let Some((_, textures)) = self.images.get(&texture) else {
                        continue;
                    };
                    // Whole pixels inside of the target.
                    let edge =
                        |v: f32, most: u32| (v * points).round().clamp(0.0, most as f32) as u32;
                    let low = [edge(clip.min.x, size[0]), edge(clip.min.y, size[1])];
                    let high = [edge(clip.max.x, size[0]), edge(clip.max.y, size[1])];
                    if low[0] >= high[0] || low[1] >= high[1] {
                        continue;
                    }
                    drawing.scissor(low, [high[0] - low[0], high[1] - low[1]]);
                    drawing.textures(&self.pipeline, textures);
                    drawing.indexed(&self.indices, range);
                }
            });
        });
        for id in &changes.free {
            self.images.remove(id);
        }
        Ok(())
    }

    fn change(&mut self, cmd: &mut Commands, id: TextureId, delta: &ImageDelta) -> Result<()> {
        let ImageData::Color(pixels) = &delta.image;
        let size = pixels.size.map(|s| s as u32);
        let bytes: &[u8] = bytemuck::cast_slice(&pixels.pixels);
        if let (Some(at), Some((image, _))) = (delta.pos, self.images.get(&id)) {
            return cmd.upload_image(image, 0, at.map(|v| v as u32), size, bytes);
        }
        let options = ImageOptions {
            size,
            layers: 1,
            mips: false,
            samples: 1,
            format: Format::Rgba8,
        };
        let image = Arc::new(self.gpu.image("panel texture", &options)?);
        cmd.upload_image(&image, 0, [0, 0], size, bytes)?;
        let textures = self
            .gpu
            .textures(&[(Arc::clone(&image), Arc::clone(&self.sampler))])?;
        self.images.insert(id, (image, textures));
        Ok(())
    }
}

//! A picture of the scene, pass by pass: surfaces lit by the map, the mean of their samples, marks, tone mapping.

use std::collections::BTreeMap;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec2, Vec4};

use super::camera::Pose;
use super::exposure::Exposure;
use super::look::Look;
use super::marker::{Marker, Marks};
use super::metering::Metering;
use super::shaders;
use super::shown::Shown;
use crate::gpu::{
    Address, Blend, Buffer, Commands, DepthTarget, DepthUse, Drawing, Edge, Format, Gpu,
    GraphicsOptions, GraphicsPipeline, Image, ImageOptions, Memory, Result, Stage, Targets,
    Textures, Ticket, Topology,
};

/// As in `view_scene.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct Picture {
    pub(super) clip: [[f32; 4]; 4],
    pub(super) eye: [f32; 3],
    pub(super) exposure: f32,
    pub(super) lux: f32,
    pub(super) page_size: f32,
    pub(super) scale: [f32; 2],
    pub(super) page: f32,
    pub(super) least: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct MeshPush {
    picture: Address,
    vertices: Address,
    placed: Address,
    surfaces: Address,
    object: u32,
    surface: u32,
}

/// What is drawn into, for one size of pictures.
struct Canvas {
    size: [u32; 2],
    /// More than one sample a pixel; none where that is not offered.
    samples: Option<Image>,
    depth: Image,
    radiance: Arc<Image>,
    /// Radiance, for tone mapping.
    read: Textures,
}

/// Draws pictures of a scene.
pub struct Display {
    gpu: Gpu,
    samples: u32,
    meshes: BTreeMap<Look, GraphicsPipeline>,
    tones: BTreeMap<(Look, bool), GraphicsPipeline>,
    canvas: Option<Canvas>,
    shown: Option<Arc<Shown>>,
    picture: Buffer,
    placed: Buffer,
    surfaces: Buffer,
    nearest: f32,
    metering: Metering,
    marks: Option<Arc<Marks>>,
    marker: Option<(Marker, [u32; 2], Format)>,
    /// Exposure of the next picture.
    pub exposure: Exposure,
}

/// What a picture is to be.
#[derive(Clone, Copy, Debug)]
pub struct Shot {
    /// Where from.
    pub pose: Pose,
    /// What of.
    pub look: Look,
    /// What both ends of the false colours stand for.
    pub scale: [f32; 2],
    /// How a page is laid out, where one is looked at.
    pub page: PageShot,
}

/// How a page of the lightmap is laid out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PageShot {
    /// From 0.
    pub page: u32,
    /// What lies in the middle, as shares of width and height.
    pub center: Vec2,
    /// How much larger than what fits into the picture.
    pub zoom: f32,
}

impl Default for PageShot {
    fn default() -> Self {
        Self {
            page: 0,
            center: Vec2::splat(0.5),
            zoom: 1.0,
        }
    }
}

impl PageShot {
    /// Pixels per texel in a picture of a size.
    pub fn pixels_per_texel(&self, size: Vec2, page_size: f32) -> f32 {
        0.94 * self.zoom * size.min_element() / page_size
    }

    /// Texels to clip space.
    fn clip(&self, size: [u32; 2], page_size: f32) -> Mat4 {
        let size = Vec2::new(size[0] as f32, size[1] as f32);
        let scale = self.pixels_per_texel(size, page_size) * 2.0 / size;
        let at = self.center * page_size;
        Mat4::from_cols(
            Vec4::X * scale.x,
            Vec4::Y * -scale.y,
            Vec4::ZERO,
            Vec4::new(-at.x * scale.x, at.y * scale.y, 0.5, 1.0),
        )
    }
}

impl Display {
    /// Nothing to show yet.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            samples: gpu.samples(),
            meshes: BTreeMap::new(),
            tones: BTreeMap::new(),
            canvas: None,
            shown: None,
            picture: gpu.buffer("picture", size_of::<Picture>() as u64, Memory::Device)?,
            placed: gpu.buffer("placed objects", 0, Memory::Device)?,
            surfaces: gpu.buffer("surfaces", 0, Memory::Device)?,
            nearest: 1e-2,
            metering: Metering::new(gpu)?,
            marks: None,
            marker: None,
            exposure: Exposure::default(),
            gpu: gpu.clone(),
        })
    }

    /// Shows a scene from now on.
    pub fn show(&mut self, shown: &Arc<Shown>) -> Result<()> {
        self.nearest = (shown.bounds().size().length() * 1e-4).max(1e-4);
        let placed = size_of_val(&shown.geometry.placed[..]) as u64;
        if self.placed.size() < placed {
            self.placed = self.gpu.buffer("placed objects", placed, Memory::Device)?;
        }
        let surfaces = size_of_val(&shown.geometry.surfaces[..]) as u64;
        if self.surfaces.size() < surfaces {
            self.surfaces = self.gpu.buffer("surfaces", surfaces, Memory::Device)?;
        }
        self.shown = Some(Arc::clone(shown));
        Ok(())
    }

    /// Lays marks over the pictures from now on, or none.
    pub(super) fn mark(&mut self, marks: Option<Arc<Marks>>) {
        self.marks = marks;
    }

    /// World to clip space of pictures of a size.
    pub fn clip(&self, pose: &Pose, size: [u32; 2]) -> Mat4 {
        pose.clip(size[0] as f32 / size[1] as f32, self.nearest)
    }

    /// Records a picture into `target`, which is as large as the picture is to be.
    pub fn record(&mut self, cmd: &mut Commands, target: &Image, shot: &Shot) -> Result<()> {
        self.fit(target.size())?;
        self.prepare(shot.look, target.format())?;
        let canvas = self.canvas.as_ref().expect("made above");
        let shown = self.shown.clone();
        let pages = shown.as_ref().map(|s| &s.pages);
        let atlas = shown.as_ref().and_then(|s| s.atlas.as_ref());
        let page_size = atlas.map_or(1.0, |a| a.page_size as f32);
        let clip = match shot.look {
            Look::Page => shot.page.clip(canvas.size, page_size),
            _ => self.clip(&shot.pose, canvas.size),
        };
        let picture = Picture {
            clip: clip.to_cols_array_2d(),
            eye: shot.pose.position.to_array(),
            exposure: self.exposure.factor(),
            lux: pages.map_or(1.0, |p| p.lux),
            page_size,
            scale: shot.scale,
            page: shot.page.page as f32,
            least: pages.map_or(1.0, |p| p.least),
        };
        cmd.barrier(Stage::All, Stage::All);
        cmd.upload(&self.picture, 0, &[picture])?;
        if let Some(shown) = &shown {
            cmd.upload(&self.placed, 0, &shown.geometry.placed)?;
            cmd.upload(&self.surfaces, 0, &shown.geometry.surfaces)?;
        }
        cmd.barrier(Stage::Transfer, Stage::Draw);
        let marked = self.marks.as_ref().zip(self.marker.as_ref());
        let targets = Targets {
            color: canvas.samples.as_ref().unwrap_or(&canvas.radiance),
            resolve: canvas.samples.as_ref().map(|_| &*canvas.radiance),
            depth: Some(DepthTarget {
                image: &canvas.depth,
                goes_on: false,
                kept: marked.is_some(),
            }),
            clear: Some([0.0; 4]),
        };
        cmd.scope("view surfaces", |cmd| {
            cmd.draw(&targets, |drawing| match (&shown, shot.look) {
                (Some(shown), Look::Page) => {
                    let pipeline = &self.meshes[&shot.look];
                    drawing.pipeline(pipeline);
                    if let Some(page) = &shown.materials.page {
                        drawing.textures(pipeline, page);
                        drawing.push(&self.picture.address());
                        drawing.vertices(0..6);
                    }
                }
                (Some(shown), look) => self.draw_surfaces(drawing, shown, &clip, look),
                (None, _) => {}
            });
        });
        cmd.barrier(Stage::Draw, Stage::All);
        if let Some((marks, (marker, ..))) = marked {
            marker.record(cmd, marks, self.picture.address(), &canvas.depth);
            cmd.barrier(Stage::Draw, Stage::All);
        }
        let targets = Targets {
            color: target,
            resolve: None,
            depth: None,
            clear: Some([0.0; 4]),
        };
        let tone = &self.tones[&(shot.look, target.format() == Format::Bgra8)];
        cmd.scope("view tone", |cmd| {
            cmd.draw(&targets, |drawing| {
                drawing.pipeline(tone);
                drawing.textures(tone, &canvas.read);
                drawing.push(&self.picture.address());
                drawing.vertices(0..3);
                if let Some((_, (marker, ..))) = marked {
                    marker.lay_over(drawing);
                }
            });
        });
        Ok(())
    }

    fn draw_surfaces(&self, drawing: &mut Drawing, shown: &Shown, clip: &Mat4, look: Look) {
        let pipeline = &self.meshes[&look];
        drawing.pipeline(pipeline);
        let (mut material, mut sides) = (None, None);
        for draw in &shown.geometry.draws {
            if !shown.geometry.sees(draw.object, clip) {
                continue;
            }
            if material.replace(draw.material) != Some(draw.material) {
                drawing.textures(pipeline, &shown.materials.sets[draw.material as usize]);
            }
            if sides.replace(draw.sides) != Some(draw.sides) {
                drawing.sides(draw.sides);
            }
            drawing.push(&MeshPush {
                picture: self.picture.address(),
                vertices: draw.part.vertices.address(),
                placed: self.placed.address(),
                surfaces: self.surfaces.address(),
                object: draw.object,
                surface: draw.material,
            });
            drawing.indices(&draw.part.indices);
            drawing.indexed(&draw.part.indices, draw.indices.clone());
        }
    }

    /// Records, after [`Display::record`], a measurement of the picture's light; what it finds comes with
    /// [`Display::take_measurement`]. Whether it did: one is under way at a time.
    pub fn measure(&mut self, cmd: &mut Commands) -> bool {
        let canvas = self.canvas.as_ref();
        canvas.is_some_and(|canvas| {
            let exposure = self.exposure.factor();
            self.metering.measure(cmd, &canvas.radiance, exposure)
        })
    }

    /// As [`Display::measure`], of a picture in false colours: what a place stands for, given as shares of width and height.
    pub fn probe(&mut self, cmd: &mut Commands, look: Look, at: [f32; 2]) -> bool {
        let canvas = self.canvas.as_ref();
        canvas.is_some_and(|canvas| self.metering.probe(cmd, &canvas.radiance, look, at))
    }

    /// The lux, or the relative error, that the last probe found; none where nothing is.
    pub fn probed(&self) -> Option<f32> {
        self.metering.probed()
    }

    /// The submission that a measurement is part of.
    pub fn measured_by(&mut self, ticket: Ticket) {
        self.metering.submitted(ticket);
    }

    /// The mean luminance of the last picture that was measured, once that is done (or, with `wait`, now), cd/m².
    pub fn take_measurement(&mut self, wait: bool) -> Result<Option<f32>> {
        self.metering.take(wait)
    }

    fn fit(&mut self, size: [u32; 2]) -> Result<()> {
        if self.canvas.as_ref().is_some_and(|c| c.size == size) {
            return Ok(());
        }
        let image = |name: &str, samples, format| {
            let options = ImageOptions {
                size,
                layers: 1,
                mips: false,
                samples,
                format,
            };
            self.gpu.image(name, &options)
        };
        let radiance = Arc::new(image("radiance", 1, Format::Rgba16F)?);
        let nearest = Arc::new(self.gpu.sampler(false, [Edge::Clamp; 2])?);
        self.canvas = Some(Canvas {
            size,
            samples: match self.samples {
                1 => None,
                samples => Some(image("samples", samples, Format::Rgba16F)?),
            },
            depth: image("depth", self.samples, Format::Depth)?,
            read: self.gpu.textures(&[(Arc::clone(&radiance), nearest)])?,
            radiance,
        });
        Ok(())
    }

    fn prepare(&mut self, look: Look, format: Format) -> Result<()> {
        let constants = [look.constant()];
        let size = self.canvas.as_ref().map_or([1; 2], |c| c.size);
        let marked = (size, format);
        if self.marks.is_some() && self.marker.as_ref().map(|m| (m.1, m.2)) != Some(marked) {
            let marker = Marker::new(&self.gpu, size, self.samples, format)?;
            self.marker = Some((marker, size, format));
        }
        if !self.meshes.contains_key(&look) {
            let page = look == Look::Page;
            let options = GraphicsOptions {
                format: Format::Rgba16F,
                samples: self.samples,
                textures: if page { 1 } else { 4 },
                depth: DepthUse::Write,
                blend: Blend::Replace,
                topology: Topology::Triangles,
            };
            let pipeline = if page {
                let (vert, frag) = (shaders::VIEW_PAGE_VERT, shaders::VIEW_PAGE_FRAG);
                self.gpu.graphics(vert, frag, &[], &options)?
            } else {
                let (vert, frag) = (shaders::VIEW_MESH_VERT, shaders::VIEW_MESH_FRAG);
                self.gpu.graphics(vert, frag, &constants, &options)?
            };
            self.meshes.insert(look, pipeline);
        }
        let key = (look, format == Format::Bgra8);
        if !self.tones.contains_key(&key) {
            let options = GraphicsOptions {
                format,
                samples: 1,
                textures: 1,
                depth: DepthUse::None,
                blend: Blend::Replace,
                topology: Topology::Triangles,
            };
            let (vert, frag) = (shaders::VIEW_SCREEN_VERT, shaders::VIEW_TONE_FRAG);
            let pipeline = self.gpu.graphics(vert, frag, &constants, &options)?;
            self.tones.insert(key, pipeline);
        }
        Ok(())
    }
}

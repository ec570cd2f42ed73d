//! A picture of the scene, pass by pass: surfaces lit by the map, the mean of their samples, marks, tone mapping.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::Mat4;

use super::camera::Pose;
use super::exposure::Exposure;
use super::geometry::Kind;
use super::look::Look;
use super::marker::{Marker, Marks};
use super::metering::Metering;
use super::shaders;
use super::shot::Shot;
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
    meshes: BTreeMap<(Look, Kind, u32), GraphicsPipeline>,
    /// By samples.
    pages: BTreeMap<u32, GraphicsPipeline>,
    tones: BTreeMap<(Look, bool), GraphicsPipeline>,
    canvas: Option<Canvas>,
    shown: Option<Arc<Shown>>,
    picture: Buffer,
    placed: Buffer,
    surfaces: Buffer,
    nearest: f32,
    metering: Metering,
    marks: Option<Arc<Marks>>,
    /// By samples.
    markers: BTreeMap<u32, Marker>,
    /// Exposure of the next picture.
    pub exposure: Exposure,
}

impl Display {
    /// Nothing to show yet.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            samples: gpu.samples(),
            meshes: BTreeMap::new(),
            pages: BTreeMap::new(),
            tones: BTreeMap::new(),
            canvas: None,
            shown: None,
            picture: gpu.buffer("picture", size_of::<Picture>() as u64, Memory::Device)?,
            placed: gpu.buffer("placed objects", 0, Memory::Device)?,
            surfaces: gpu.buffer("surfaces", 0, Memory::Device)?,
            nearest: 1e-2,
            metering: Metering::new(gpu)?,
            marks: None,
            markers: BTreeMap::new(),
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
        // What is coarse is blurred anyhow.
        let samples = if shot.coarse > 1 { 1 } else { self.samples };
        let size = target.size().map(|s| s.div_ceil(shot.coarse.max(1)));
        self.fit(size, samples)?;
        self.prepare(shot.look, target.format(), samples)?;
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
        let marked = self.marks.as_ref().zip(self.markers.get(&samples));
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
                    if let (Some(pipeline), Some(page)) =
                        (self.pages.get(&samples), &shown.materials.page)
                    {
                        drawing.pipeline(pipeline);
                        drawing.textures(pipeline, page);
                        drawing.push(&self.picture.address());
                        drawing.vertices(0..6);
                    }
                }
                (Some(shown), _) => self.draw_surfaces(drawing, shown, &clip, shot, samples),
                (None, _) => {}
            });
        });
        cmd.barrier(Stage::Draw, Stage::All);
        if let Some((marks, marker)) = marked {
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
                if let Some((_, marker)) = marked {
                    marker.lay_over(drawing);
                }
            });
        });
        Ok(())
    }

    fn draw_surfaces(
        &self,
        drawing: &mut Drawing,
        shown: &Shown,
        clip: &Mat4,
        shot: &Shot,
        samples: u32,
    ) {
        let (mut kind, mut material, mut sides) = (None, None, None);
        for draw in shown.geometry.seen(shot.pose.position, clip) {
            let wanted = draw.kind.for_look(shot.look);
            let pipeline = &self.meshes[&(shot.look, wanted, samples)];
            if kind.replace(wanted) != Some(wanted) {
                drawing.pipeline(pipeline);
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

    fn fit(&mut self, size: [u32; 2], samples: u32) -> Result<()> {
        let fits = |c: &Canvas| c.size == size && c.depth.samples() == samples;
        if self.canvas.as_ref().is_some_and(fits) {
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
        let linear = Arc::new(self.gpu.sampler(true, [Edge::Clamp; 2])?);
        self.canvas = Some(Canvas {
            size,
            samples: match samples {
                1 => None,
                samples => Some(image("samples", samples, Format::Rgba16F)?),
            },
            depth: image("depth", samples, Format::Depth)?,
            read: self.gpu.textures(&[(Arc::clone(&radiance), linear)])?,
            radiance,
        });
        Ok(())
    }

    fn prepare(&mut self, look: Look, format: Format, samples: u32) -> Result<()> {
        let size = self.canvas.as_ref().map_or([1; 2], |c| c.size);
        if self.marks.is_some() {
            let marker = match self.markers.entry(samples) {
                Entry::Occupied(there) => there.into_mut(),
                Entry::Vacant(none) => none.insert(Marker::new(&self.gpu, samples, format)?),
            };
            marker.fit(size)?;
        }
        let surfaces = GraphicsOptions {
            format: Format::Rgba16F,
            samples,
            textures: 4,
            depth: DepthUse::Write,
            blend: Blend::Replace,
            topology: Topology::Triangles,
        };
        if look == Look::Page && !self.pages.contains_key(&samples) {
            let (vert, frag) = (shaders::VIEW_PAGE_VERT, shaders::VIEW_PAGE_FRAG);
            let options = GraphicsOptions {
                textures: 1,
                ..surfaces
            };
            let pipeline = self.gpu.graphics(vert, frag, &[], &options)?;
            self.pages.insert(samples, pipeline);
        }
        let draws = self.shown.iter().flat_map(|shown| &shown.geometry.draws);
        for draw in draws.filter(|_| look != Look::Page) {
            let kind = draw.kind.for_look(look);
            if self.meshes.contains_key(&(look, kind, samples)) {
                continue;
            }
            let [masked, image, emits] = kind.constants();
            let constants = [look.constant(), masked, image, emits];
            let (vert, frag) = (shaders::VIEW_MESH_VERT, shaders::VIEW_MESH_FRAG);
            let pipeline = self.gpu.graphics(vert, frag, &constants, &surfaces)?;
            self.meshes.insert((look, kind, samples), pipeline);
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
            let constants = [look.constant()];
            let pipeline = self.gpu.graphics(vert, frag, &constants, &options)?;
            self.tones.insert(key, pipeline);
        }
        Ok(())
    }
}

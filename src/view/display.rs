//! A picture of the scene, pass by pass: surfaces lit by the map, the mean of their samples, tone mapping.

use std::collections::BTreeMap;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::Mat4;
use serde::{Deserialize, Serialize};

use super::camera::Pose;
use super::exposure::{Exposure, meter};
use super::shaders;
use super::shown::Shown;
use crate::bake::shared::{LOOK_LIGHT, LOOK_LIT, LOOK_LUX, LOOK_UNBAKED, LUX_STEP};
use crate::gpu::{
    Address, Blend, Buffer, Commands, DepthUse, Drawing, Edge, Format, Gpu, GraphicsOptions,
    GraphicsPipeline, Image, ImageOptions, Memory, Result, Stage, Targets, Textures, Ticket,
    Topology,
};

/// What a picture shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Look {
    /// The scene in its light.
    #[default]
    Lit,
    /// The scene in a light that stands in until there is a map.
    Unbaked,
    /// The light on grey surfaces.
    Light,
    /// Lux in false colours.
    Lux,
}

impl Look {
    fn constant(self) -> u32 {
        match self {
            Self::Lit => LOOK_LIT,
            Self::Unbaked => LOOK_UNBAKED,
            Self::Light => LOOK_LIGHT,
            Self::Lux => LOOK_LUX,
        }
    }
}

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

/// Width and height of the picture that light is measured on.
const METER: [u32; 2] = [64, 36];

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

/// A measurement under way: the exposure factor that its picture has.
struct Metering {
    ticket: Ticket,
    factor: f32,
    /// Of one pixel of false colours.
    probe: bool,
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
    meter: Image,
    metered: Buffer,
    metering: Option<Metering>,
    probing: bool,
    probed: Option<f32>,
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
    /// Lux at both ends of the false colours.
    pub scale: [f32; 2],
}

impl Display {
    /// Nothing to show yet.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let small = ImageOptions {
            size: METER,
            layers: 1,
            mips: false,
            samples: 1,
            format: Format::Rgba16F,
        };
        let bytes = u64::from(METER[0] * METER[1]) * Format::Rgba16F.bytes();
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
            meter: gpu.image("meter", &small)?,
            metered: gpu.buffer("metered", bytes, Memory::Readback)?,
            metering: None,
            probing: false,
            probed: None,
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

    /// World to clip space of pictures of a size.
    pub fn clip(&self, pose: &Pose, size: [u32; 2]) -> Mat4 {
        pose.clip(size[0] as f32 / size[1] as f32, self.nearest)
    }

    /// Records a picture into `target`, which is as large as the picture is to be.
    pub fn record(&mut self, cmd: &mut Commands, target: &Image, shot: &Shot) -> Result<()> {
        self.fit(target.size())?;
        self.prepare(shot.look, target.format())?;
        let canvas = self.canvas.as_ref().expect("made above");
        let clip = self.clip(&shot.pose, canvas.size);
        let shown = self.shown.clone();
        let pages = shown.as_ref().map(|s| &s.pages);
        let atlas = shown.as_ref().and_then(|s| s.atlas.as_ref());
        let picture = Picture {
            clip: clip.to_cols_array_2d(),
            eye: shot.pose.position.to_array(),
            exposure: self.exposure.factor(),
            lux: pages.map_or(1.0, |p| p.lux),
            page_size: atlas.map_or(1.0, |a| a.page_size as f32),
            scale: shot.scale,
        };
        cmd.barrier(Stage::All, Stage::All);
        cmd.upload(&self.picture, 0, &[picture])?;
        if let Some(shown) = &shown {
            cmd.upload(&self.placed, 0, &shown.geometry.placed)?;
            cmd.upload(&self.surfaces, 0, &shown.geometry.surfaces)?;
        }
        cmd.barrier(Stage::Transfer, Stage::Draw);
        let targets = Targets {
            color: canvas.samples.as_ref().unwrap_or(&canvas.radiance),
            resolve: canvas.samples.as_ref().map(|_| &*canvas.radiance),
            depth: Some(&canvas.depth),
            clear: Some([0.0; 4]),
        };
        cmd.scope("view surfaces", |cmd| {
            cmd.draw(&targets, |drawing| {
                if let Some(shown) = &shown {
                    self.draw_surfaces(drawing, shown, &clip, shot.look);
                }
            });
        });
        cmd.barrier(Stage::Draw, Stage::All);
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
                drawing.vertices(3);
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
        let Some(canvas) = self.canvas.as_ref().filter(|_| self.metering.is_none()) else {
            return false;
        };
        cmd.barrier(Stage::All, Stage::Transfer);
        cmd.scope("view meter", |cmd| {
            cmd.scale(&canvas.radiance, &self.meter);
            cmd.barrier(Stage::Transfer, Stage::Transfer);
            cmd.copy_from_image(&self.meter, &self.metered, 0);
        });
        cmd.barrier(Stage::Transfer, Stage::Host);
        self.probing = false;
        true
    }

    /// As [`Display::measure`], of a picture in false colours: the lux at a place, given as shares of width and height.
    pub fn probe(&mut self, cmd: &mut Commands, at: [f32; 2]) -> bool {
        let Some(canvas) = self.canvas.as_ref().filter(|_| self.metering.is_none()) else {
            return false;
        };
        let pixel = [0, 1].map(|i| {
            let most = canvas.size[i] - 1;
            (at[i].clamp(0.0, 1.0) * canvas.size[i] as f32).min(most as f32) as u32
        });
        cmd.barrier(Stage::All, Stage::Transfer);
        cmd.copy_pixel(&canvas.radiance, pixel, &self.metered);
        cmd.barrier(Stage::Transfer, Stage::Host);
        self.probing = true;
        true
    }

    /// The lux that the last probe found; none where nothing is lit.
    pub fn probed(&self) -> Option<f32> {
        self.probed
    }

    /// The submission that a measurement is part of.
    pub fn measured_by(&mut self, ticket: Ticket) {
        self.metering = Some(Metering {
            ticket,
            factor: self.exposure.factor(),
            probe: self.probing,
        });
    }

    /// The mean luminance of the last picture that was measured, once that is done (or, with `wait`, now), cd/m².
    pub fn take_measurement(&mut self, wait: bool) -> Result<Option<f32>> {
        let Some(metering) = &self.metering else {
            return Ok(None);
        };
        if !wait && !metering.ticket.is_done()? {
            return Ok(None);
        }
        metering.ticket.wait()?;
        if metering.probe {
            self.metering = None;
            let pixel = self
                .metered
                .mapped::<u16>(0..4)
                .into_iter()
                .map(half::f16::from_bits);
            let pixel: Vec<f32> = pixel.map(half::f16::to_f32).collect();
            self.probed = (pixel[3] > 0.5).then(|| pixel[0] / pixel[3] * LUX_STEP as f32);
            return Ok(None);
        }
        let halves = self
            .metered
            .mapped::<u16>(0..(4 * METER[0] * METER[1]) as usize);
        let pixels: Vec<[half::f16; 4]> = halves
            .chunks_exact(4)
            .map(|p| [p[0], p[1], p[2], p[3]].map(half::f16::from_bits))
            .collect();
        let mean = meter(&pixels, metering.factor);
        self.metering = None;
        Ok(mean)
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
        if !self.meshes.contains_key(&look) {
            let options = GraphicsOptions {
                format: Format::Rgba16F,
                samples: self.samples,
                textures: 3,
                depth: DepthUse::Write,
                blend: Blend::Replace,
                topology: Topology::Triangles,
            };
            let (vert, frag) = (shaders::VIEW_MESH_VERT, shaders::VIEW_MESH_FRAG);
            let pipeline = self.gpu.graphics(vert, frag, &constants, &options)?;
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

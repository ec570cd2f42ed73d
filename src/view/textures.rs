//! The scene's images on the device, and per material those that its surfaces are looked up in.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::resolve::PagesView;
use crate::gpu::{Edge, Format, Gpu, Image, ImageOptions, Result, Sampler, Stage, Textures};
use crate::scene::{Scene, Texture, TextureRef, Wrap};

/// What all scenes share.
pub struct Samplers {
    gpu: Gpu,
    white: Arc<Image>,
    samplers: BTreeMap<[Edge; 2], Arc<Sampler>>,
}

/// Images and sets.
#[derive(Default)]
pub(super) struct Materials {
    /// By the address of what they were made from, which is kept, so that it stays an address of that.
    images: BTreeMap<usize, (Arc<Texture>, Arc<Image>)>,
    /// By material.
    pub sets: Vec<Textures>,
    /// For a look at a page of the lightmap.
    pub page: Option<Textures>,
}

impl Samplers {
    /// For a device.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let mut samplers = BTreeMap::new();
        let edges = [Edge::Clamp, Edge::Repeat, Edge::Mirror];
        for u in edges {
            for v in edges {
                samplers.insert([u, v], Arc::new(gpu.sampler(true, [u, v])?));
            }
        }
        Ok(Self {
            white: Arc::new(upload(gpu, "white", [1, 1], &[[255; 4]])?),
            samplers,
            gpu: gpu.clone(),
        })
    }

    pub(super) fn gpu(&self) -> &Gpu {
        &self.gpu
    }
}

impl Materials {
    /// Of a scene; images that `before` has are shared.
    pub(super) fn new(
        samplers: &Samplers,
        scene: &Scene,
        pages: &PagesView,
        before: Option<&Self>,
    ) -> Result<Self> {
        let gpu = &samplers.gpu;
        let mut new = Self::default();
        for (number, texture) in scene.textures.iter().enumerate() {
            let key = Arc::as_ptr(texture) as usize;
            let image = match before.and_then(|b| b.images.get(&key)) {
                Some(known) => known.clone(),
                None => {
                    let name = format!("texture {number}");
                    let size = [texture.width, texture.height];
                    let image = upload(gpu, &name, size, &texture.texels)?;
                    (Arc::clone(texture), Arc::new(image))
                }
            };
            new.images.insert(key, image);
        }
        let clamp = &samplers.samplers[&[Edge::Clamp; 2]];
        let light = (Arc::clone(&pages.image), Arc::clone(clamp));
        let reference = pages.reference.as_ref().unwrap_or(&samplers.white);
        let reference = (Arc::clone(reference), Arc::clone(clamp));
        new.page = Some(gpu.textures(std::slice::from_ref(&light))?);
        new.sets = scene
            .materials
            .iter()
            .map(|m| {
                gpu.textures(&[
                    new.look_up(samplers, scene, &m.base_color_texture),
                    new.look_up(samplers, scene, &m.emission_texture),
                    light.clone(),
                    reference.clone(),
                ])
            })
            .collect::<Result<_>>()?;
        Ok(new)
    }

    fn look_up(
        &self,
        samplers: &Samplers,
        scene: &Scene,
        texture: &Option<TextureRef>,
    ) -> (Arc<Image>, Arc<Sampler>) {
        let edge = |wrap| match wrap {
            Wrap::Clamp => Edge::Clamp,
            Wrap::Repeat => Edge::Repeat,
            Wrap::Mirror => Edge::Mirror,
        };
        let (image, edges) = match texture {
            Some(t) => {
                let key = Arc::as_ptr(&scene.textures[t.texture as usize]) as usize;
                (&self.images[&key].1, t.wrap.map(edge))
            }
            None => (&samplers.white, [Edge::Repeat; 2]),
        };
        (Arc::clone(image), Arc::clone(&samplers.samplers[&edges]))
    }
}

/// An image with all its mips.
fn upload(gpu: &Gpu, name: &str, size: [u32; 2], texels: &[[u8; 4]]) -> Result<Image> {
    let options = ImageOptions {
        size,
        layers: 1,
        mips: true,
        samples: 1,
        format: Format::Srgb8,
    };
    let image = gpu.image(name, &options)?;
    let mut cmd = gpu.commands()?;
    cmd.upload_image(&image, 0, [0, 0], size, texels)?;
    for level in 1..image.mips() {
        cmd.barrier(Stage::Transfer, Stage::Transfer);
        cmd.mip(&image, level);
    }
    cmd.barrier(Stage::Transfer, Stage::All);
    let _in_order = cmd.submit()?;
    Ok(image)
}

//! Samplers, and the sets of images with their samplers that graphics shaders read.

use std::sync::Arc;

use ash::vk;

use super::error::{GpuError, Result};
use super::garbage::Garbage;
use super::{Gpu, Image};

/// How an image is read between and beyond its texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Edge {
    /// The last texel goes on.
    Clamp,
    /// The image starts over.
    Repeat,
    /// The image starts over, mirrored.
    Mirror,
}

/// How an image is read.
pub struct Sampler {
    gpu: Gpu,
    raw: vk::Sampler,
}

/// Images with their samplers, as a shader's set 0 has them: bindings 0, 1, 2...
pub struct Textures {
    gpu: Gpu,
    pool: vk::DescriptorPool,
    layout: vk::DescriptorSetLayout,
    pub(super) set: vk::DescriptorSet,
    pub(super) count: u32,
    // What the set refers to lives as long as the set.
    _images: Vec<(Arc<Image>, Arc<Sampler>)>,
}

impl Gpu {
    /// A sampler: linear between texels and mips, or the nearest texel.
    pub fn sampler(&self, linear: bool, edges: [Edge; 2]) -> Result<Sampler> {
        let edge = |e| match e {
            Edge::Clamp => vk::SamplerAddressMode::CLAMP_TO_EDGE,
            Edge::Repeat => vk::SamplerAddressMode::REPEAT,
            Edge::Mirror => vk::SamplerAddressMode::MIRRORED_REPEAT,
        };
        let (filter, mips) = if linear {
            (vk::Filter::LINEAR, vk::SamplerMipmapMode::LINEAR)
        } else {
            (vk::Filter::NEAREST, vk::SamplerMipmapMode::NEAREST)
        };
        let info = vk::SamplerCreateInfo::default()
            .mag_filter(filter)
            .min_filter(filter)
            .mipmap_mode(mips)
            .address_mode_u(edge(edges[0]))
            .address_mode_v(edge(edges[1]))
            .max_lod(vk::LOD_CLAMP_NONE);
        // SAFETY: the device is alive, the structure is valid.
        let raw = unsafe { self.0.device.create_sampler(&info, None) }
            .map_err(GpuError::call("vkCreateSampler"))?;
        Ok(Sampler {
            gpu: self.clone(),
            raw,
        })
    }

    /// The images as bindings 0, 1, 2... of a shader's set 0.
    pub fn textures(&self, images: &[(Arc<Image>, Arc<Sampler>)]) -> Result<Textures> {
        let count = images.len() as u32;
        let sizes = [vk::DescriptorPoolSize {
            ty: vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
            descriptor_count: count.max(1),
        }];
        let device = &self.0.device;
        // SAFETY: pointers outlive the calls; what was made is owned, and freed, by `textures` from its making on.
        unsafe {
            let layout = self.set_layout(count)?;
            let mut textures = Textures {
                gpu: self.clone(),
                pool: vk::DescriptorPool::null(),
                layout,
                set: vk::DescriptorSet::null(),
                count,
                _images: images.to_vec(),
            };
            let info = vk::DescriptorPoolCreateInfo::default()
                .max_sets(1)
                .pool_sizes(&sizes);
            textures.pool = device
                .create_descriptor_pool(&info, None)
                .map_err(GpuError::call("vkCreateDescriptorPool"))?;
            let layouts = [layout];
            let info = vk::DescriptorSetAllocateInfo::default()
                .descriptor_pool(textures.pool)
                .set_layouts(&layouts);
            textures.set = device
                .allocate_descriptor_sets(&info)
                .map_err(GpuError::call("vkAllocateDescriptorSets"))?[0];
            let infos: Vec<[vk::DescriptorImageInfo; 1]> = images
                .iter()
                .map(|(image, sampler)| {
                    [vk::DescriptorImageInfo {
                        sampler: sampler.raw,
                        image_view: image.view,
                        image_layout: image.layout(),
                    }]
                })
                .collect();
            let writes: Vec<vk::WriteDescriptorSet> = (0..)
                .zip(&infos)
                .map(|(binding, info)| {
                    vk::WriteDescriptorSet::default()
                        .dst_set(textures.set)
                        .dst_binding(binding)
                        .descriptor_type(vk::DescriptorType::COMBINED_IMAGE_SAMPLER)
                        .image_info(info)
                })
                .collect();
            device.update_descriptor_sets(&writes, &[]);
            Ok(textures)
        }
    }

    /// The layout of a set of `count` images.
    pub(super) fn set_layout(&self, count: u32) -> Result<vk::DescriptorSetLayout> {
        let bindings: Vec<_> = (0..count)
            .map(|binding| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding)
                    .descriptor_type(vk::DescriptorType::COMBINED_IMAGE_SAMPLER)
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::FRAGMENT)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: the device is alive, the pointers outlive the call.
        unsafe { self.0.device.create_descriptor_set_layout(&info, None) }
            .map_err(GpuError::call("vkCreateDescriptorSetLayout"))
    }
}

impl Drop for Sampler {
    fn drop(&mut self) {
        self.gpu.queue().discard(Garbage::Sampler(self.raw));
    }
}

impl Drop for Textures {
    fn drop(&mut self) {
        self.gpu
            .queue()
            .discard(Garbage::Set(self.pool, self.layout));
    }
}

//! Images, samplers, and the sets of both that graphics shaders read. Images stay in one layout, `GENERAL`, for life.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator};

use super::error::{GpuError, Result};
use super::queue::Garbage;
use super::{Gpu, Stage};

/// What a pixel holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// 8-bit, linear or already encoded: nothing is converted.
    Rgba8,
    /// The same with red and blue changed over, as window systems have it.
    Bgra8,
    /// 8-bit sRGB, linear to whoever samples it.
    Srgb8,
    /// Half floats.
    Rgba16F,
    /// Depth, 32-bit float.
    Depth,
}

impl Format {
    pub(super) fn raw(self) -> vk::Format {
        match self {
            Self::Rgba8 => vk::Format::R8G8B8A8_UNORM,
            Self::Bgra8 => vk::Format::B8G8R8A8_UNORM,
            Self::Srgb8 => vk::Format::R8G8B8A8_SRGB,
            Self::Rgba16F => vk::Format::R16G16B16A16_SFLOAT,
            Self::Depth => vk::Format::D32_SFLOAT,
        }
    }

    /// Bytes of a pixel.
    pub fn bytes(self) -> u64 {
        if self == Self::Rgba16F { 8 } else { 4 }
    }

    fn aspect(self) -> vk::ImageAspectFlags {
        match self {
            Self::Depth => vk::ImageAspectFlags::DEPTH,
            _ => vk::ImageAspectFlags::COLOR,
        }
    }
}

/// What an image is to be.
#[derive(Clone, Copy, Debug)]
pub struct ImageOptions {
    /// Pixels.
    pub size: [u32; 2],
    /// Of an array; 1 or more.
    pub layers: u32,
    /// With smaller ones down to one pixel; they are the caller's to fill, see [`super::Commands::mip`].
    pub mips: bool,
    /// Samples of a pixel, 1 or what [`Gpu::samples`] says.
    pub samples: u32,
    /// Of a pixel.
    pub format: Format,
}

/// An image. Made for sampling as an array, whatever its number of layers, unless it is a swapchain's.
pub struct Image {
    pub(super) gpu: Gpu,
    pub(super) handle: vk::Image,
    pub(super) view: vk::ImageView,
    allocation: Option<Allocation>,
    bytes: u64,
    options: ImageOptions,
    name: String,
}

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
    /// An image with undefined contents.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`] with `name` and its size.
    pub fn image(&self, name: &str, options: &ImageOptions) -> Result<Image> {
        let mut image = Image {
            gpu: self.clone(),
            handle: vk::Image::null(),
            view: vk::ImageView::null(),
            allocation: None,
            bytes: 0,
            options: *options,
            name: name.to_owned(),
        };
        image.allocate()?;
        let mut cmd = self.commands()?;
        cmd.transition(
            &image,
            vk::ImageLayout::UNDEFINED,
            vk::ImageLayout::GENERAL,
            Stage::All,
        );
        // In order with everything that follows on the queue.
        let _later = cmd.submit()?;
        Ok(image)
    }

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
                        image_layout: vk::ImageLayout::GENERAL,
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

    /// Samples that a pixel of a colour and depth target can have: 4, or 1 where that is not offered.
    pub fn samples(&self) -> u32 {
        // SAFETY: a query on the device's own handle.
        let limits = unsafe {
            let instance = &self.0.instance.raw;
            instance
                .get_physical_device_properties(self.0.info.handle)
                .limits
        };
        let both = limits.framebuffer_color_sample_counts & limits.framebuffer_depth_sample_counts;
        if both.contains(vk::SampleCountFlags::TYPE_4) {
            4
        } else {
            1
        }
    }
}

impl Image {
    fn allocate(&mut self) -> Result<()> {
        let ImageOptions {
            size,
            layers,
            samples,
            format,
            ..
        } = self.options;
        let name = self.name.as_str();
        let out_of_memory = |reason: String| GpuError::OutOfMemory {
            name: name.to_owned(),
            bytes: u64::from(size[0])
                * u64::from(size[1])
                * u64::from(layers * samples)
                * format.bytes(),
            reason,
        };
        let target = match format {
            Format::Depth => vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT,
            _ => vk::ImageUsageFlags::COLOR_ATTACHMENT,
        };
        let rest = vk::ImageUsageFlags::SAMPLED
            | vk::ImageUsageFlags::TRANSFER_SRC
            | vk::ImageUsageFlags::TRANSFER_DST;
        let usage = match (format, samples) {
            // sRGB images are only ever sampled.
            (Format::Srgb8, _) => rest,
            (_, 1) => target | rest,
            _ => target,
        };
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format.raw())
            .extent(vk::Extent3D {
                width: size[0].max(1),
                height: size[1].max(1),
                depth: 1,
            })
            .mip_levels(self.mips())
            .array_layers(layers)
            .samples(vk::SampleCountFlags::from_raw(samples))
            .usage(usage);
        let shared = &self.gpu.0;
        let device = &shared.device;
        let mut allocator = shared.allocator.lock().unwrap_or_else(|e| e.into_inner());
        let allocator = allocator
            .as_mut()
            .ok_or_else(|| out_of_memory("the device is gone".into()))?;
        // SAFETY: creation, allocation, binding and view in Vulkan's order; on failure `drop` frees what is there.
        unsafe {
            let handle = device
                .create_image(&info, None)
                .map_err(|e| out_of_memory(e.to_string()))?;
            let requirements = device.get_image_memory_requirements(handle);
            let allocation = allocator.allocate(&AllocationCreateDesc {
                name,
                requirements,
                location: MemoryLocation::GpuOnly,
                linear: false,
                allocation_scheme: AllocationScheme::GpuAllocatorManaged,
            });
            let allocation = match allocation {
                Ok(allocation) => allocation,
                Err(reason) => {
                    device.destroy_image(handle, None);
                    return Err(out_of_memory(reason.to_string()));
                }
            };
            self.bytes = requirements.size;
            let live = shared.allocated.fetch_add(self.bytes, Ordering::Relaxed) + self.bytes;
            shared.peak.fetch_max(live, Ordering::Relaxed);
            let bound = device.bind_image_memory(handle, allocation.memory(), allocation.offset());
            self.handle = handle;
            self.allocation = Some(allocation);
            bound.map_err(GpuError::call(format!("vkBindImageMemory ({name})")))?;
        }
        self.gpu.set_name(self.handle, name);
        let sampled = samples == 1 && format != Format::Depth;
        self.view = self
            .gpu
            .view(self.handle, format, self.mips(), layers, sampled)?;
        Ok(())
    }

    /// An image of the window system's.
    pub(super) fn foreign(
        gpu: &Gpu,
        handle: vk::Image,
        format: Format,
        size: [u32; 2],
    ) -> Result<Self> {
        Ok(Self {
            gpu: gpu.clone(),
            handle,
            view: gpu.view(handle, format, 1, 1, false)?,
            allocation: None,
            bytes: 0,
            options: ImageOptions {
                size,
                layers: 1,
                mips: false,
                samples: 1,
                format,
            },
            name: "window".into(),
        })
    }

    /// Pixels.
    pub fn size(&self) -> [u32; 2] {
        self.options.size
    }

    /// Of an array.
    pub fn layers(&self) -> u32 {
        self.options.layers
    }

    /// Of a pixel.
    pub fn format(&self) -> Format {
        self.options.format
    }

    /// Samples of a pixel.
    pub fn samples(&self) -> u32 {
        self.options.samples
    }

    /// Number of sizes that it comes in.
    pub fn mips(&self) -> u32 {
        let largest = self.options.size[0].max(self.options.size[1]).max(1);
        if self.options.mips {
            1 + largest.ilog2()
        } else {
            1
        }
    }

    /// Its size at a mip level.
    pub(super) fn mip_size(&self, level: u32) -> [i32; 2] {
        self.options.size.map(|s| (s >> level).max(1) as i32)
    }

    /// The name it was made with.
    pub fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn range(&self) -> vk::ImageSubresourceRange {
        vk::ImageSubresourceRange {
            aspect_mask: self.options.format.aspect(),
            base_mip_level: 0,
            level_count: vk::REMAINING_MIP_LEVELS,
            base_array_layer: 0,
            layer_count: vk::REMAINING_ARRAY_LAYERS,
        }
    }

    pub(super) fn part(&self, level: u32, layers: Range<u32>) -> vk::ImageSubresourceLayers {
        vk::ImageSubresourceLayers {
            aspect_mask: self.options.format.aspect(),
            mip_level: level,
            base_array_layer: layers.start,
            layer_count: layers.len() as u32,
        }
    }
}

impl Gpu {
    fn view(
        &self,
        image: vk::Image,
        format: Format,
        mips: u32,
        layers: u32,
        sampled: bool,
    ) -> Result<vk::ImageView> {
        let info = vk::ImageViewCreateInfo::default()
            .image(image)
            .view_type(if sampled {
                vk::ImageViewType::TYPE_2D_ARRAY
            } else {
                vk::ImageViewType::TYPE_2D
            })
            .format(format.raw())
            .subresource_range(vk::ImageSubresourceRange {
                aspect_mask: format.aspect(),
                base_mip_level: 0,
                level_count: mips,
                base_array_layer: 0,
                layer_count: layers,
            });
        // SAFETY: the image is alive and of this format.
        unsafe { self.0.device.create_image_view(&info, None) }
            .map_err(GpuError::call("vkCreateImageView"))
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        let shared = &self.gpu.0;
        shared.allocated.fetch_sub(self.bytes, Ordering::Relaxed);
        self.gpu.queue().discard(Garbage::Image {
            handle: self.handle,
            view: self.view,
            allocation: self.allocation.take(),
        });
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

/// # Safety
/// The device is done with the image.
pub(super) unsafe fn destroy(
    handle: vk::Image,
    view: vk::ImageView,
    allocation: Option<Allocation>,
    device: &ash::Device,
    allocator: &mut Allocator,
) {
    // SAFETY: the caller's promise; an image without an allocation is the window system's.
    unsafe {
        device.destroy_image_view(view, None);
        if let Some(allocation) = allocation {
            device.destroy_image(handle, None);
            if let Err(error) = allocator.free(allocation) {
                tracing::error!("freeing an image: {error}");
            }
        }
    }
}

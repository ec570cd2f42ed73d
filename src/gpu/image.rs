//! Images. Each has a layout of its own, the one that it is mostly used in, and is in it whenever no command works on it: whatever
//! uses it in another one brings it there and back. So threads may record in any order.

use std::ops::Range;

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator};

use super::error::{GpuError, Result};
use super::garbage::Garbage;
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
            image.layout(),
            Stage::All,
        );
        // In order with everything that follows on the queue.
        let _later = cmd.submit()?;
        Ok(image)
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
            shared.came(name, self.bytes);
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

    /// The layout that it is in whenever no command works on it.
    pub(super) fn layout(&self) -> vk::ImageLayout {
        match self.options.format {
            Format::Depth => vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL,
            // Never sampled: more than one sample, or a window's.
            _ if self.options.samples > 1 || self.allocation.is_none() => {
                vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL
            }
            _ => vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
        }
    }

    /// The layout that it is drawn into in.
    pub(super) fn drawn_layout(&self) -> vk::ImageLayout {
        match self.options.format {
            Format::Depth => vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL,
            _ => vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
        }
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

    /// All layers of some levels.
    pub(super) fn levels(&self, levels: Range<u32>) -> vk::ImageSubresourceRange {
        vk::ImageSubresourceRange {
            aspect_mask: self.options.format.aspect(),
            base_mip_level: levels.start,
            level_count: levels.len() as u32,
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
        shared.went(&self.name, self.bytes);
        self.gpu.queue().discard(Garbage::Image {
            handle: self.handle,
            view: self.view,
            allocation: self.allocation.take(),
        });
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

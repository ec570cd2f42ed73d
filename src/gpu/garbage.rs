//! What the device may still use although nobody else does: freed once it is done with it.

use std::any::Any;
use std::sync::Arc;

use ash::{khr, vk};
use gpu_allocator::vulkan::{Allocation, Allocator};

use super::buffer::RawBuffer;

/// Something to free once the device is done with it.
pub(super) enum Garbage {
    Buffer(RawBuffer),
    Pipeline(vk::Pipeline, vk::PipelineLayout),
    Image {
        handle: vk::Image,
        view: vk::ImageView,
        allocation: Option<Allocation>,
    },
    Sampler(vk::Sampler),
    Set(vk::DescriptorPool, vk::DescriptorSetLayout),
    Semaphore(vk::Semaphore),
    Swapchain(khr::swapchain::Device, vk::SwapchainKHR),
    /// With the window that it belongs to.
    Surface(
        khr::surface::Instance,
        vk::SurfaceKHR,
        Arc<dyn Any + Send + Sync>,
    ),
}

impl Garbage {
    /// # Safety
    /// The device is done with it.
    pub(super) unsafe fn destroy(self, device: &ash::Device, allocator: &mut Allocator) {
        // SAFETY: the caller's promise.
        unsafe {
            match self {
                Garbage::Buffer(buffer) => buffer.destroy(device, allocator),
                Garbage::Pipeline(pipeline, layout) => {
                    device.destroy_pipeline(pipeline, None);
                    device.destroy_pipeline_layout(layout, None);
                }
                Garbage::Image {
                    handle,
                    view,
                    allocation,
                } => super::image::destroy(handle, view, allocation, device, allocator),
                Garbage::Sampler(sampler) => device.destroy_sampler(sampler, None),
                Garbage::Semaphore(semaphore) => device.destroy_semaphore(semaphore, None),
                Garbage::Swapchain(loader, swapchain) => loader.destroy_swapchain(swapchain, None),
                Garbage::Surface(loader, surface, window) => {
                    loader.destroy_surface(surface, None);
                    drop(window);
                }
                Garbage::Set(pool, layout) => {
                    device.destroy_descriptor_pool(pool, None);
                    device.destroy_descriptor_set_layout(layout, None);
                }
            }
        }
    }
}

//! Vulkan, and the only unsafe code: device, buffers by address, images, pipelines, commands, uploads, timestamps.
//! Knows nothing of light.
//!
//! One [`Gpu`] is shared by cheap clones; [`Buffer`] and [`Pipeline`] hold one and free themselves when dropped, after
//! the last submission that can use them. Work is recorded with [`Gpu::commands`], sent with [`Commands::submit`], and
//! ordered on the device by barriers, towards the host by [`Ticket`]s.
#![allow(unsafe_code, reason = "this is the one room that talks to the driver")]

mod buffer;
mod clock;
mod commands;
mod draw;
mod error;
mod features;
mod garbage;
mod graphics;
mod image;
mod image_copies;
mod instance;
mod pipeline;
mod queue;
mod recording;
mod swapchain;
#[cfg(test)]
pub(crate) mod testing;
mod textures;
mod ticket;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

use ash::{ext, vk};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use raw_window_handle::HasDisplayHandle;

pub use buffer::{Address, Buffer, Memory};
pub use commands::{Commands, Stage};
pub use draw::{DepthTarget, Drawing, Sides, Targets};
pub use error::{GpuError, Result};
pub use graphics::{Blend, DepthUse, GraphicsOptions, GraphicsPipeline, Topology};
pub use image::{Format, Image, ImageOptions};
pub use instance::{DeviceInfo, GpuOptions};
pub use pipeline::{Pipeline, Shader};
pub use swapchain::{Frame, Swapchain};
pub use textures::{Edge, Sampler, Textures};
pub use ticket::{Ticket, Timing};

use clock::Clock;
use features::Features;
use instance::Instance;
use queue::Queue;

/// A device and its one queue. Clones share it.
#[derive(Clone)]
pub struct Gpu(Arc<Shared>);

struct Shared {
    info: DeviceInfo,
    timestamp_ns: f64,
    max_groups: [u32; 3],
    /// What the queue can count, where the device counts at all.
    statistics: Option<vk::QueryPipelineStatisticFlags>,
    /// Bytes in live buffers, and their peak.
    allocated: AtomicU64,
    peak: AtomicU64,
    /// Likewise by name.
    named: Mutex<BTreeMap<String, [u64; 2]>>,
    queue: Mutex<Queue>,
    /// Held while something is handed to the device's queue; taken after `queue`, which need not be held: where the driver draws by
    /// itself, presenting a picture takes as long as drawing it, and others record meanwhile.
    turn: Mutex<()>,
    /// Taken out first when the device goes.
    allocator: Mutex<Option<Allocator>>,
    debug: Option<ext::debug_utils::Device>,
    device: ash::Device,
    instance: Instance,
}

impl Shared {
    /// The right to hand something to the device's queue.
    fn turn(&self) -> MutexGuard<'_, ()> {
        self.turn.lock().unwrap_or_else(|e| e.into_inner())
    }

    /// Counts what was allocated.
    fn came(&self, name: &str, bytes: u64) {
        let live = self.allocated.fetch_add(bytes, Ordering::Relaxed) + bytes;
        self.peak.fetch_max(live, Ordering::Relaxed);
        let mut named = self.named.lock().unwrap_or_else(|e| e.into_inner());
        if !named.contains_key(name) {
            named.insert(name.to_owned(), [0; 2]);
        }
        if let Some([live, peak]) = named.get_mut(name) {
            *live += bytes;
            *peak = (*peak).max(*live);
        }
    }

    /// Counts what is given back.
    fn went(&self, name: &str, bytes: u64) {
        self.allocated.fetch_sub(bytes, Ordering::Relaxed);
        let mut named = self.named.lock().unwrap_or_else(|e| e.into_inner());
        if let Some([live, _]) = named.get_mut(name) {
            *live = live.saturating_sub(bytes);
        }
    }
}

/// Lists every device with what it lacks.
pub fn devices() -> Result<Vec<DeviceInfo>> {
    Instance::new(false, &[])?.devices()
}

impl Gpu {
    /// Opens a device without a window.
    ///
    /// # Errors
    /// No loader, no device that matches, a missing feature (by name), no validation layer when it was asked for.
    pub fn new(options: &GpuOptions) -> Result<Self> {
        Self::open(options, &[])
    }

    /// Opens a device that can draw into windows of a display: see [`Gpu::swapchain`].
    ///
    /// # Errors
    /// As [`Gpu::new`], and [`GpuError::NoWindow`].
    pub fn for_window(options: &GpuOptions, display: &impl HasDisplayHandle) -> Result<Self> {
        let display = display
            .display_handle()
            .map_err(|e| GpuError::NoWindow(e.to_string()))?;
        let extensions = ash_window::enumerate_required_extensions(display.as_raw())
            .map_err(|e| GpuError::NoWindow(e.to_string()))?;
        Self::open(options, extensions)
    }

    fn open(options: &GpuOptions, window: &[*const std::ffi::c_char]) -> Result<Self> {
        let instance = Instance::new(options.validate, window)?;
        let info = instance.choose(options.device.as_deref())?;
        // SAFETY: handles come from this instance; all pointers outlive the calls.
        unsafe {
            let properties = instance.raw.get_physical_device_properties(info.handle);
            let families = instance
                .raw
                .get_physical_device_queue_family_properties(info.handle);
            let family = families
                .iter()
                .enumerate()
                .filter(|(_, family)| {
                    family.queue_flags.contains(vk::QueueFlags::COMPUTE)
                        && family.timestamp_valid_bits > 0
                })
                // One that draws too, where there is one: the viewer's.
                .min_by_key(|(i, family)| {
                    (!family.queue_flags.contains(vk::QueueFlags::GRAPHICS), *i)
                })
                .map(|(i, _)| i)
                .ok_or_else(|| GpuError::Lacks {
                    device: info.name.clone(),
                    missing: "a compute queue with timestamps".into(),
                })? as u32;

            let queues = [vk::DeviceQueueCreateInfo::default()
                .queue_family_index(family)
                .queue_priorities(&[1.0])];
            let counts = Features::supported(&instance.raw, info.handle).counts();
            let draws = families[family as usize]
                .queue_flags
                .contains(vk::QueueFlags::GRAPHICS);
            let statistics = counts.then(|| counted(draws));
            let mut required = features::required().with_counts(counts);
            let mut chain = required.chain();
            // Traces do without, less exactly.
            let calibrates = instance.calibrates(&info);
            let extensions: Vec<_> = [
                (!window.is_empty()).then_some(ash::khr::swapchain::NAME.as_ptr()),
                calibrates.then_some(ext::calibrated_timestamps::NAME.as_ptr()),
            ]
            .into_iter()
            .flatten()
            .collect();
            let create = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&extensions)
                .push_next(&mut chain);
            let device = instance
                .raw
                .create_device(info.handle, &create, None)
                .map_err(GpuError::call(format!("vkCreateDevice ({})", info.name)))?;
            let debug = instance
                .has_debug_utils
                .then(|| ext::debug_utils::Device::new(&instance.raw, &device));
            let clock = Clock::new(
                calibrates.then(|| ext::calibrated_timestamps::Device::new(&instance.raw, &device)),
            );

            let made = Allocator::new(&AllocatorCreateDesc {
                instance: instance.raw.clone(),
                device: device.clone(),
                physical_device: info.handle,
                debug_settings: Default::default(),
                buffer_device_address: true,
                allocation_sizes: Default::default(),
            })
            .map_err(|e| GpuError::OutOfMemory {
                name: "allocator".into(),
                bytes: 0,
                reason: e.to_string(),
            })
            .and_then(|allocator| Ok((allocator, Queue::new(&device, family, clock)?)));
            let (allocator, queue) = match made {
                Ok(made) => made,
                Err(error) => {
                    device.destroy_device(None);
                    return Err(error);
                }
            };
            Ok(Self(Arc::new(Shared {
                timestamp_ns: f64::from(properties.limits.timestamp_period),
                max_groups: properties.limits.max_compute_work_group_count,
                statistics,
                info,
                allocated: AtomicU64::new(0),
                peak: AtomicU64::new(0),
                named: Mutex::default(),
                queue: Mutex::new(queue),
                turn: Mutex::new(()),
                allocator: Mutex::new(Some(allocator)),
                debug,
                device,
                instance,
            })))
        }
    }

    /// What it runs on.
    pub fn info(&self) -> &DeviceInfo {
        &self.0.info
    }

    /// The most bytes that live buffers ever held at once.
    pub fn peak_bytes(&self) -> u64 {
        self.0.peak.load(Ordering::Relaxed)
    }

    /// The most bytes that live buffers and images of a name ever held at once, by name.
    pub fn allocations(&self) -> BTreeMap<String, u64> {
        let named = self.0.named.lock().unwrap_or_else(|e| e.into_inner());
        named
            .iter()
            .map(|(n, [_, peak])| (n.clone(), *peak))
            .collect()
    }

    /// The bytes that live buffers and images hold.
    pub fn live_bytes(&self) -> u64 {
        self.0.allocated.load(Ordering::Relaxed)
    }

    /// An error if the validation layer has said anything since the last call.
    pub fn check_validation(&self) -> Result<()> {
        self.0
            .instance
            .messages
            .take()
            .map_or(Ok(()), |text| Err(GpuError::Validation(text)))
    }

    fn queue(&self) -> MutexGuard<'_, Queue> {
        self.0.queue.lock().unwrap_or_else(|e| e.into_inner())
    }

    fn turn(&self) -> MutexGuard<'_, ()> {
        self.0.turn()
    }

    fn set_name(&self, handle: impl vk::Handle, name: &str) {
        if let Some(debug) = &self.0.debug {
            let name = std::ffi::CString::new(name.replace('\0', " ")).unwrap_or_default();
            let info = vk::DebugUtilsObjectNameInfoEXT::default()
                .object_handle(handle)
                .object_name(&name);
            // SAFETY: the handle is alive: its owner calls this. A failure only loses the label.
            if let Err(result) = unsafe { debug.set_debug_utils_object_name(&info) } {
                tracing::debug!("naming {name:?}: {result}");
            }
        }
    }
}

/// What is counted on a queue that draws, or on one that only computes; in the order of [`crate::trace::PassCounts`].
fn counted(draws: bool) -> vk::QueryPipelineStatisticFlags {
    use vk::QueryPipelineStatisticFlags as Kind;
    let drawn = Kind::VERTEX_SHADER_INVOCATIONS
        | Kind::CLIPPING_PRIMITIVES
        | Kind::FRAGMENT_SHADER_INVOCATIONS;
    if draws {
        drawn | Kind::COMPUTE_SHADER_INVOCATIONS
    } else {
        Kind::COMPUTE_SHADER_INVOCATIONS
    }
}

impl Drop for Shared {
    fn drop(&mut self) {
        // SAFETY: the last clone goes: no buffer, pipeline or recording is left. The device finishes, then everything
        // that waited for it is freed, then the allocator, then the device; the instance follows as a field.
        unsafe {
            if let Err(result) = self.device.device_wait_idle() {
                tracing::debug!("vkDeviceWaitIdle at the end: {result}");
            }
            let mut allocator = self
                .allocator
                .lock()
                .unwrap_or_else(|e| e.into_inner())
                .take();
            let queue = self.queue.get_mut().unwrap_or_else(|e| e.into_inner());
            queue.destroy(&self.device, allocator.as_mut());
            drop(allocator);
            self.device.destroy_device(None);
        }
    }
}

//! A window's images: taken, drawn into, shown.

use std::sync::Arc;

use ash::{khr, vk};
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};

use super::commands::{Commands, Stage};
use super::error::{GpuError, Result};
use super::garbage::Garbage;
use super::image::{Format, Image};
use super::{Gpu, Ticket};

/// Frames that the device may be behind.
const BEHIND: usize = 2;
/// How long to wait for the window system to give an image back, nanoseconds.
const PATIENCE: u64 = 100_000_000;

/// What a window shows, and what its next pictures are drawn into.
pub struct Swapchain {
    gpu: Gpu,
    /// Must outlive its surface.
    window: Arc<dyn std::any::Any + Send + Sync>,
    surface: vk::SurfaceKHR,
    surfaces: khr::surface::Instance,
    swapchains: khr::swapchain::Device,
    raw: vk::SwapchainKHR,
    images: Vec<Image>,
    /// Signalled when the device may draw into an image; taken in turn.
    free: [vk::Semaphore; BEHIND],
    /// What was submitted last for each.
    tickets: [Option<Ticket>; BEHIND],
    turn: usize,
    /// Pictures sent so far.
    sent: u64,
    /// Signalled when an image is drawn, by image.
    drawn: Vec<vk::Semaphore>,
    format: vk::SurfaceFormatKHR,
    size: [u32; 2],
    stale: bool,
}

/// An image of the window's, taken for one picture.
#[must_use = "an image that is taken has to be shown"]
pub struct Frame {
    index: u32,
}

impl Gpu {
    /// Makes a window's swapchain. The device must have been opened by [`Gpu::for_window`] with the same display.
    ///
    /// # Errors
    /// The window system, or a device that cannot draw into it.
    pub fn swapchain<W>(&self, window: Arc<W>, size: [u32; 2]) -> Result<Swapchain>
    where
        W: HasDisplayHandle + HasWindowHandle + Send + Sync + 'static,
    {
        let shared = &self.0;
        let no_window = |why: String| GpuError::NoWindow(why);
        let display = window
            .display_handle()
            .map_err(|e| no_window(e.to_string()))?;
        let handle = window
            .window_handle()
            .map_err(|e| no_window(e.to_string()))?;
        let surfaces = khr::surface::Instance::new(&shared.instance.entry, &shared.instance.raw);
        // SAFETY: the handles are alive, and kept so by `window`; pointers outlive the calls.
        unsafe {
            let surface = ash_window::create_surface(
                &shared.instance.entry,
                &shared.instance.raw,
                display.as_raw(),
                handle.as_raw(),
                None,
            )
            .map_err(GpuError::call("creating the window's surface"))?;
            let mut swapchain = Swapchain {
                gpu: self.clone(),
                window: window.clone(),
                surface,
                swapchains: khr::swapchain::Device::new(&shared.instance.raw, &shared.device),
                surfaces,
                raw: vk::SwapchainKHR::null(),
                images: Vec::new(),
                free: [vk::Semaphore::null(); BEHIND],
                tickets: [const { None }; BEHIND],
                turn: 0,
                sent: 0,
                drawn: Vec::new(),
                format: vk::SurfaceFormatKHR::default(),
                size,
                stale: true,
            };
            for free in &mut swapchain.free {
                *free = semaphore(self)?;
            }
            let (physical, family) = (shared.info.handle, self.queue().family());
            let can = swapchain
                .surfaces
                .get_physical_device_surface_support(physical, family, surface)
                .map_err(GpuError::call("vkGetPhysicalDeviceSurfaceSupportKHR"))?;
            if !can {
                return Err(GpuError::Lacks {
                    device: shared.info.name.clone(),
                    missing: "a queue that can draw into this window".into(),
                });
            }
            let formats = swapchain
                .surfaces
                .get_physical_device_surface_formats(physical, surface)
                .map_err(GpuError::call("vkGetPhysicalDeviceSurfaceFormatsKHR"))?;
            let wanted = [Format::Bgra8, Format::Rgba8];
            swapchain.format = *wanted
                .iter()
                .find_map(|w| formats.iter().find(|f| f.format == w.raw()))
                .ok_or_else(|| GpuError::Lacks {
                    device: shared.info.name.clone(),
                    missing: "a window format of 8 bits a channel".into(),
                })?;
            Ok(swapchain)
        }
    }
}

impl Swapchain {
    /// The window has another size now; 0 while it is minimised.
    pub fn resize(&mut self, size: [u32; 2]) {
        self.stale |= self.size != size;
        self.size = size;
    }

    /// Of its pixels.
    pub fn format(&self) -> Format {
        if self.format.format == Format::Bgra8.raw() {
            Format::Bgra8
        } else {
            Format::Rgba8
        }
    }

    /// Takes an image for the next picture; none while there is nothing to draw into: a minimised window, or one whose
    /// size is just changing. Waits while the device is two pictures behind.
    ///
    /// # Errors
    /// A lost window or device.
    pub fn acquire(&mut self) -> Result<Option<Frame>> {
        if let Some(ticket) = self.tickets[self.turn].take() {
            ticket.wait()?;
        }
        if self.size.contains(&0) || (self.stale && !self.make()?) {
            return Ok(None);
        }
        // SAFETY: the semaphore's last submission was waited for.
        let taken = unsafe {
            self.swapchains.acquire_next_image(
                self.raw,
                PATIENCE,
                self.free[self.turn],
                vk::Fence::null(),
            )
        };
        match taken {
            Ok((index, suboptimal)) => {
                self.stale |= suboptimal;
                Ok(Some(Frame { index }))
            }
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => {
                self.stale = true;
                Ok(None)
            }
            Err(vk::Result::TIMEOUT | vk::Result::NOT_READY) => Ok(None),
            Err(result) => Err(GpuError::call("vkAcquireNextImageKHR")(result)),
        }
    }

    /// Pictures sent so far.
    pub fn sent(&self) -> u64 {
        self.sent
    }

    /// Of these, how many the device has finished: as far as this program can know, they have been seen.
    ///
    /// # Errors
    /// A lost device.
    pub fn finished(&self) -> Result<u64> {
        let mut behind = 0;
        for ticket in self.tickets.iter().flatten() {
            behind += u64::from(!ticket.is_done()?);
        }
        Ok(self.sent - behind)
    }

    /// What a frame is drawn into.
    pub fn image(&self, frame: &Frame) -> &Image {
        &self.images[frame.index as usize]
    }

    /// Makes the frame's image ready to be drawn into; recorded before anything else that touches it.
    pub fn begin(&self, cmd: &mut Commands, frame: &Frame) {
        let image = self.image(frame);
        let from = vk::ImageLayout::UNDEFINED;
        cmd.transition(image, from, image.layout(), Stage::All);
    }

    /// Sends what was recorded, and shows the image when it is done. `sent`: called in between, as soon as what others submit comes
    /// after it.
    ///
    /// # Errors
    /// A lost window or device.
    pub fn present(
        &mut self,
        mut cmd: Commands,
        frame: Frame,
        sent: impl FnOnce(),
    ) -> Result<Ticket> {
        let image = self.image(&frame);
        let to = vk::ImageLayout::PRESENT_SRC_KHR;
        cmd.transition(image, image.layout(), to, Stage::All);
        let drawn = self.drawn[frame.index as usize];
        let gpu = self.gpu.clone();
        let (ticket, queue, turn) = cmd.submit_for_window(&gpu, self.free[self.turn], drawn)?;
        sent();
        self.tickets[self.turn] = Some(ticket.clone());
        self.sent += 1;
        self.turn = (self.turn + 1) % BEHIND;
        let (waits, swapchains, indices) = ([drawn], [self.raw], [frame.index]);
        let info = vk::PresentInfoKHR::default()
            .wait_semaphores(&waits)
            .swapchains(&swapchains)
            .image_indices(&indices);
        // SAFETY: it is our turn; the image was acquired and its drawing signals the semaphore.
        let shown = unsafe { self.swapchains.queue_present(queue, &info) };
        drop(turn);
        match shown {
            Ok(suboptimal) => self.stale |= suboptimal,
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => self.stale = true,
            Err(result) => return Err(GpuError::call("vkQueuePresentKHR")(result)),
        }
        Ok(ticket)
    }

    /// Makes the images anew for the window as it is; whether there are any.
    fn make(&mut self) -> Result<bool> {
        for ticket in self.tickets.iter_mut().filter_map(Option::take) {
            ticket.wait()?;
        }
        let shared = &self.gpu.0;
        let physical = shared.info.handle;
        // SAFETY: the surface is alive; what is replaced is no longer in use, which the idle queue makes sure.
        unsafe {
            self.gpu.queue().idle(shared)?;
            let can = self
                .surfaces
                .get_physical_device_surface_capabilities(physical, self.surface)
                .map_err(GpuError::call("vkGetPhysicalDeviceSurfaceCapabilitiesKHR"))?;
            let modes = self
                .surfaces
                .get_physical_device_surface_present_modes(physical, self.surface)
                .map_err(GpuError::call("vkGetPhysicalDeviceSurfacePresentModesKHR"))?;
            let size = match can.current_extent {
                vk::Extent2D {
                    width: u32::MAX, ..
                } => self.size,
                extent => [extent.width, extent.height],
            };
            if size.contains(&0) {
                return Ok(false);
            }
            let most = if can.max_image_count == 0 {
                u32::MAX
            } else {
                can.max_image_count
            };
            let info = vk::SwapchainCreateInfoKHR::default()
                .surface(self.surface)
                .min_image_count((can.min_image_count + 1).min(most))
                .image_format(self.format.format)
                .image_color_space(self.format.color_space)
                .image_extent(vk::Extent2D {
                    width: size[0],
                    height: size[1],
                })
                .image_array_layers(1)
                .image_usage(
                    vk::ImageUsageFlags::COLOR_ATTACHMENT
                        | (can.supported_usage_flags & vk::ImageUsageFlags::TRANSFER_SRC),
                )
                .pre_transform(can.current_transform)
                .composite_alpha(vk::CompositeAlphaFlagsKHR::OPAQUE)
                .present_mode(if modes.contains(&vk::PresentModeKHR::MAILBOX) {
                    vk::PresentModeKHR::MAILBOX
                } else {
                    vk::PresentModeKHR::FIFO
                })
                .clipped(true)
                .old_swapchain(self.raw);
            let new = self
                .swapchains
                .create_swapchain(&info, None)
                .map_err(GpuError::call("vkCreateSwapchainKHR"))?;
            self.clear();
            self.raw = new;
            let images = self
                .swapchains
                .get_swapchain_images(new)
                .map_err(GpuError::call("vkGetSwapchainImagesKHR"))?;
            for handle in images {
                self.images
                    .push(Image::foreign(&self.gpu, handle, self.format(), size)?);
                self.drawn.push(semaphore(&self.gpu)?);
            }
            self.size = size;
            self.stale = false;
            Ok(true)
        }
    }

    /// Takes down what was made for the window's size.
    fn clear(&mut self) {
        // Views before their swapchain: all of it goes through the queue's garbage, in order.
        self.images.clear();
        let mut queue = self.gpu.queue();
        for semaphore in self.drawn.drain(..) {
            queue.discard(Garbage::Semaphore(semaphore));
        }
        queue.discard(Garbage::Swapchain(self.swapchains.clone(), self.raw));
    }
}

fn semaphore(gpu: &Gpu) -> Result<vk::Semaphore> {
    let info = vk::SemaphoreCreateInfo::default();
    // SAFETY: the device is alive.
    unsafe { gpu.0.device.create_semaphore(&info, None) }
        .map_err(GpuError::call("vkCreateSemaphore"))
}

impl Drop for Swapchain {
    fn drop(&mut self) {
        // Through the queue's garbage, in order, each after what was made from it; the window stays until its surface is gone.
        self.images.clear();
        let mut queue = self.gpu.queue();
        for semaphore in self.free.into_iter().chain(self.drawn.drain(..)) {
            queue.discard(Garbage::Semaphore(semaphore));
        }
        queue.discard(Garbage::Swapchain(self.swapchains.clone(), self.raw));
        let window: Arc<dyn std::any::Any + Send + Sync> = self.window.clone();
        queue.discard(Garbage::Surface(
            self.surfaces.clone(),
            self.surface,
            window,
        ));
        if let Err(error) = queue.idle(&self.gpu.0) {
            tracing::debug!("waiting for the window's last frame: {error}");
        }
    }
}

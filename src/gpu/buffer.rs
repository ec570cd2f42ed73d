//! Buffers: named, addressed, freed when the device is done with them.

use std::ops::Range;

use ash::vk;
use bytemuck::Pod;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator};

use super::error::{GpuError, Result};
use super::garbage::Garbage;
use super::queue::MAX_UPLOAD;
use super::{Gpu, Shared, Stage};

/// A device address as shaders see it, in push constants and structs: low word, high word, so that a structure that ends
/// in a 32-bit member has no padding. It must lie at a multiple of 8 bytes.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Address([u32; 2]);

impl Address {
    fn new(address: u64) -> Self {
        Self([address as u32, (address >> 32) as u32])
    }

    fn plus(self, offset: u64) -> Self {
        Self::new((u64::from(self.0[1]) << 32 | u64::from(self.0[0])) + offset)
    }
}

/// Which side of the bus a buffer lies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Memory {
    /// Device only.
    Device,
    /// The host writes, the device reads.
    Upload,
    /// The device writes, the host reads.
    Readback,
}

/// A buffer that shaders reach by its [`Address`].
pub struct Buffer {
    pub(super) gpu: Gpu,
    pub(super) raw: RawBuffer,
    name: String,
}

/// Handle and memory; whoever owns it frees it.
#[derive(Default)]
pub(super) struct RawBuffer {
    pub(super) handle: vk::Buffer,
    pub(super) allocation: Option<Allocation>,
    pub(super) address: Address,
    pub(super) size: u64,
}

impl RawBuffer {
    pub(super) fn new(shared: &Shared, name: &str, size: u64, memory: Memory) -> Result<Self> {
        let size = size.max(16);
        let device = &shared.device;
        let out_of_memory = |reason: String| GpuError::OutOfMemory {
            name: name.to_owned(),
            bytes: size,
            reason,
        };
        let info = vk::BufferCreateInfo::default().size(size).usage(
            vk::BufferUsageFlags::STORAGE_BUFFER
                | vk::BufferUsageFlags::INDIRECT_BUFFER
                | vk::BufferUsageFlags::INDEX_BUFFER
                | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS
                | vk::BufferUsageFlags::TRANSFER_SRC
                | vk::BufferUsageFlags::TRANSFER_DST,
        );
        let mut allocator = shared.allocator.lock().unwrap_or_else(|e| e.into_inner());
        let allocator = allocator
            .as_mut()
            .ok_or_else(|| out_of_memory("the device is gone".into()))?;
        // SAFETY: creation, allocation and binding in the order Vulkan wants; each failure frees what was made before.
        unsafe {
            let handle = device
                .create_buffer(&info, None)
                .map_err(|e| out_of_memory(e.to_string()))?;
            let allocation = allocator.allocate(&AllocationCreateDesc {
                name,
                requirements: device.get_buffer_memory_requirements(handle),
                location: match memory {
                    Memory::Device => MemoryLocation::GpuOnly,
                    Memory::Upload => MemoryLocation::CpuToGpu,
                    Memory::Readback => MemoryLocation::GpuToCpu,
                },
                linear: true,
                allocation_scheme: AllocationScheme::GpuAllocatorManaged,
            });
            let allocation = match allocation {
                Ok(allocation) => allocation,
                Err(reason) => {
                    device.destroy_buffer(handle, None);
                    return Err(out_of_memory(reason.to_string()));
                }
            };
            if let Err(result) =
                device.bind_buffer_memory(handle, allocation.memory(), allocation.offset())
            {
                RawBuffer {
                    handle,
                    allocation: Some(allocation),
                    ..Self::default()
                }
                .destroy(device, allocator);
                return Err(GpuError::call(format!("vkBindBufferMemory ({name})"))(
                    result,
                ));
            }
            let address = device
                .get_buffer_device_address(&vk::BufferDeviceAddressInfo::default().buffer(handle));
            shared.came(name, size);
            Ok(Self {
                handle,
                allocation: Some(allocation),
                address: Address::new(address),
                size,
            })
        }
    }

    /// # Safety
    /// The device is done with it.
    pub(super) unsafe fn destroy(mut self, device: &ash::Device, allocator: &mut Allocator) {
        // SAFETY: the caller's promise.
        unsafe { device.destroy_buffer(self.handle, None) };
        if let Some(allocation) = self.allocation.take()
            && let Err(error) = allocator.free(allocation)
        {
            tracing::error!("freeing a buffer: {error}");
        }
    }

    /// Host writes into an [`Memory::Upload`] buffer; the caller keeps the device away from `offset..`.
    pub(super) fn write_mapped(&mut self, offset: u64, bytes: &[u8]) {
        let mapped = self.allocation.as_mut().and_then(|a| a.mapped_slice_mut());
        let mapped = mapped.expect("upload buffers are mapped");
        mapped[offset as usize..][..bytes.len()].copy_from_slice(bytes);
    }

    /// What lies at byte `offset` of a [`Memory::Readback`] buffer; the caller has waited for the device to write it.
    pub(super) fn read_mapped<T: Pod>(&self, offset: u64) -> T {
        let mapped = self.allocation.as_ref().and_then(|a| a.mapped_slice());
        let mapped = mapped.expect("readback buffers are mapped");
        bytemuck::pod_read_unaligned(&mapped[offset as usize..][..size_of::<T>()])
    }
}

impl Gpu {
    /// A buffer of `size` bytes (at least 16 are allocated), contents undefined.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`] with `name` and `size`.
    pub fn buffer(&self, name: &str, size: u64, memory: Memory) -> Result<Buffer> {
        let raw = RawBuffer::new(&self.0, name, size, memory)?;
        self.set_name(raw.handle, name);
        Ok(Buffer {
            gpu: self.clone(),
            raw,
            name: name.to_owned(),
        })
    }

    /// A device buffer that holds `data`; the copy is done when this returns.
    pub fn buffer_with<T: Pod>(&self, name: &str, data: &[T]) -> Result<Buffer> {
        let buffer = self.buffer(name, std::mem::size_of_val(data) as u64, Memory::Device)?;
        buffer.write(0, data)?;
        Ok(buffer)
    }
}

impl Buffer {
    /// Where shaders find it.
    pub fn address(&self) -> Address {
        self.raw.address
    }

    /// Where shaders find its byte `offset`.
    pub fn address_at(&self, offset: u64) -> Address {
        assert!(
            offset <= self.raw.size,
            "offset {offset} lies outside `{}`",
            self.name
        );
        self.raw.address.plus(offset)
    }

    /// Bytes.
    pub fn size(&self) -> u64 {
        self.raw.size
    }

    /// The name it was made with.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Copies `data` in at byte `offset` and waits for it. For set-up; [`super::Commands::upload`] does not wait.
    pub fn write<T: Pod>(&self, offset: u64, data: &[T]) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        for (i, part) in bytes.chunks(MAX_UPLOAD).enumerate() {
            let mut cmd = self.gpu.commands()?;
            let at = offset + (i * MAX_UPLOAD) as u64;
            cmd.upload(self, at, part)?;
            cmd.submit()?.wait()?;
        }
        Ok(())
    }

    /// Waits for the device, then copies `range` (elements of `T`) out.
    pub fn read<T: Pod>(&self, range: Range<usize>) -> Result<Vec<T>> {
        let stride = size_of::<T>();
        let bytes = (range.len() * stride) as u64;
        let staging = self.gpu.buffer("readback", bytes, Memory::Readback)?;
        let mut cmd = self.gpu.commands()?;
        cmd.barrier(Stage::All, Stage::Transfer);
        cmd.copy(self, (range.start * stride) as u64, &staging, 0, bytes);
        cmd.barrier(Stage::Transfer, Stage::Host);
        cmd.submit()?.wait()?;
        Ok(staging.mapped(0..range.len()))
    }

    /// What lies in a [`Memory::Readback`] buffer (elements of `T`); the caller has waited for the device to write it.
    pub fn mapped<T: Pod>(&self, range: Range<usize>) -> Vec<T> {
        let stride = size_of::<T>();
        let mapped = self
            .raw
            .allocation
            .as_ref()
            .and_then(|a| a.mapped_slice())
            .unwrap_or_default();
        let mut out = vec![T::zeroed(); range.len()];
        bytemuck::cast_slice_mut(&mut out)
            .copy_from_slice(&mapped[range.start * stride..range.end * stride]);
        out
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        self.gpu.0.went(&self.name, self.raw.size);
        self.gpu
            .queue()
            .discard(Garbage::Buffer(std::mem::take(&mut self.raw)));
    }
}

//! Recording: copies, dispatches, barriers, and scopes that are a debug label and a pair of timestamps at once.
//!
//! Contract: a dispatch reads and writes only what the addresses in its push constants reach, and the caller puts a
//! [`Commands::barrier`] between dispatches that touch the same bytes. Buffers and pipelines may be dropped right after
//! recording: they are freed when the submission is done.

use std::sync::MutexGuard;

use ash::vk;
use bytemuck::Pod;

use super::error::Result;
use super::queue::MAX_UPLOAD;
use super::recording::{MAX_TIMESTAMPS, Recording, Scope};
use super::{Buffer, Gpu, Pipeline, Ticket};

/// One side of a barrier. Every barrier covers all memory of its stages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Copies and fills.
    Transfer,
    /// Compute shaders.
    Compute,
    /// Everything that draws.
    Draw,
    /// Reading of indirect arguments.
    Indirect,
    /// The host's reads after a wait.
    Host,
    /// All of them.
    All,
}

impl Stage {
    pub(super) fn flags(self) -> vk::PipelineStageFlags2 {
        match self {
            Stage::Transfer => vk::PipelineStageFlags2::ALL_TRANSFER,
            Stage::Compute => vk::PipelineStageFlags2::COMPUTE_SHADER,
            Stage::Draw => vk::PipelineStageFlags2::ALL_GRAPHICS,
            Stage::Indirect => {
                vk::PipelineStageFlags2::DRAW_INDIRECT | vk::PipelineStageFlags2::COMPUTE_SHADER
            }
            Stage::Host => vk::PipelineStageFlags2::HOST,
            Stage::All => vk::PipelineStageFlags2::ALL_COMMANDS,
        }
    }
}

/// A command buffer being recorded.
pub struct Commands {
    gpu: Gpu,
    /// None once submitted.
    recording: Option<Recording>,
    timestamps: u32,
    /// A scope is open whose work the device counts.
    counting: bool,
}

impl Gpu {
    /// Begins a recording.
    pub fn commands(&self) -> Result<Commands> {
        let recording = self.queue().begin(&self.0)?;
        Ok(Commands {
            gpu: self.clone(),
            recording: Some(recording),
            timestamps: 0,
            counting: false,
        })
    }
}

impl Commands {
    pub(super) fn raw(&self) -> vk::CommandBuffer {
        self.recording
            .as_ref()
            .expect("recorded into only before it is submitted")
            .buffer
    }

    pub(super) fn device(&self) -> &ash::Device {
        &self.gpu.0.device
    }

    pub(super) fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    pub(super) fn serial(&self) -> u64 {
        self.recording.as_ref().expect("as above").serial
    }

    /// Runs `record` under a debug label, timed by the device.
    pub fn scope<T>(&mut self, name: &'static str, record: impl FnOnce(&mut Self) -> T) -> T {
        let first = self.timestamps;
        let timed = first + 2 <= MAX_TIMESTAMPS;
        let raw = self.raw();
        self.timestamps += 2 * u32::from(timed);
        let counts = self.recording.as_ref().expect("as above").counts_of(first);
        let counts = counts.filter(|_| timed && !self.counting);
        self.counting |= counts.is_some();
        let label = std::ffi::CString::new(name).unwrap_or_default();
        // SAFETY: the command buffer is recording; each timestamp is written once after its reset.
        unsafe {
            if let Some(debug) = &self.gpu.0.debug {
                debug.cmd_begin_debug_utils_label(
                    raw,
                    &vk::DebugUtilsLabelEXT::default().label_name(&label),
                );
            }
            if timed {
                self.stamp(first);
            }
            if let Some((pool, at)) = counts {
                let flags = vk::QueryControlFlags::empty();
                self.device().cmd_begin_query(raw, pool, at, flags);
            }
        }
        let result = record(self);
        // SAFETY: as above.
        unsafe {
            if let Some((pool, at)) = counts {
                self.device().cmd_end_query(raw, pool, at);
                self.counting = false;
            }
            if timed {
                self.stamp(first + 1);
            }
            if let Some(debug) = &self.gpu.0.debug {
                debug.cmd_end_debug_utils_label(raw);
            }
        }
        if let (true, Some(recording)) = (timed, self.recording.as_mut()) {
            recording.scopes.push(Scope {
                name,
                first,
                counted: counts.is_some(),
            });
        }
        result
    }

    /// Takes a timestamp of this recording.
    ///
    /// # Safety
    /// As [`Recording::stamp`].
    unsafe fn stamp(&self, index: u32) {
        let recording = self.recording.as_ref().expect("as above");
        // SAFETY: the caller's promise.
        unsafe { recording.stamp(&self.gpu.0, index) };
    }

    /// What `from` has written is seen by `to`.
    pub fn barrier(&mut self, from: Stage, to: Stage) {
        let access = vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE;
        let host = |stage| match stage {
            Stage::Host => vk::AccessFlags2::HOST_READ,
            _ => access,
        };
        let barriers = [vk::MemoryBarrier2::default()
            .src_stage_mask(from.flags())
            .src_access_mask(host(from))
            .dst_stage_mask(to.flags())
            .dst_access_mask(host(to))];
        let info = vk::DependencyInfo::default().memory_barriers(&barriers);
        // SAFETY: the command buffer is recording.
        unsafe { self.device().cmd_pipeline_barrier2(self.raw(), &info) };
    }

    /// Copies `size` bytes.
    pub fn copy(
        &mut self,
        from: &Buffer,
        from_offset: u64,
        to: &Buffer,
        to_offset: u64,
        size: u64,
    ) {
        assert!(
            from_offset + size <= from.size(),
            "copy reads past the end of `{}`",
            from.name()
        );
        assert!(
            to_offset + size <= to.size(),
            "copy writes past the end of `{}`",
            to.name()
        );
        if size > 0 {
            let regions = [vk::BufferCopy {
                src_offset: from_offset,
                dst_offset: to_offset,
                size,
            }];
            // SAFETY: both ranges lie inside their buffers.
            unsafe {
                self.device()
                    .cmd_copy_buffer(self.raw(), from.raw.handle, to.raw.handle, &regions)
            };
        }
    }

    /// Fills bytes `offset..offset + size` (multiples of 4) with `value`.
    pub fn fill(&mut self, buffer: &Buffer, offset: u64, size: u64, value: u32) {
        assert!(
            offset + size <= buffer.size() && (offset | size).is_multiple_of(4),
            "fill misses `{}`",
            buffer.name()
        );
        if size > 0 {
            // SAFETY: the range lies inside the buffer and is aligned.
            unsafe {
                self.device()
                    .cmd_fill_buffer(self.raw(), buffer.raw.handle, offset, size, value)
            };
        }
    }

    /// Copies host data into `to` through the upload ring, in order with the other commands.
    pub fn upload<T: Pod>(&mut self, to: &Buffer, offset: u64, data: &[T]) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        assert!(
            offset + bytes.len() as u64 <= to.size(),
            "upload writes past the end of `{}`",
            to.name()
        );
        let serial = self.serial();
        for (i, part) in bytes.chunks(MAX_UPLOAD).enumerate() {
            let (staging, src_offset) = self.gpu.queue().stage(&self.gpu.0, serial, part)?;
            let regions = [vk::BufferCopy {
                src_offset,
                dst_offset: offset + (i * MAX_UPLOAD) as u64,
                size: part.len() as u64,
            }];
            // SAFETY: both ranges lie inside their buffers.
            unsafe {
                self.device()
                    .cmd_copy_buffer(self.raw(), staging, to.raw.handle, &regions)
            };
        }
        Ok(())
    }

    fn bind<P: Pod>(&mut self, pipeline: &Pipeline, push: &P) {
        let shader = &pipeline.shader;
        assert_eq!(
            size_of::<P>(),
            shader.push_bytes as usize,
            "{}: push constants differ from the shader's",
            shader.name
        );
        // SAFETY: the pipeline is alive; the size was checked against the layout's range.
        unsafe {
            self.device().cmd_bind_pipeline(
                self.raw(),
                vk::PipelineBindPoint::COMPUTE,
                pipeline.raw,
            );
            let bytes = bytemuck::bytes_of(push);
            if !bytes.is_empty() {
                self.device().cmd_push_constants(
                    self.raw(),
                    pipeline.layout,
                    vk::ShaderStageFlags::COMPUTE,
                    0,
                    bytes,
                );
            }
        }
    }

    /// Runs at least `threads` invocations, in whole workgroups.
    pub fn dispatch<P: Pod>(&mut self, pipeline: &Pipeline, push: &P, threads: [u32; 3]) {
        let groups: [u32; 3] =
            std::array::from_fn(|i| threads[i].div_ceil(pipeline.shader.local_size[i]));
        if groups.contains(&0) {
            return;
        }
        let most = self.gpu.0.max_groups;
        assert!(
            (0..3).all(|i| groups[i] <= most[i]),
            "{}: {groups:?} groups exceed {most:?}",
            pipeline.shader.name
        );
        self.bind(pipeline, push);
        // SAFETY: a pipeline is bound.
        unsafe {
            self.device()
                .cmd_dispatch(self.raw(), groups[0], groups[1], groups[2])
        };
    }

    /// Runs the workgroup counts that the device wrote at byte `offset`: three u32.
    pub fn dispatch_indirect<P: Pod>(
        &mut self,
        pipeline: &Pipeline,
        push: &P,
        counts: &Buffer,
        offset: u64,
    ) {
        assert!(
            offset + 12 <= counts.size() && offset.is_multiple_of(4),
            "no counts at {offset} in `{}`",
            counts.name()
        );
        self.bind(pipeline, push);
        // SAFETY: the counts lie inside the buffer.
        unsafe {
            self.device()
                .cmd_dispatch_indirect(self.raw(), counts.raw.handle, offset)
        };
    }

    /// Ends the recording and sends it.
    pub fn submit(mut self) -> Result<Ticket> {
        let recording = self.recording.take().expect("submitted once, here");
        let gpu = self.gpu.clone();
        let value = gpu.queue().submit(&gpu.0, recording)?;
        Ok(Ticket { gpu, value })
    }
}

impl Commands {
    /// As [`Commands::submit`], after `free` is signalled; signals `drawn` as well. Returns the queue and the turn: nothing else is
    /// submitted as long as that is held.
    pub(super) fn submit_for_window<'a>(
        mut self,
        gpu: &'a Gpu,
        free: vk::Semaphore,
        drawn: vk::Semaphore,
    ) -> Result<(Ticket, vk::Queue, MutexGuard<'a, ()>)> {
        let recording = self.recording.take().expect("submitted once, here");
        let mut queue = gpu.queue();
        let turn = gpu.turn();
        let value = queue.submit_between(&gpu.0, &turn, recording, Some([free, drawn]))?;
        let ticket = Ticket {
            gpu: gpu.clone(),
            value,
        };
        Ok((ticket, queue.raw(), turn))
    }
}

impl Drop for Commands {
    fn drop(&mut self) {
        if let Some(recording) = self.recording.take() {
            self.gpu.queue().abandon(recording);
        }
    }
}

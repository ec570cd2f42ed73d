//! A command buffer with what measures it: timestamps and pipeline statistics, which the device writes out at its end and the host
//! reads when it has run.
//!
//! Mesa's CPU driver waits for all submissions when it is asked for the result of one query (`vkGetQueryPoolResults`): the host would
//! hear of each submission only when the next one has ended, too. Copied by the device, results come with their submission.

use ash::vk;
use gpu_allocator::vulkan::Allocator;

use super::Shared;
use super::buffer::{Memory, RawBuffer};
use super::error::{GpuError, Result};
use super::queue::Queue;
use crate::trace;

/// Timestamps that a recording's scopes can take.
pub(super) const MAX_TIMESTAMPS: u32 = 256;
/// Pipeline statistics: one to a scope.
const MAX_COUNTS: u32 = MAX_TIMESTAMPS / 2;
/// Two more: where the whole of a recording begins and ends, taken when somebody traces.
const WHOLE: u32 = MAX_TIMESTAMPS;
/// Submissions whose device time is remembered.
const LATELY: usize = 64;
/// Timestamps of a recording's pool.
const ALL_TIMESTAMPS: u32 = MAX_TIMESTAMPS + 2;
/// Bytes of a timestamp, and of a scope's statistics, of which four are the most.
const TICKS: u64 = 8;
const COUNTS: u64 = 4 * 8;

/// A command buffer with its pool and timestamps, reused when its submission has finished.
pub(super) struct Recording {
    /// Counts recordings in the order they were begun.
    pub(super) serial: u64,
    pool: vk::CommandPool,
    pub(super) buffer: vk::CommandBuffer,
    timestamps: vk::QueryPool,
    /// In the order in which they ended.
    pub(super) scopes: Vec<Scope>,
    /// Pipeline statistics, by half the scope's first timestamp; made for the first trace.
    counts: Option<vk::QueryPool>,
    /// Where results go: timestamps, then statistics.
    results: RawBuffer,
    /// Whether a trace wants to know when it ran and what it did.
    traced: bool,
    /// When it was sent, as [`trace::now`] counts.
    sent: u64,
}

/// A part of a recording that is timed.
pub(super) struct Scope {
    pub name: &'static str,
    /// Index of its first timestamp; the second follows.
    pub first: u32,
    /// Whether its pipeline statistics are taken.
    pub counted: bool,
}

impl Recording {
    pub(super) fn new(shared: &Shared, family: u32) -> Result<Self> {
        let device = &shared.device;
        let bytes = TICKS * u64::from(ALL_TIMESTAMPS) + COUNTS * u64::from(MAX_COUNTS);
        let results = RawBuffer::new(shared, "query results", bytes, Memory::Readback)?;
        let mut new = Self {
            serial: 0,
            pool: vk::CommandPool::null(),
            buffer: vk::CommandBuffer::null(),
            timestamps: vk::QueryPool::null(),
            scopes: Vec::new(),
            counts: None,
            results,
            traced: false,
            sent: 0,
        };
        let pool = vk::CommandPoolCreateInfo::default().queue_family_index(family);
        let queries = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::TIMESTAMP)
            .query_count(ALL_TIMESTAMPS);
        // SAFETY: pointers outlive the calls; what was made is destroyed where one fails.
        let made = unsafe {
            let mut make = || {
                new.pool = device.create_command_pool(&pool, None)?;
                let buffer = vk::CommandBufferAllocateInfo::default()
                    .command_pool(new.pool)
                    .command_buffer_count(1);
                new.buffer = device.allocate_command_buffers(&buffer)?[0];
                new.timestamps = device.create_query_pool(&queries, None)?;
                Ok(())
            };
            make()
        };
        if let Err(result) = made {
            let mut allocator = shared.allocator.lock().unwrap_or_else(|e| e.into_inner());
            // SAFETY: the device never heard of it.
            unsafe { new.destroy(device, allocator.as_mut()) };
            return Err(GpuError::call("vkAllocateCommandBuffers")(result));
        }
        Ok(new)
    }

    /// Begins anew, with timestamps that can be taken.
    ///
    /// # Safety
    /// The device does not use it.
    pub(super) unsafe fn begin(&mut self, shared: &Shared, serial: u64) -> Result<()> {
        self.serial = serial;
        self.scopes.clear();
        let device = &shared.device;
        let once = vk::CommandBufferBeginInfo::default()
            .flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the caller's promise.
        unsafe {
            device
                .reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty())
                .map_err(GpuError::call("vkResetCommandPool"))?;
            device.reset_query_pool(self.timestamps, 0, ALL_TIMESTAMPS);
            device
                .begin_command_buffer(self.buffer, &once)
                .map_err(GpuError::call("vkBeginCommandBuffer"))?;
            self.begin_trace(shared);
        }
        Ok(())
    }

    /// Ends; it is sent now, as submission `value`.
    ///
    /// # Safety
    /// It is being recorded.
    pub(super) unsafe fn end(
        &mut self,
        shared: &Shared,
        value: u64,
    ) -> std::result::Result<(), vk::Result> {
        // SAFETY: the caller's promise.
        unsafe {
            self.end_trace(shared, value);
            self.write_out(shared);
            shared.device.end_command_buffer(self.buffer)
        }
    }

    /// Notes when it begins to run, if somebody listens.
    ///
    /// # Safety
    /// It is being recorded, and its timestamps were reset.
    unsafe fn begin_trace(&mut self, shared: &Shared) {
        self.traced = trace::is_on();
        if !self.traced {
            return;
        }
        // SAFETY: the caller's promise.
        unsafe { self.stamp(shared, WHOLE) };
        if let Some(kinds) = shared.statistics {
            self.reset_counts(&shared.device, kinds);
        }
    }

    /// Notes when it has run, and that it is sent now as submission `value`.
    ///
    /// # Safety
    /// It is being recorded, and [`Self::begin_trace`] was called.
    unsafe fn end_trace(&mut self, shared: &Shared, value: u64) {
        if !self.traced {
            return;
        }
        // SAFETY: the caller's promise.
        unsafe { self.stamp(shared, WHOLE + 1) };
        self.sent = trace::now();
        trace::sent(value);
    }

    /// Takes timestamp `index` when all before it is done.
    ///
    /// Mesa's CPU driver, once it has drawn anything, leaves a timestamp to the next scene that it draws, while it runs compute
    /// shaders at once: the timestamp before one would be taken after it. A barrier makes it finish what it has left.
    ///
    /// # Safety
    /// It is being recorded, outside of drawing; the timestamp was reset and is taken once.
    pub(super) unsafe fn stamp(&self, shared: &Shared, index: u32) {
        let all = vk::PipelineStageFlags2::ALL_COMMANDS;
        let (device, buffer) = (&shared.device, self.buffer);
        // SAFETY: the caller's promise.
        unsafe {
            device.cmd_write_timestamp2(buffer, all, self.timestamps, index);
            if shared.info.kind == "CPU" {
                let barriers = [vk::MemoryBarrier2::default()
                    .src_stage_mask(all)
                    .dst_stage_mask(all)];
                let info = vk::DependencyInfo::default().memory_barriers(&barriers);
                device.cmd_pipeline_barrier2(buffer, &info);
            }
        }
    }

    /// Makes room for pipeline statistics; without it there are none.
    fn reset_counts(&mut self, device: &ash::Device, kinds: vk::QueryPipelineStatisticFlags) {
        let info = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::PIPELINE_STATISTICS)
            .query_count(MAX_COUNTS)
            .pipeline_statistics(kinds);
        // SAFETY: the device has the feature; the pool is not in use.
        unsafe {
            self.counts = self
                .counts
                .or_else(|| device.create_query_pool(&info, None).ok());
            if let Some(pool) = self.counts {
                device.reset_query_pool(pool, 0, MAX_COUNTS);
            }
        }
    }

    /// Lets the device write out all that was measured.
    ///
    /// # Safety
    /// It is being recorded, and every scope has ended.
    unsafe fn write_out(&self, shared: &Shared) {
        let (device, buffer) = (&shared.device, self.buffer);
        let to = self.results.handle;
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        let ticks = |first: u32, count: u32| {
            let (pool, at) = (self.timestamps, TICKS * u64::from(first));
            // SAFETY: the caller's promise; these were all taken, and there is room for all.
            unsafe {
                device
                    .cmd_copy_query_pool_results(buffer, pool, first, count, to, at, TICKS, flags);
            }
        };
        if !self.scopes.is_empty() {
            ticks(0, 2 * self.scopes.len() as u32);
        }
        if self.traced {
            ticks(WHOLE, 2);
        }
        for scope in self.scopes.iter().filter(|scope| scope.counted) {
            let Some((pool, query)) = self.counts_of(scope.first) else {
                continue;
            };
            // SAFETY: as above.
            unsafe {
                device.cmd_copy_query_pool_results(
                    buffer,
                    pool,
                    query,
                    1,
                    to,
                    counts_at(query),
                    COUNTS,
                    flags,
                );
            }
        }
        let barriers = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::COPY)
            .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ)];
        let info = vk::DependencyInfo::default().memory_barriers(&barriers);
        // SAFETY: the caller's promise.
        unsafe { device.cmd_pipeline_barrier2(buffer, &info) };
    }

    /// Where the statistics of the scope go whose first timestamp is `first`.
    pub(super) fn counts_of(&self, first: u32) -> Option<(vk::QueryPool, u32)> {
        self.counts
            .filter(|_| self.traced)
            .map(|pool| (pool, first / 2))
    }

    /// What was written out of the two timestamps from `first` on.
    fn ticks(&self, first: u32) -> [u64; 2] {
        self.results.read_mapped(TICKS * u64::from(first))
    }

    /// What was written out of a scope's pipeline statistics. Nested scopes have none: a queue counts for one at a time.
    fn counted(&self, shared: &Shared, scope: &Scope) -> trace::PassCounts {
        let kinds = shared.statistics?;
        let (_, query) = self.counts_of(scope.first).filter(|_| scope.counted)?;
        let found: [u64; 4] = self.results.read_mapped(counts_at(query));
        let draws = kinds.contains(vk::QueryPipelineStatisticFlags::VERTEX_SHADER_INVOCATIONS);
        Some(if draws { found } else { [0, 0, 0, found[0]] })
    }

    /// # Safety
    /// The device does not use it.
    pub(super) unsafe fn destroy(self, device: &ash::Device, allocator: Option<&mut Allocator>) {
        // SAFETY: the caller's promise; what was never made is null, and may be destroyed.
        unsafe {
            device.destroy_query_pool(self.timestamps, None);
            device.destroy_query_pool(self.counts.unwrap_or_default(), None);
            device.destroy_command_pool(self.pool, None);
            if let Some(allocator) = allocator {
                self.results.destroy(device, allocator);
            }
        }
    }
}

/// Where results of a query of statistics go.
fn counts_at(query: u32) -> u64 {
    TICKS * u64::from(ALL_TIMESTAMPS) + COUNTS * u64::from(query)
}

impl Queue {
    /// Reads what was measured of a submission that has finished.
    pub(super) fn time(&mut self, shared: &Shared, value: u64, recording: &Recording) {
        let mut all = 0.0;
        for scope in &recording.scopes {
            let [begin, end] = recording.ticks(scope.first);
            let timing = self.timings.entry(scope.name).or_default();
            let ms = end.saturating_sub(begin) as f64 * shared.timestamp_ns * 1e-6;
            timing.0 += 1;
            timing.1 += ms;
            all += ms;
        }
        self.lately.truncate(LATELY - 1);
        self.lately.push_front((value, all));
        if recording.traced {
            let [begin, end] = recording.ticks(WHOLE);
            let inner = recording.scopes.iter();
            let inner = inner.flat_map(|scope| recording.ticks(scope.first));
            let ticks: Vec<u64> = std::iter::once(begin).chain(inner).chain([end]).collect();
            let times = self.clock.host_times(shared, &ticks, recording.sent);
            trace::ran(value, times[0], times[times.len() - 1]);
            for (scope, time) in recording.scopes.iter().zip(times[1..].chunks_exact(2)) {
                let counts = recording.counted(shared, scope);
                trace::passed(value, scope.name, time[0], time[1], counts);
            }
        }
    }
}

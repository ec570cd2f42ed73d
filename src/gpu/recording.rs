//! A command buffer with what measures it: timestamps and pipeline statistics, read when it has run.

use ash::vk;

use super::Shared;
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
pub(super) const ALL_TIMESTAMPS: u32 = MAX_TIMESTAMPS + 2;

/// A command buffer with its pool and timestamps, reused when its submission has finished.
pub(super) struct Recording {
    /// Counts recordings in the order they were begun.
    pub(super) serial: u64,
    pub(super) pool: vk::CommandPool,
    pub(super) buffer: vk::CommandBuffer,
    pub(super) timestamps: vk::QueryPool,
    /// Name, index of the first timestamp; the second follows.
    pub(super) scopes: Vec<(&'static str, u32)>,
    /// Pipeline statistics, by half the scope's first timestamp; made for the first trace.
    pub(super) counts: Option<vk::QueryPool>,
    /// Whether a trace wants to know when it ran and what it did.
    traced: bool,
    /// When it was sent, as [`trace::now`] counts.
    sent: u64,
}

impl Recording {
    pub(super) fn new(
        pool: vk::CommandPool,
        buffer: vk::CommandBuffer,
        timestamps: vk::QueryPool,
    ) -> Self {
        Self {
            serial: 0,
            pool,
            buffer,
            timestamps,
            scopes: Vec::new(),
            counts: None,
            traced: false,
            sent: 0,
        }
    }

    /// Notes when it begins to run, if somebody listens.
    ///
    /// # Safety
    /// It is being recorded, and its timestamps were reset.
    pub(super) unsafe fn begin_trace(&mut self, shared: &Shared) {
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
    pub(super) unsafe fn end_trace(&mut self, shared: &Shared, value: u64) {
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

    /// Where the statistics of the scope go whose first timestamp is `first`.
    pub(super) fn counts_of(&self, first: u32) -> Option<(vk::QueryPool, u32)> {
        self.counts
            .filter(|_| self.traced)
            .map(|pool| (pool, first / 2))
    }
}

impl Queue {
    /// Reads the timestamps of a submission that has finished.
    pub(super) fn time(&mut self, shared: &Shared, value: u64, recording: &Recording) {
        let read = |first: u32| {
            let mut ticks = [0u64; 2];
            // SAFETY: both timestamps were written by the finished submission.
            let read = unsafe {
                shared.device.get_query_pool_results(
                    recording.timestamps,
                    first,
                    &mut ticks,
                    vk::QueryResultFlags::TYPE_64,
                )
            };
            read.ok().map(|()| ticks)
        };
        let mut passes = Vec::new();
        let mut all = 0.0;
        for &(name, first) in &recording.scopes {
            if let Some([begin, end]) = read(first) {
                let timing = self.timings.entry(name).or_default();
                let ms = end.saturating_sub(begin) as f64 * shared.timestamp_ns * 1e-6;
                timing.0 += 1;
                timing.1 += ms;
                all += ms;
                passes.push((name, first, [begin, end]));
            }
        }
        self.lately.truncate(LATELY - 1);
        self.lately.push_front((value, all));
        if recording.traced
            && let Some([begin, end]) = read(WHOLE)
        {
            let inner = passes.iter().flat_map(|p| p.2);
            let ticks: Vec<u64> = std::iter::once(begin).chain(inner).chain([end]).collect();
            let times = self.clock.host_times(shared, &ticks, recording.sent);
            trace::ran(value, times[0], times[times.len() - 1]);
            for ((name, first, _), time) in passes.iter().zip(times[1..].chunks_exact(2)) {
                let counts = recording.counts_of(*first);
                let counts = counts.and_then(|(pool, at)| read_counts(shared, pool, at));
                trace::passed(value, name, time[0], time[1], counts);
            }
        }
    }
}

/// Pipeline statistics of a finished scope. Nested scopes have none: a queue counts for one at a time.
fn read_counts(shared: &Shared, pool: vk::QueryPool, at: u32) -> trace::PassCounts {
    let kinds = shared.statistics?;
    let mut found = [[0u64; 4]];
    // SAFETY: the submission has finished; a query that was never begun is not ready, and says so. Four values are the most.
    unsafe {
        shared
            .device
            .get_query_pool_results(pool, at, &mut found, vk::QueryResultFlags::TYPE_64)
    }
    .ok()?;
    let draws = kinds.contains(vk::QueryPipelineStatisticFlags::VERTEX_SHADER_INVOCATIONS);
    let [found] = found;
    Some(if draws { found } else { [0, 0, 0, found[0]] })
}

//! The one queue: submissions in order, what waits for them (garbage, ring space, timestamps), and the host's waits.

use std::collections::{BTreeMap, VecDeque};
use std::sync::MutexGuard;

use ash::vk;
use gpu_allocator::vulkan::Allocator;

use super::Shared;
use super::buffer::{Memory, RawBuffer};
use super::clock::Clock;
use super::error::{GpuError, Result};
use super::garbage::Garbage;
use super::recording::Recording;

/// Bytes of the upload ring.
const RING_BYTES: u64 = 16 << 20;
/// The most that one upload copies: a quarter of the ring.
pub(super) const MAX_UPLOAD: usize = RING_BYTES as usize / 4;

/// The queue and everything that waits for it.
pub(super) struct Queue {
    raw: vk::Queue,
    family: u32,
    semaphore: vk::Semaphore,
    /// Value of the last submission; they count from 1.
    submitted: u64,
    /// Recordings that are open or in flight, by serial, each with where its uploads begin in the ring.
    live: BTreeMap<u64, Option<u64>>,
    /// Serial of the next recording.
    next: u64,
    in_flight: VecDeque<(u64, Recording)>,
    idle: Vec<Recording>,
    /// What to free, and the serial of the first recording that cannot use it.
    garbage: VecDeque<(u64, Garbage)>,
    ring: Option<RawBuffer>,
    /// Bytes ever taken from the ring.
    ring_head: u64,
    pub(super) timings: BTreeMap<&'static str, (u64, f64)>,
    /// Milliseconds in scopes of the submissions that finished last.
    pub(super) lately: VecDeque<(u64, f64)>,
    pub(super) clock: Clock,
}

impl Queue {
    pub(super) fn new(device: &ash::Device, family: u32, clock: Clock) -> Result<Self> {
        let mut kind =
            vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: the device was made with one queue of this family and with timeline semaphores.
        let (raw, semaphore) = unsafe {
            (
                device.get_device_queue(family, 0),
                device.create_semaphore(&info, None),
            )
        };
        Ok(Self {
            raw,
            family,
            semaphore: semaphore.map_err(GpuError::call("vkCreateSemaphore (timeline)"))?,
            submitted: 0,
            live: BTreeMap::new(),
            next: 0,
            in_flight: VecDeque::new(),
            idle: Vec::new(),
            garbage: VecDeque::new(),
            ring: None,
            ring_head: 0,
            timings: BTreeMap::new(),
            lately: VecDeque::new(),
            clock,
        })
    }

    /// Frees `garbage` after every recording begun so far, sent or not, because each may use it.
    pub(super) fn discard(&mut self, garbage: Garbage) {
        self.garbage.push_back((self.next, garbage));
    }

    pub(super) fn begin(&mut self, shared: &Shared) -> Result<Recording> {
        self.collect(shared)?;
        let mut recording = match self.idle.pop() {
            Some(recording) => recording,
            None => Recording::new(shared, self.family)?,
        };
        // SAFETY: an idle recording's submission has finished.
        if let Err(error) = unsafe { recording.begin(shared, self.next) } {
            self.idle.push(recording);
            return Err(error);
        }
        self.live.insert(self.next, None);
        self.next += 1;
        Ok(recording)
    }

    /// Takes a recording back without running it.
    pub(super) fn abandon(&mut self, recording: Recording) {
        self.live.remove(&recording.serial);
        self.idle.push(recording);
    }

    pub(super) fn raw(&self) -> vk::Queue {
        self.raw
    }

    pub(super) fn family(&self) -> u32 {
        self.family
    }

    /// Waits for everything that was submitted and frees what waited for it.
    pub(super) fn idle(&mut self, shared: &Shared) -> Result<()> {
        let turn = shared.turn();
        // SAFETY: it is our turn.
        let waited = unsafe { shared.device.queue_wait_idle(self.raw) };
        drop(turn);
        waited.map_err(GpuError::call("vkQueueWaitIdle"))?;
        self.collect(shared)
    }

    pub(super) fn submit(&mut self, shared: &Shared, recording: Recording) -> Result<u64> {
        let turn = shared.turn();
        self.submit_between(shared, &turn, recording, None)
    }

    /// Submits; with semaphores to wait for and to signal besides.
    pub(super) fn submit_between(
        &mut self,
        shared: &Shared,
        _turn: &MutexGuard<()>,
        mut recording: Recording,
        window: Option<[vk::Semaphore; 2]>,
    ) -> Result<u64> {
        let value = self.submitted + 1;
        let _span = tracing::debug_span!("submit", submission = value).entered();
        let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(recording.buffer)];
        let at = |semaphore| {
            vk::SemaphoreSubmitInfo::default()
                .semaphore(semaphore)
                .stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
        };
        let mut signals = vec![at(self.semaphore).value(value)];
        let mut waits = Vec::new();
        if let Some([wait, signal]) = window {
            waits.push(at(wait));
            signals.push(at(signal));
        }
        let info = [vk::SubmitInfo2::default()
            .command_buffer_infos(&buffers)
            .wait_semaphore_infos(&waits)
            .signal_semaphore_infos(&signals)];
        // SAFETY: the recording has ended and is not in flight; it is our turn.
        let sent = unsafe {
            let ended = recording.end(shared, value);
            let (device, none) = (&shared.device, vk::Fence::null());
            ended.and_then(|()| device.queue_submit2(self.raw, &info, none))
        };
        if let Err(result) = sent {
            let error = self.failure("vkQueueSubmit2", result, &recording);
            self.abandon(recording);
            return Err(error);
        }
        self.submitted = value;
        self.in_flight.push_back((value, recording));
        Ok(value)
    }

    fn failure(&self, call: &str, result: vk::Result, running: &Recording) -> GpuError {
        match result {
            vk::Result::ERROR_DEVICE_LOST => {
                let names: Vec<_> = running.scopes.iter().map(|s| s.name).collect();
                GpuError::Lost {
                    running: names.join(", "),
                }
            }
            result => GpuError::Call {
                call: call.to_owned(),
                result,
            },
        }
    }

    pub(super) fn finished(&self, shared: &Shared) -> Result<u64> {
        // SAFETY: the semaphore lives as long as the queue.
        unsafe { shared.device.get_semaphore_counter_value(self.semaphore) }
            .map_err(GpuError::call("vkGetSemaphoreCounterValue"))
    }

    /// Waits for submission `value` and collects what waited for it.
    pub(super) fn wait(&mut self, shared: &Shared, value: u64) -> Result<()> {
        let _span = tracing::debug_span!("wait", submission = value).entered();
        let waited = wait(shared, self.semaphore, value);
        self.waited(shared, waited)
    }

    /// The semaphore that counts submissions.
    pub(super) fn semaphore(&self) -> vk::Semaphore {
        self.semaphore
    }

    /// After a wait: collects what waited for it, or says what failed.
    pub(super) fn waited(
        &mut self,
        shared: &Shared,
        waited: std::result::Result<(), vk::Result>,
    ) -> Result<()> {
        if let Err(result) = waited {
            return Err(match self.in_flight.front() {
                Some((_, running)) => self.failure("vkWaitSemaphores", result, running),
                None => GpuError::Call {
                    call: "vkWaitSemaphores".into(),
                    result,
                },
            });
        }
        self.collect(shared)
    }

    /// Reads what was measured, frees garbage and ring space of all finished submissions.
    fn collect(&mut self, shared: &Shared) -> Result<()> {
        let finished = self.finished(shared)?;
        while self
            .in_flight
            .front()
            .is_some_and(|(value, _)| *value <= finished)
        {
            let Some((value, recording)) = self.in_flight.pop_front() else {
                break;
            };
            self.time(shared, value, &recording);
            self.live.remove(&recording.serial);
            self.idle.push(recording);
        }
        let first_live = self.live.keys().next().copied().unwrap_or(self.next);
        if self
            .garbage
            .front()
            .is_some_and(|(after, _)| *after <= first_live)
        {
            let mut allocator = shared.allocator.lock().unwrap_or_else(|e| e.into_inner());
            while self
                .garbage
                .front()
                .is_some_and(|(after, _)| *after <= first_live)
            {
                if let (Some((_, garbage)), Some(allocator)) =
                    (self.garbage.pop_front(), allocator.as_mut())
                {
                    // SAFETY: every recording begun before it was discarded has finished or was never sent.
                    unsafe { garbage.destroy(&shared.device, allocator) };
                }
            }
        }
        Ok(())
    }

    /// Puts `bytes` where recording `serial` can copy them from: into the ring, for which it waits for submissions when
    /// it is full; beside it when open recordings hold all of it, or when there are too many at once.
    pub(super) fn stage(
        &mut self,
        shared: &Shared,
        serial: u64,
        bytes: &[u8],
    ) -> Result<(vk::Buffer, u64)> {
        let size = (bytes.len() as u64).next_multiple_of(16);
        if bytes.len() > MAX_UPLOAD {
            return self.stage_beside(shared, bytes);
        }
        if self.ring.is_none() {
            self.ring = Some(RawBuffer::new(
                shared,
                "upload ring",
                RING_BYTES,
                Memory::Upload,
            )?);
        }
        let mut at = self.ring_head;
        if at % RING_BYTES + size > RING_BYTES {
            at = at.next_multiple_of(RING_BYTES);
        }
        while at + size > self.ring_tail() + RING_BYTES {
            match self.in_flight.front() {
                Some((oldest, _)) => self.wait(shared, *oldest)?,
                None => return self.stage_beside(shared, bytes),
            }
        }
        self.ring_head = at + size;
        self.live.entry(serial).and_modify(|start| {
            start.get_or_insert(at);
        });
        let ring = self.ring.as_mut().expect("made above");
        ring.write_mapped(at % RING_BYTES, bytes);
        Ok((ring.handle, at % RING_BYTES))
    }

    /// Where the oldest bytes lie that the ring must keep.
    fn ring_tail(&self) -> u64 {
        let starts = self.live.values().flatten();
        starts.min().copied().unwrap_or(self.ring_head)
    }

    /// A buffer for one upload.
    fn stage_beside(&mut self, shared: &Shared, bytes: &[u8]) -> Result<(vk::Buffer, u64)> {
        let size = bytes.len() as u64;
        let mut buffer = RawBuffer::new(shared, "upload", size, Memory::Upload)?;
        buffer.write_mapped(0, bytes);
        shared.went("upload", buffer.size);
        let handle = buffer.handle;
        self.discard(Garbage::Buffer(buffer));
        Ok((handle, 0))
    }

    /// # Safety
    /// The device is idle.
    pub(super) unsafe fn destroy(
        &mut self,
        device: &ash::Device,
        mut allocator: Option<&mut Allocator>,
    ) {
        // SAFETY: the caller's promise; each handle is destroyed once.
        unsafe {
            let flying = self.in_flight.drain(..).map(|(_, recording)| recording);
            for recording in self.idle.drain(..).chain(flying) {
                recording.destroy(device, allocator.as_deref_mut());
            }
            if let Some(allocator) = allocator {
                for (_, garbage) in self.garbage.drain(..) {
                    garbage.destroy(device, allocator);
                }
                if let Some(ring) = self.ring.take() {
                    ring.destroy(device, allocator);
                }
            }
            device.destroy_semaphore(self.semaphore, None);
        }
    }
}

/// Waits until the semaphore has counted to `value`. Needs no lock: others submit meanwhile.
pub(super) fn wait(
    shared: &Shared,
    semaphore: vk::Semaphore,
    value: u64,
) -> std::result::Result<(), vk::Result> {
    let (semaphores, values) = ([semaphore], [value]);
    let info = vk::SemaphoreWaitInfo::default()
        .semaphores(&semaphores)
        .values(&values);
    // SAFETY: the semaphore lives as long as the queue, which `shared` owns.
    unsafe { shared.device.wait_semaphores(&info, u64::MAX) }
}

//! What a submission leaves with the host: something to wait for, and the device time of its scopes.

use std::time::Duration;

use super::Gpu;
use super::error::Result;

/// A submission's place in the queue.
#[derive(Clone)]
#[must_use = "a submission that nobody waits for may never be checked"]
pub struct Ticket {
    pub(super) gpu: Gpu,
    pub(super) value: u64,
}

impl Ticket {
    /// Blocks until the submission has finished.
    ///
    /// # Errors
    /// [`super::GpuError::Lost`] with the scopes that were running; [`super::GpuError::Validation`] if the layer has spoken.
    pub fn wait(&self) -> Result<()> {
        let shared = &self.gpu.0;
        let _span = tracing::debug_span!("wait", submission = self.value).entered();
        let semaphore = self.gpu.queue().semaphore();
        let waited = super::queue::wait(shared, semaphore, self.value);
        self.gpu.queue().waited(shared, waited)?;
        self.gpu.check_validation()
    }

    /// Device time in its scopes, once it has been waited for; none for one that finished long before others.
    pub fn device_time(&self) -> Option<Duration> {
        let queue = self.gpu.queue();
        let of = queue.lately.iter().find(|(value, _)| *value == self.value);
        of.map(|(_, ms)| Duration::from_secs_f64(ms * 1e-3))
    }

    /// Whether it has finished.
    pub fn is_done(&self) -> Result<bool> {
        Ok(self.gpu.queue().finished(&self.gpu.0)? >= self.value)
    }
}

/// Device time spent under one scope name.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Timing {
    /// The scope.
    pub name: &'static str,
    /// How often it ran.
    pub calls: u64,
    /// Milliseconds in all, by GPU timestamps.
    pub ms: f64,
}

impl Gpu {
    /// Device time by scope since the start, of all submissions that were waited for.
    pub fn timings(&self) -> Vec<Timing> {
        self.queue()
            .timings
            .iter()
            .map(|(name, (calls, ms))| Timing {
                name,
                calls: *calls,
                ms: *ms,
            })
            .collect()
    }
}

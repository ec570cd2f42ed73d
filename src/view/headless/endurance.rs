//! A script again and again: what pictures take, and whether memory grows.

use std::path::Path;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::super::ViewError;
use super::super::panels::frame_times;
use super::super::script::Line;
use super::Headless;

/// Memory at the end of a round through a script.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct MemoryUse {
    /// Since the start.
    seconds: f64,
    /// Resident bytes of the process; 0 where the system does not tell.
    host_bytes: u64,
    /// Bytes of live buffers and images.
    device_bytes: u64,
}

impl Headless<'_> {
    /// Plays a script again and again for a time, its pictures written over those of the round before. How often.
    ///
    /// # Errors
    /// As [`Headless::play`].
    pub fn repeat(
        &mut self,
        script: &[(usize, Line)],
        folder: &Path,
        time: Duration,
    ) -> Result<u32, ViewError> {
        let start = Instant::now();
        let mut rounds = 0;
        while rounds == 0 || start.elapsed() < time {
            self.frames = 0;
            self.play(script, folder)?;
            self.memory.push(MemoryUse {
                seconds: self.start.elapsed().as_secs_f64(),
                host_bytes: resident_bytes(),
                device_bytes: self.baker.gpu().live_bytes(),
            });
            rounds += 1;
        }
        Ok(rounds)
    }

    /// What pictures took, and how much was done between them.
    pub fn statistics(&self) -> serde_json::Value {
        let gpu = self.baker.gpu();
        let (median, worst) = frame_times(&self.frame_ms);
        serde_json::json!({
            "frames": self.frames,
            "median_ms": median,
            "p99_ms": worst,
            "updates": self.updates,
            "device": gpu.info().name,
            "device_bytes": gpu.peak_bytes(),
            "memory": self.memory,
            "passes": gpu.timings(),
        })
    }
}

/// Bytes of the process in memory; 0 where /proc does not tell.
fn resident_bytes() -> u64 {
    const PAGE: u64 = 4096;
    let text = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages = text.split(' ').nth(1).and_then(|pages| pages.parse().ok());
    pages.unwrap_or(0u64) * PAGE
}

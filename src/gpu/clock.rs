//! The device's clock on the host's time line: calibrated where the device can, else from when submissions were sent.

use ash::{ext, vk};

use super::Shared;
use crate::trace;

/// Nanoseconds between two calibrations: clocks drift apart by some microseconds a second.
const AGAIN: u64 = 1_000_000_000;
/// Readings of both clocks, of which the quickest counts.
const READINGS: usize = 8;

/// Both clocks at one moment, nanoseconds.
#[derive(Clone, Copy)]
struct Moment {
    host: u64,
    device: f64,
}

/// Knows when on the host's clock, [`trace::now`], something happened on the device's.
pub(super) struct Clock {
    calibration: Option<ext::calibrated_timestamps::Device>,
    moment: Option<Moment>,
    /// When the submission before ended, host's clock: the queue runs one after the other.
    last: u64,
}

impl Clock {
    pub(super) fn new(calibration: Option<ext::calibrated_timestamps::Device>) -> Self {
        Self {
            calibration,
            moment: None,
            last: 0,
        }
    }

    /// When timestamps of one submission were taken, host's nanoseconds in whole. The first of `ticks` is the submission's
    /// begin, the last its end; it was sent at `sent`.
    pub(super) fn host_times(&mut self, shared: &Shared, ticks: &[u64], sent: u64) -> Vec<u64> {
        let device = |ticks: u64| ticks as f64 * shared.timestamp_ns;
        let begin = device(ticks.first().copied().unwrap_or_default());
        self.look(shared, begin, sent);
        let moment = self.moment.unwrap_or(Moment {
            host: sent,
            device: begin,
        });
        let first = (moment.host as f64 + (begin - moment.device)).max(0.0) as u64;
        let first = first.max(sent).max(self.last);
        let times: Vec<u64> = ticks
            .iter()
            .map(|&t| first + (device(t) - begin).max(0.0).round() as u64)
            .collect();
        self.last = times.last().copied().unwrap_or(self.last);
        times
    }

    fn look(&mut self, shared: &Shared, begin: f64, sent: u64) {
        let now = trace::now();
        let Some(calibration) = &self.calibration else {
            // Nothing begins before it was sent: the submission that began soonest after that tells the most.
            let known = self.moment;
            let bound = |m: Moment| m.host as f64 - m.device;
            let new = Moment {
                host: sent,
                device: begin,
            };
            if known.is_none_or(|m| bound(m) < bound(new)) {
                self.moment = Some(new);
            }
            return;
        };
        if self.moment.is_some_and(|m| now < m.host + AGAIN) {
            return;
        }
        let infos =
            [vk::CalibratedTimestampInfoEXT::default().time_domain(vk::TimeDomainEXT::DEVICE)];
        let reading = || {
            let before = trace::now();
            // SAFETY: the device has the extension and this time domain.
            let read = unsafe { calibration.get_calibrated_timestamps(&infos) };
            let after = trace::now();
            let (ticks, _) = read.ok()?;
            let moment = Moment {
                host: before.midpoint(after),
                device: *ticks.first()? as f64 * shared.timestamp_ns,
            };
            Some((after - before, moment))
        };
        let readings = (0..READINGS).filter_map(|_| reading());
        if let Some((_, moment)) = readings.min_by_key(|(took, _)| *took) {
            self.moment = Some(moment);
        }
    }
}

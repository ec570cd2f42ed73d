//! What frames take, how soon they answer, and how coarse they are while something moves so that they do.

use std::time::{Duration, Instant};

use serde::Serialize;

use crate::gpu::Timing;

/// What surfaces may take of a frame while something moves: beyond that they are drawn coarser.
const WANTED_MS: f64 = 45.0;
/// Pixels that a computed one may be as wide as.
const COARSEST: u32 = 3;
/// Time for updates between two pictures, if nobody says otherwise; where a picture takes longer, half of what it takes, so that the
/// map gets its share of the device.
const SLICE: Duration = Duration::from_millis(16);
/// Measurements that are kept.
const KEPT: usize = 4096;

/// Milliseconds and frames, at the middle and for one in a hundred.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(super) struct Photon {
    /// From an input event to the end of the first frame that shows it.
    pub(super) median_ms: f32,
    pub(super) p99_ms: f32,
    /// Frames that were seen from the event on, the one that shows it included.
    pub(super) median_frames: f32,
    pub(super) p99_frames: f32,
    pub(super) most_frames: u64,
    pub(super) events: usize,
}

/// An event on its way.
struct Event {
    at: Instant,
    /// Frames that had been seen.
    seen: u64,
    /// The frame that takes it in, counted from 1; none yet.
    frame: Option<u64>,
}

/// Follows frames and input.
#[derive(Default)]
pub(super) struct Pace {
    coarse: u32,
    /// Calls and milliseconds of the surfaces, when last looked.
    surfaces: (u64, f64),
    events: Vec<Event>,
    answers_ms: Vec<f32>,
    answers_frames: Vec<f32>,
}

impl Pace {
    /// How coarse the next frame is to be. `drawn`: how coarse the last ones were.
    pub(super) fn coarse(&mut self, live: bool, drawn: u32, timings: &[Timing]) -> u32 {
        let surfaces = timings.iter().find(|t| t.name == "view surfaces");
        let now = surfaces.map_or((0, 0.0), |t| (t.calls, t.ms));
        let calls = now.0.saturating_sub(self.surfaces.0);
        if calls > 0 {
            let ms = (now.1 - self.surfaces.1) / calls as f64;
            self.surfaces = now;
            self.coarse = next(self.coarse.max(1), drawn.max(1), ms);
        }
        if live { self.coarse.max(1) } else { 1 }
    }

    /// Whether what moves is drawn coarsely.
    pub(super) fn is_slow(&self) -> bool {
        self.coarse > 1
    }

    /// Something was pressed, moved or turned; `seen`: frames that have been seen so far.
    pub(super) fn event(&mut self, seen: u64) {
        if self.events.len() < KEPT {
            self.events.push(Event {
                at: Instant::now(),
                seen,
                frame: None,
            });
        }
    }

    /// A frame takes in all that has come; `frame`: its number, from 1.
    pub(super) fn taken_in(&mut self, frame: u64) {
        for event in self.events.iter_mut().filter(|e| e.frame.is_none()) {
            event.frame = Some(frame);
        }
    }

    /// So many frames have been seen.
    pub(super) fn seen(&mut self, seen: u64) {
        let (ms, frames) = (&mut self.answers_ms, &mut self.answers_frames);
        self.events.retain(|event| match event.frame {
            Some(frame) if frame <= seen => {
                ms.push(event.at.elapsed().as_secs_f32() * 1e3);
                frames.push((frame - event.seen) as f32);
                false
            }
            _ => true,
        });
        for list in [ms, frames] {
            if list.len() > 2 * KEPT {
                list.drain(..KEPT);
            }
        }
    }

    /// Whether an event waits to be seen.
    pub(super) fn waits(&self) -> bool {
        !self.events.is_empty()
    }

    /// How soon frames answer.
    pub(super) fn photon(&self) -> Photon {
        let times = super::panels::frame_times;
        let ((median_ms, p99_ms), (median_frames, p99_frames)) =
            (times(&self.answers_ms), times(&self.answers_frames));
        let most = self.answers_frames.iter().copied().fold(0.0, f32::max);
        Photon {
            median_ms,
            p99_ms,
            median_frames,
            p99_frames,
            most_frames: most as u64,
            events: self.answers_frames.len(),
        }
    }
}

/// Frames while something moves and the map is worked on.
#[derive(Debug, Default, PartialEq, Serialize)]
pub(super) struct Moving {
    pub(super) frames: usize,
    /// From the beginning of a frame to the beginning of the next.
    pub(super) median_ms: f32,
    pub(super) p99_ms: f32,
    pub(super) most_ms: f32,
    pub(super) updates_per_s: f32,
    #[serde(skip)]
    all_ms: Vec<f32>,
    #[serde(skip)]
    updates: u64,
    /// Updates at the frame before, if that was one of these.
    before: Option<u64>,
}

impl Moving {
    /// A frame that began so long after the one before; `updates`: done so far, none if nothing moves or none are done.
    pub(super) fn frame(&mut self, ms: f32, updates: Option<u64>) {
        if let (Some(before), Some(now)) = (self.before, updates) {
            self.all_ms.push(ms);
            self.updates += now.saturating_sub(before);
        }
        self.before = updates;
    }

    /// What they came to.
    pub(super) fn sum(mut self) -> Self {
        (self.median_ms, self.p99_ms) = super::panels::frame_times(&self.all_ms);
        let seconds = self.all_ms.iter().sum::<f32>() * 1e-3;
        self.frames = self.all_ms.len();
        self.most_ms = self.all_ms.iter().copied().fold(0.0, f32::max);
        self.updates_per_s = self.updates as f32 / seconds.max(1e-3);
        self
    }
}

/// From how coarse frames are to be by now, how coarse those were that took `ms`.
fn next(coarse: u32, drawn: u32, ms: f64) -> u32 {
    // Most of it goes with the number of pixels.
    let at = |coarse: u32| ms * (f64::from(drawn) / f64::from(coarse)).powi(2);
    let fits = |wanted: f64| {
        (1..=COARSEST)
            .find(|c| at(*c) <= wanted)
            .unwrap_or(COARSEST)
    };
    if at(coarse) > WANTED_MS {
        fits(WANTED_MS)
    } else {
        // Finer only with something to spare, so that it does not go back and forth.
        coarse.min(fits(0.6 * WANTED_MS))
    }
}

/// Time for updates between two pictures that take so long on the device. `asked`: what somebody wants.
pub(super) fn slice(asked: Option<Duration>, picture: Duration) -> Duration {
    asked.unwrap_or_else(|| SLICE.max(picture / 2))
}

/// From the end of a frame to a look at whether the next one may begin.
pub(super) const POLL: Duration = Duration::from_millis(1);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_frames_get_coarser_fast_ones_finer_and_neither_to_and_fro() {
        assert_eq!(next(1, 1, 10.0), 1);
        assert_eq!(next(1, 1, 150.0), 2);
        assert_eq!(next(1, 1, 2000.0), 3);
        assert_eq!(next(2, 2, 35.0), 2, "fine would take 140");
        assert_eq!(next(2, 2, 5.0), 1);
        assert_eq!(next(2, 2, 9.0), 2, "fine would take 36: little to spare");
        assert_eq!(next(2, 1, 150.0), 2, "a fine frame while nothing moved");
    }

    #[test]
    fn slices_follow_what_pictures_take_unless_somebody_says_otherwise() {
        let ms = Duration::from_millis;
        assert_eq!(slice(None, ms(2)), ms(16));
        assert_eq!(slice(None, ms(60)), ms(30));
        assert_eq!(slice(Some(ms(4)), ms(60)), ms(4));
    }

    #[test]
    fn an_event_s_frames_are_counted_from_those_seen_before_it() {
        let mut pace = Pace::default();
        // Frame 5 is being drawn when it comes; frame 6 takes it in.
        pace.event(4);
        pace.taken_in(6);
        pace.seen(5);
        assert!(pace.waits());
        pace.seen(6);
        assert!(!pace.waits());
        let photon = pace.photon();
        assert_eq!((photon.most_frames, photon.events), (2, 1));
    }
}

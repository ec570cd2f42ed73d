//! How much of the device's time lights take, so that no more of them are sent at once than there is time for.

use std::time::Duration;

/// Kinds of evaluations that take different time: indirect lights and direct ones, by how they are evaluated, and in which parts of
/// the map.
pub(super) const KINDS: usize = 2 * 3 * 3;

/// Whole, with depth maps to draw.
pub(super) const DRAWN: usize = 0;
/// Whole, with depth maps that were kept.
pub(super) const KEPT: usize = 1;
/// Limited to what changed.
pub(super) const DIFFERENCE: usize = 2;

/// How many lights of each kind.
pub(super) type Counts = [u32; KINDS];

/// Milliseconds that a light is expected to take before one has been measured: of indirect light and direct one,
const UNKNOWN: [f64; 2] = [12.0, 48.0];
/// of that, by how it is evaluated,
const HOW: [f64; 3] = [1.0, 0.4, 0.5];
/// and in the whole map, what is seen of it, and the rest.
const WHERE: [f64; 3] = [1.0, 0.7, 0.8];
/// What a batch takes beside its lights, in lights: it goes through the whole map once. On lavapipe 0.7 to 0.9.
const BATCH_ITSELF: f64 = 0.75;
/// Of what a batch took longer than expected, and of what it was faster, how much is believed at once, as an exponent: frames are late by
/// what is underestimated.
const BELIEF: [f64; 2] = [0.3, 0.15];

/// What lights take, learned from those that were sent.
#[derive(Clone, Debug)]
pub(super) struct Costs([f64; KINDS]);

impl Default for Costs {
    fn default() -> Self {
        Self(std::array::from_fn(|kind| {
            UNKNOWN[kind % 2] * HOW[kind / 2 % 3] * WHERE[kind / 6]
        }))
    }
}

impl Costs {
    /// Milliseconds that a batch of so many lights of each kind is expected to take.
    pub(super) fn of(&self, lights: &Counts) -> f64 {
        let all: f64 = self
            .0
            .iter()
            .zip(lights)
            .map(|(ms, n)| ms * f64::from(*n))
            .sum();
        let count = lights.iter().sum::<u32>().max(1);
        all * (1.0 + BATCH_ITSELF / f64::from(count))
    }

    /// A batch of some lights took so long.
    pub(super) fn learn(&mut self, lights: &Counts, took: Duration) {
        let expected = self.of(lights);
        let took = took.as_secs_f64() * 1e3;
        if expected <= 0.0 || took <= 0.0 {
            return;
        }
        let ratio = (took / expected).clamp(0.05, 20.0);
        let factor = ratio.powf(BELIEF[usize::from(ratio < 1.0)]);
        for (ms, _) in self.0.iter_mut().zip(lights).filter(|(_, n)| **n > 0) {
            *ms *= factor;
        }
    }
}

/// The device's time that lights may take until there is more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Allowance {
    /// Milliseconds that are left.
    left: f64,
    /// Nothing has been sent of it.
    fresh: bool,
    /// No update is to be begun: somebody waits until the map is whole.
    pub(super) whole: bool,
}

impl Allowance {
    pub(super) fn new(time: Duration, whole: bool) -> Self {
        Self {
            left: time.as_secs_f64() * 1e3,
            fresh: !time.is_zero(),
            whole,
        }
    }

    /// Whether so many milliseconds may be sent; one light always, or there would be no end.
    pub(super) fn holds(&self, ms: f64, lights: usize) -> bool {
        ms <= self.left || self.fresh && lights <= 1
    }

    pub(super) fn left(&self) -> Duration {
        Duration::from_secs_f64(self.left.max(0.0) * 1e-3)
    }

    /// Some of it is used.
    pub(super) fn take(&mut self, ms: f64) {
        self.left -= ms;
        self.fresh = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// So many lights of the first kind.
    fn only(lights: u32) -> Counts {
        std::array::from_fn(|kind| if kind == 0 { lights } else { 0 })
    }

    /// Sends lights that take `ms` each, and batches that take 0.8 of `each` beside, slice by slice; what the slices took.
    fn slices(costs: &mut Costs, slice: f64, each: f64, ms: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut sent = 0;
        (0..100)
            .map(|_| {
                let mut allowance = Allowance::new(Duration::from_secs_f64(slice * 1e-3), false);
                let (mut took, mut lights) = (0.0, 0u32);
                while allowance.holds(costs.of(&only(lights + 1)), lights as usize + 1) {
                    took += ms(sent);
                    lights += 1;
                    sent += 1;
                }
                allowance.take(costs.of(&only(lights)));
                took += 0.8 * each;
                costs.learn(&only(lights), Duration::from_secs_f64(took * 1e-3));
                took
            })
            .collect()
    }

    #[test]
    fn slices_are_filled_and_hardly_overrun_once_a_few_have_been_measured() {
        for each in [0.3, 2.0, 7.0] {
            let mut costs = Costs::default();
            // Lights differ by a factor of two.
            let ms = |i: usize| each * (0.7 + 0.7 * ((i * 7919) % 10) as f64 / 9.0);
            let took = slices(&mut costs, 16.0, each, ms);
            let late = &took[40..];
            let worst = late.iter().copied().fold(0.0, f64::max);
            let mean = late.iter().sum::<f64>() / late.len() as f64;
            assert!(worst < 1.5 * 16.0, "{each}: {worst}");
            assert!(mean > 0.4 * 16.0, "{each}: {mean}");
        }
    }

    #[test]
    fn a_light_that_takes_longer_than_a_slice_goes_alone() {
        let mut costs = Costs::default();
        let took = slices(&mut costs, 16.0, 50.0, |_| 50.0);
        assert!(took.iter().all(|ms| *ms == 90.0), "{took:?}");
    }

    #[test]
    fn what_took_longer_than_expected_is_believed_sooner() {
        let (mut slow, mut fast) = (Costs([10.0; KINDS]), Costs([10.0; KINDS]));
        let expected = slow.of(&only(1));
        let times = |factor: f64| Duration::from_secs_f64(expected * factor * 1e-3);
        slow.learn(&only(1), times(4.0));
        fast.learn(&only(1), times(0.25));
        assert!(slow.0[0] / 10.0 > 1.2 * 10.0 / fast.0[0]);
        assert_eq!(slow.0[1], 10.0, "nothing was said about these");
    }
}

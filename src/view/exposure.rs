//! Exposure: what the picture is multiplied by, chosen by hand or measured on the picture itself.

use glam::Vec3;

/// What the geometric mean of a picture becomes: a little below middle grey, as in a bake's preview.png.
const KEY: f32 = 0.14;
/// cd/m² of a grey card that a light meter (K = 12.5) exposes at EV 0 and ISO 100.
const EV_ZERO: f32 = 0.125;
/// Share of the way to what is measured that exposure goes in a second.
const SPEED: f32 = 0.97;
/// Stops that exposure may be off by.
const STILL: f32 = 0.02;

/// What exposure follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// EV at ISO 100 by hand; none: the picture's.
    pub ev: Option<f32>,
    /// Stops brighter than measured.
    pub compensation: f32,
    /// The mean luminance that is exposed for, cd/m².
    mean: Option<f32>,
}

impl Default for Exposure {
    fn default() -> Self {
        Self {
            ev: None,
            compensation: 0.0,
            mean: None,
        }
    }
}

impl Exposure {
    /// What radiance (cd/m²) is multiplied by.
    pub fn factor(&self) -> f32 {
        let mean = match self.ev {
            Some(ev) => EV_ZERO * ev.exp2(),
            None => self.mean.unwrap_or(1.0) * (-self.compensation).exp2(),
        };
        KEY / mean.max(f32::MIN_POSITIVE)
    }

    /// EV at ISO 100 that the picture is taken at.
    pub fn current_ev(&self) -> f32 {
        (KEY / self.factor() / EV_ZERO).log2()
    }

    /// Whether anything has been measured.
    pub fn is_set(&self) -> bool {
        self.mean.is_some()
    }

    /// Moves towards a measured mean luminance, `seconds` after the last one; the first one is taken as it is.
    pub fn follow(&mut self, mean: f32, seconds: f32) {
        let share = 1.0 - (1.0 - SPEED).powf(seconds);
        self.mean = Some(match self.mean {
            // Nobody sees so little; and a picture that does not change stays just as it is.
            Some(old) if (mean / old).log2().abs() < STILL => old,
            // In stops, as eyes and films do.
            Some(old) => (old.log2() + (mean.log2() - old.log2()) * share).exp2(),
            None => mean,
        });
    }

    /// Forgets what was measured: the next measurement is taken as it is.
    pub fn reset(&mut self) {
        self.mean = None;
    }
}

/// The geometric mean luminance (cd/m²) of pixels that had been multiplied by `factor`; none where nothing is to be seen.
pub fn meter(pixels: &[[half::f16; 4]], factor: f32) -> Option<f32> {
    const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);
    let seen: Vec<f32> = pixels
        .iter()
        .map(|p| p.map(half::f16::to_f32))
        .filter(|p| p[3] > 0.5)
        .map(|p| Vec3::new(p[0], p[1], p[2]).dot(LUMINANCE) / p[3])
        .filter(|l| l.is_finite())
        .collect();
    let brightest = seen.iter().copied().fold(0.0, f32::max);
    if brightest <= 0.0 {
        return None;
    }
    // Black corners must not lift the exposure without bound.
    let floor = brightest * 1e-4;
    let sum: f64 = seen.iter().map(|l| f64::from(l.max(floor)).ln()).sum();
    let mean = (sum / seen.len() as f64).exp() as f32 / factor;
    (mean.is_finite() && mean > 0.0).then_some(mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(value: f32, alpha: f32) -> [half::f16; 4] {
        [value, value, value, alpha].map(half::f16::from_f32)
    }

    #[test]
    fn the_meter_undoes_the_exposure_and_leaves_the_background_out() {
        let mut pixels = vec![grey(2.0, 1.0); 50];
        pixels.extend(vec![grey(8.0, 1.0); 50]);
        pixels.extend(vec![grey(0.0, 0.0); 500]);
        let mean = meter(&pixels, 0.5).unwrap();
        assert!((mean - 8.0).abs() < 1e-3, "{mean}");
        assert_eq!(meter(&[grey(0.0, 1.0)], 1.0), None);
        assert_eq!(meter(&[], 1.0), None);
    }

    #[test]
    fn a_stop_of_compensation_doubles_and_one_of_ev_halves() {
        let mut exposure = Exposure::default();
        exposure.follow(100.0, 0.0);
        let before = exposure.factor();
        assert!((before * 100.0 - KEY).abs() < 1e-6);
        exposure.compensation = 1.0;
        assert!((exposure.factor() / before - 2.0).abs() < 1e-5);
        exposure.ev = Some(5.0);
        let at_five = exposure.factor();
        exposure.ev = Some(6.0);
        assert!((exposure.factor() / at_five - 0.5).abs() < 1e-5);
        assert!((exposure.current_ev() - 6.0).abs() < 1e-4);
    }

    #[test]
    fn follows_in_steps_as_in_one_go() {
        let mut steps = Exposure::default();
        steps.follow(1.0, 0.0);
        let mut once = steps;
        once.follow(64.0, 0.5);
        for _ in 0..5 {
            steps.follow(64.0, 0.1);
        }
        assert!((steps.factor() / once.factor() - 1.0).abs() < 1e-3);
        assert!(once.factor() < 0.5 * KEY && once.factor() > KEY / 64.0);
    }
}

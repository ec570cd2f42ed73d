//! The units that people give light in, and what they come to in the file's.

use glam::Vec3;

use crate::scene::{Aperture, Light};

/// The colour of a black body, linear Rec. 709 with the largest channel at 1. 1000 to 40000 K.
///
/// The chromaticities are Kim, Kang et al.'s cubic fits of the Planckian locus (US patent 7024034).
pub fn color_of_temperature(kelvin: f32) -> Vec3 {
    let t = f64::from(kelvin.clamp(1000.0, 40_000.0));
    let u = 1e3 / t;
    let x = if t <= 4000.0 {
        ((-0.266_123_9 * u - 0.234_358_9) * u + 0.877_695_6) * u + 0.179_910
    } else {
        ((-3.025_846_9 * u + 2.107_037_9) * u + 0.222_634_7) * u + 0.240_390
    };
    let y = if t <= 2222.0 {
        ((-1.106_381_4 * x - 1.348_110_2) * x + 2.185_558_32) * x - 0.202_196_83
    } else if t <= 4000.0 {
        ((-0.954_947_6 * x - 1.374_185_93) * x + 2.091_370_15) * x - 0.167_488_67
    } else {
        ((3.081_758 * x - 5.873_386_7) * x + 3.751_129_97) * x - 0.370_014_83
    };
    let xyz = [x / y, 1.0, (1.0 - x - y) / y];
    let rgb = [
        [3.240_454, -1.537_138, -0.498_531],
        [-0.969_266, 1.876_011, 0.041_556],
        [0.055_643, -0.204_026, 1.057_225],
    ]
    .map(|row| row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2]);
    let rgb = Vec3::from_array(rgb.map(|v| v.max(0.0) as f32));
    rgb / rgb.max_element()
}

/// Lumens per candela of a punctual light; none for directional ones, which have lux.
pub fn lumens_per_candela(aperture: &Aperture) -> Option<f32> {
    use std::f32::consts::TAU;
    match *aperture {
        Aperture::Point => Some(2.0 * TAU),
        // The falloff that KHR_lights_punctual suggests is a square between the cosines.
        Aperture::Spot { inner, outer } => {
            let (inner, outer) = (inner.cos(), outer.cos());
            Some(TAU * ((1.0 - inner) + (inner - outer).max(0.0) / 3.0))
        }
        _ => None,
    }
}

/// A light's strength and its colour, whose largest channel is 1.
pub fn strength_and_color(light: &Light) -> (f32, Vec3) {
    let strength = light.intensity.max_element();
    if strength > 0.0 {
        (strength, light.intensity / strength)
    } else {
        (0.0, Vec3::ONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn daylight_is_nearly_white_candles_are_red_and_the_sky_is_blue() {
        let day = color_of_temperature(6504.0);
        // A black body is a little less green than daylight.
        assert!(day.min_element() > 0.93, "{day}");
        let candle = color_of_temperature(1900.0);
        assert!(
            candle.x == 1.0 && candle.y < 0.5 && candle.z < 0.1,
            "{candle}"
        );
        let sky = color_of_temperature(12_000.0);
        assert!(sky.z == 1.0 && sky.x < 0.75, "{sky}");
        // The pieces of the fit meet.
        for kelvin in [2222.0, 4000.0] {
            let step = color_of_temperature(kelvin - 1.0) - color_of_temperature(kelvin + 1.0);
            assert!(step.length() < 0.01, "{kelvin}: {step}");
        }
    }

    #[test]
    fn a_cone_of_all_directions_is_a_point() {
        use std::f32::consts::PI;
        let all = Aperture::Spot {
            inner: PI,
            outer: PI,
        };
        let point = lumens_per_candela(&Aperture::Point).unwrap();
        assert!((lumens_per_candela(&all).unwrap() - point).abs() < 1e-4);
        // Against a sum over thin rings.
        let (inner, outer) = (0.2f32, 0.7f32);
        let rings = 100_000;
        let sum: f64 = (0..rings)
            .map(|i| {
                let angle = (i as f32 + 0.5) / rings as f32 * outer;
                let share =
                    ((angle.cos() - outer.cos()) / (inner.cos() - outer.cos())).clamp(0.0, 1.0);
                f64::from(share * share * angle.sin() * outer / rings as f32)
                    * std::f64::consts::TAU
            })
            .sum();
        let found = lumens_per_candela(&Aperture::Spot { inner, outer }).unwrap();
        assert!((f64::from(found) - sum).abs() < 1e-3, "{found} {sum}");
    }
}

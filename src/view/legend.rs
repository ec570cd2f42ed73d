//! Scales of false colours: what a colour stands for, and what is under the cursor.

use egui::{Align2, Color32, Ui};

use super::look::{Look, Overlay};

/// A scale to be drawn.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Legend {
    pub(super) title: &'static str,
    pub(super) ends: [f32; 2],
    /// Shown as per cent.
    pub(super) percent: bool,
    /// Where a probe is: what it found.
    pub(super) here: Option<f32>,
}

impl Legend {
    /// Of a look in false colours.
    pub(super) fn of_look(look: Look, ends: [f32; 2], here: Option<f32>) -> Option<Self> {
        let title = match look {
            Look::Lux => "lux",
            Look::Error => "error",
            _ => return None,
        };
        Some(Self {
            title,
            ends,
            percent: look == Look::Error,
            here,
        })
    }

    /// Of an overlay.
    pub(super) fn of_overlay((overlay, ends): &(Overlay, [f32; 2])) -> Self {
        let title = match overlay {
            Overlay::Lights => "lights (lm)",
            Overlay::Cells => "cells (lm)",
            Overlay::Invalid => "invalid (lm)",
            Overlay::Vpls | Overlay::Charts => "",
        };
        Self {
            title,
            ends: *ends,
            percent: false,
            here: None,
        }
    }

    fn text(&self, value: f32) -> String {
        match self.percent {
            true => format!("{} %", short(value * 100.0)),
            false => short(value),
        }
    }

    /// Draws the scale.
    pub(super) fn draw(&self, ui: &mut Ui) {
        let [low, high] = self.ends;
        ui.strong(self.title);
        let size = egui::vec2(86.0, 200.0);
        let (rect, _) = ui.allocate_exact_size(size, egui::Sense::hover());
        let font = egui::TextStyle::Small.resolve(ui.style());
        // Room for the numbers at both ends.
        let bar = egui::Rect::from_min_max(
            rect.min + egui::vec2(0.0, 5.0),
            egui::pos2(rect.left() + 22.0, rect.bottom() - 5.0),
        );
        let steps = 64;
        let mut strip = egui::Mesh::default();
        for i in 0..=steps {
            let share = i as f32 / steps as f32;
            let [r, g, b] = turbo(share).map(|v| (v * 255.0 + 0.5) as u8);
            let y = bar.bottom() - share * bar.height();
            for x in [bar.left(), bar.right()] {
                strip.colored_vertex(egui::pos2(x, y), Color32::from_rgb(r, g, b));
            }
        }
        for v in (0..2 * steps).step_by(2) {
            strip.add_triangle(v, v + 1, v + 2);
            strip.add_triangle(v + 1, v + 3, v + 2);
        }
        ui.painter().add(strip);
        let stops = (high / low).log2();
        let place = |value: f32| bar.bottom() - (value / low).log2() / stops * bar.height();
        let mut above = f32::INFINITY;
        for value in round_numbers(low, high) {
            let at = egui::pos2(bar.right() + 6.0, place(value));
            // Numbers that would touch the one before are left out.
            if above - at.y < 11.0 {
                continue;
            }
            above = at.y;
            let color = ui.visuals().text_color();
            ui.painter().text(
                at,
                Align2::LEFT_CENTER,
                self.text(value),
                font.clone(),
                color,
            );
        }
        if let Some(value) = self.here {
            let stroke = egui::Stroke::new(2.0, Color32::WHITE);
            let y = place(value.clamp(low, high));
            ui.painter().hline(bar.x_range(), y, stroke);
        }
    }

    /// What is under the cursor.
    pub(super) fn read_out(&self) -> String {
        match self.here {
            Some(value) if self.percent => format!("here: {}", self.text(value)),
            Some(value) => format!("here: {} lx", short(value)),
            None => "here: -".to_owned(),
        }
    }
}

/// 1, 2 and 5 times the powers of ten from `low` to `high`.
fn round_numbers(low: f32, high: f32) -> Vec<f32> {
    let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
    decades
        .flat_map(|d| [1.0, 2.0, 5.0].map(|m| m * 10f32.powi(d)))
        .filter(|v| *v >= low * 0.999 && *v <= high * 1.001)
        .collect()
}

/// The next of 1, 2 and 5 times the powers of ten that is no larger.
pub(super) fn round_down(value: f32) -> f32 {
    let decade = 10f32.powf(value.log10().floor());
    let steps = [5.0, 2.0, 1.0].map(|s| s * decade);
    let step = steps.into_iter().find(|s| *s <= value * 1.0001);
    step.unwrap_or(value)
}

/// The next of 1, 2 and 5 times the powers of ten that is no smaller.
pub(super) fn round_up(value: f32) -> f32 {
    let decade = 10f32.powf(value.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|s| s * decade);
    let step = steps.into_iter().find(|s| *s >= value * 0.9999);
    step.unwrap_or(value)
}

/// Three digits.
pub(super) fn short(value: f32) -> String {
    match value {
        v if v >= 1e5 => format!("{:.0}k", v / 1e3),
        v if v >= 100.0 => format!("{v:.0}"),
        v if v >= 10.0 => format!("{v:.1}"),
        v if v >= 1.0 => format!("{v:.2}"),
        v if v >= 1e-2 || v == 0.0 => format!("{v:.3}"),
        v => format!("{v:.0e}"),
    }
}

/// As in `view_tone.frag`.
pub(super) fn turbo(x: f32) -> [f32; 3] {
    let fit = |c: [f32; 6]| {
        let sum = c.iter().rev().fold(0.0, |sum, c| sum * x + c);
        sum.clamp(0.0, 1.0)
    };
    [
        fit([
            0.135_721_4,
            4.615_392_6,
            -42.660_324,
            132.131_08,
            -152.942_4,
            59.286_38,
        ]),
        fit([
            0.091_402_61,
            2.194_188_4,
            4.842_966_6,
            -14.185_034,
            4.277_298_5,
            2.829_566,
        ]),
        fit([
            0.106_673_3,
            12.641_946,
            -60.582_047,
            110.362_77,
            -89.903_11,
            27.348_25,
        ]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_are_marked_with_round_numbers() {
        assert_eq!(round_numbers(0.5, 10.0), [0.5, 1.0, 2.0, 5.0, 10.0]);
        assert_eq!(short(0.5), "0.500");
        assert_eq!(short(1234.6), "1235");
        assert_eq!(short(123_456.0), "123k");
        assert_eq!(short(0.0004), "4e-4");
    }

    #[test]
    fn numbers_are_rounded_to_the_scale_s_own() {
        for (value, down, up) in [(0.03, 0.02, 0.05), (1.0, 1.0, 1.0), (70.0, 50.0, 100.0)] {
            assert!((round_down(value) / down - 1.0).abs() < 1e-4, "{value}");
            assert!((round_up(value) / up - 1.0).abs() < 1e-4, "{value}");
        }
    }
}

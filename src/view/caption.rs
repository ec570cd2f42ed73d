//! Scales of false colours on pictures that no window shows.

use super::legend::Legend;
use super::painter::Painter;
use crate::gpu::{Commands, Format, Gpu, Image, Result};

/// Draws scales.
pub(super) struct Caption {
    egui: egui::Context,
    painter: Painter,
}

impl Caption {
    /// For targets of a format.
    pub(super) fn new(gpu: &Gpu, format: Format) -> Result<Self> {
        Ok(Self {
            egui: egui::Context::default(),
            painter: Painter::new(gpu, format)?,
        })
    }

    /// Records the scales onto a picture, side by side from its left edge on.
    pub(super) fn record(
        &mut self,
        cmd: &mut Commands,
        target: &Image,
        legends: &[Legend],
    ) -> Result<()> {
        let [width, height] = target.size().map(|s| s as f32);
        let draw = |ctx: &egui::Context| {
            egui::Area::new("scales".into())
                .fixed_pos([12.0, 12.0])
                .interactable(false)
                .fade_in(false)
                .show(ctx, |ui| {
                    ui.horizontal_top(|ui| {
                        for legend in legends {
                            egui::Frame::popup(ui.style()).show(ui, |ui| {
                                ui.vertical(|ui| legend.draw(ui));
                            });
                        }
                    });
                });
        };
        // The first run of a new area only measures it.
        let mut changes = egui::TexturesDelta::default();
        let mut shapes = Vec::new();
        for _ in 0..2 {
            let input = egui::RawInput {
                screen_rect: Some(egui::Rect::from_min_size(
                    egui::Pos2::ZERO,
                    egui::vec2(width, height),
                )),
                ..Default::default()
            };
            let output = self.egui.run(input, draw);
            changes.append(output.textures_delta);
            shapes = output.shapes;
        }
        let primitives = self.egui.tessellate(shapes, 1.0);
        self.painter.record(cmd, target, &changes, &primitives, 1.0)
    }
}

//! Marks in the scene: lights, the selection's box, and numbers as people write them.

use egui::{Color32, Pos2, Stroke};
use glam::{Mat4, Vec3, Vec4};

use super::super::pick::{light_mark, project};
use super::super::shown::Shown;
use super::super::state::Viewer;
use crate::scene::{Aperture, Bounds};

const SELECTED: Color32 = Color32::from_rgb(255, 170, 60);

/// Draws lights and the selection's box onto the picture.
pub(in super::super) fn marks(viewer: &Viewer, ui: &egui::Ui, shown: &Shown, clip: &Mat4) {
    let scene = &shown.scene;
    let bounds = shown.bounds();
    for (l, light) in scene.lights.iter().enumerate() {
        let at = light_mark(scene, l, &bounds).and_then(|at| project(clip, viewer.screen, at));
        let Some(at) = at else { continue };
        let selected = viewer.selection == Some(light.node);
        let ring = if selected {
            SELECTED
        } else {
            Color32::from_black_alpha(160)
        };
        let strength = light.intensity.max_element();
        let tint = if strength > 0.0 {
            light.intensity / strength
        } else {
            Vec3::splat(0.2)
        };
        let [r, g, b] = tint
            .to_array()
            .map(|v| (v.clamp(0.0, 1.0).powf(0.4545) * 255.0) as u8);
        let painter = ui.painter();
        painter.circle(at, 6.0, Color32::from_rgb(r, g, b), Stroke::new(2.0, ring));
        if matches!(light.aperture, Aperture::Directional) {
            for i in 0..8 {
                let way = egui::Vec2::angled(i as f32 * std::f32::consts::FRAC_PI_4);
                painter.line_segment([at + way * 9.0, at + way * 13.0], Stroke::new(2.0, ring));
            }
        }
    }
    let Some(node) = viewer.selection else { return };
    let object = scene.objects.iter().position(|o| o.node == node);
    let bounds = object.map(|o| shown.object_bounds(o as u32));
    if let Some(bounds) = bounds.filter(|b| b.min.x <= b.max.x) {
        for (a, b) in edges(&bounds) {
            if let Some(line) = clipped(clip, viewer.screen, a, b) {
                ui.painter().line_segment(line, Stroke::new(1.5, SELECTED));
            }
        }
    }
}

/// The twelve edges of a box.
pub(in super::super) fn edges(b: &Bounds) -> impl Iterator<Item = (Vec3, Vec3)> + use<> {
    let b = *b;
    let corner = move |i: usize| {
        let pick = |axis: usize| {
            if i >> axis & 1 == 0 {
                b.min[axis]
            } else {
                b.max[axis]
            }
        };
        Vec3::new(pick(0), pick(1), pick(2))
    };
    (0..8).flat_map(move |i| {
        (0..3)
            .filter(move |axis| i >> axis & 1 == 0)
            .map(move |axis| (corner(i), corner(i | 1 << axis)))
    })
}

/// A line of the world on the screen, as far as it is in front of the camera.
pub(in super::super) fn clipped(
    clip: &Mat4,
    screen: egui::Rect,
    a: Vec3,
    b: Vec3,
) -> Option<[Pos2; 2]> {
    const NEAR: f32 = 1e-3;
    let (mut a, mut b) = (*clip * a.extend(1.0), *clip * b.extend(1.0));
    if a.w < NEAR && b.w < NEAR {
        return None;
    }
    let cut = |inside: Vec4, outside: Vec4| {
        let share = (NEAR - outside.w) / (inside.w - outside.w);
        outside + (inside - outside) * share
    };
    if a.w < NEAR {
        a = cut(b, a);
    } else if b.w < NEAR {
        b = cut(a, b);
    }
    let at = |c: Vec4| {
        let x = screen.min.x + screen.width() * (0.5 + 0.5 * c.x / c.w);
        let y = screen.min.y + screen.height() * (0.5 - 0.5 * c.y / c.w);
        Pos2::new(x, y)
    };
    Some([at(a), at(b)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_has_twelve_edges_along_its_axes() {
        let bounds = Bounds {
            min: Vec3::ZERO,
            max: Vec3::new(1.0, 2.0, 3.0),
        };
        let edges: Vec<_> = edges(&bounds).collect();
        assert_eq!(edges.len(), 12);
        let total: f32 = edges.iter().map(|(a, b)| a.distance(*b)).sum();
        assert!((total - 24.0).abs() < 1e-5);
    }
}

//! Moving over a page of the lightmap, and what is selected on it.

use egui::{Color32, Pos2, Rect, Stroke, StrokeKind};
use glam::Vec2;

use super::shown::Shown;
use super::state::Viewer;

/// How much a notch of the wheel changes the size.
const NOTCH: f32 = 1.2;
const SELECTED: Color32 = Color32::from_rgb(255, 170, 60);

/// Follows the mouse over a page, and outlines the selection's rectangle. Whether something moves.
pub(super) fn page(
    viewer: &mut Viewer,
    ui: &egui::Ui,
    area: &egui::Response,
    shown: &Shown,
) -> bool {
    let Some(atlas) = &shown.atlas else {
        return false;
    };
    let screen = viewer.screen;
    let page_size = atlas.page_size as f32;
    let size = Vec2::new(screen.width(), screen.height());
    let scale = viewer.page.pixels_per_texel(size, page_size);
    let middle = Vec2::new(screen.center().x, screen.center().y);
    let dragged = area.drag_delta();
    viewer.page.center -= Vec2::new(dragged.x, dragged.y) / (scale * page_size);
    let wheel = match area.hovered() {
        true => ui.input(|i| i.raw_scroll_delta.y / 50.0),
        false => 0.0,
    };
    if let (Some(at), true) = (area.hover_pos(), wheel != 0.0) {
        // What is under the cursor stays there.
        let away = (Vec2::new(at.x, at.y) - middle) / page_size;
        let before = away / scale;
        viewer.page.zoom = (viewer.page.zoom * NOTCH.powf(wheel)).clamp(0.5, 200.0);
        let after = away / viewer.page.pixels_per_texel(size, page_size);
        viewer.page.center += before - after;
    }
    viewer.page.center = viewer.page.center.clamp(Vec2::ZERO, Vec2::ONE);
    let scale = viewer.page.pixels_per_texel(size, page_size);
    let center = viewer.page.center * page_size;
    let number = viewer.page.page;
    let mut objects = (0u32..).zip(&atlas.objects);
    if let (Some(at), true) = (area.interact_pointer_pos(), area.clicked()) {
        let texel = (Vec2::new(at.x, at.y) - middle) / scale + center;
        let hit = objects.clone().find(|(o, object)| {
            let [from, extent] = [object.origin.as_vec2(), object.size.as_vec2()];
            object.page == number
                && !shown.scene.is_gone(*o)
                && texel.cmpge(from).all()
                && texel.cmplt(from + extent).all()
        });
        viewer.selection = hit.map(|(o, _)| shown.scene.objects[o as usize].node);
    }
    let selected = objects.find(|(o, _)| {
        viewer.selection == Some(shown.scene.objects[*o as usize].node) && !shown.scene.is_gone(*o)
    });
    if let Some((_, object)) = selected.filter(|(_, object)| object.page == number) {
        let place = |texel: Vec2| {
            let at = (texel - center) * scale + middle;
            Pos2::new(at.x, at.y)
        };
        let from = object.origin.as_vec2();
        let rect = Rect::from_two_pos(place(from), place(from + object.size.as_vec2()));
        let stroke = Stroke::new(2.0, SELECTED);
        ui.painter()
            .rect_stroke(rect, 0.0, stroke, StrokeKind::Outside);
    }
    area.dragged() || wheel != 0.0
}

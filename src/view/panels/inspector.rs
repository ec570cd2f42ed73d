//! The selection and what can be changed of it; without one, all there is to select.

mod lamp;
mod surface;

use glam::{DQuat, EulerRot};

use super::super::input::Action;
use super::super::place::{Handle, Place};
use super::super::shown::Shown;
use super::super::state::Viewer;
use super::super::worker::Request;
use crate::scene::{Aperture, Light};
use lamp::{aperture, punctual};
use surface::surface;

/// Most names in the list of what there is.
const LISTED: usize = 400;

pub(super) fn inspector(
    viewer: &mut Viewer,
    ui: &mut egui::Ui,
    shown: &Shown,
    actions: &mut Vec<Action>,
) {
    let scene = &shown.scene;
    let Some(node) = viewer.selection else {
        ui.heading("Scene");
        list(ui, shown, actions);
        return;
    };
    let object = scene.objects.iter().position(|o| o.node == node);
    let object = object.filter(|o| !scene.is_gone(*o as u32));
    let light = scene.lights.iter().find(|l| l.node == node);
    let name = object
        .map(|o| scene.objects[o].name.as_str())
        .or(light.map(|l| l.name.as_str()));
    ui.horizontal(|ui| {
        ui.heading(name.unwrap_or("nothing"));
        if ui.small_button("✖").on_hover_text("Esc").clicked() {
            actions.push(Action::Deselect);
        }
    });
    ui.horizontal(|ui| {
        for (text, action) in [
            ("Focus", Action::Focus),
            ("Duplicate", Action::Duplicate),
            ("Remove", Action::Delete),
        ] {
            if ui.button(text).clicked() {
                actions.push(action);
            }
        }
    });
    placement(viewer, ui, shown, node);
    if let Some(light) = light.filter(|l| !matches!(l.aperture, Aperture::Surface { .. })) {
        ui.separator();
        punctual(viewer, ui, node, light);
    }
    if let Some(object) = object {
        let mesh = scene.mesh(object as u32);
        let mut materials: Vec<u32> = mesh.primitives.iter().map(|p| p.material).collect();
        materials.sort_unstable();
        materials.dedup();
        for material in materials {
            ui.separator();
            surface(viewer, ui, shown, object as u32, material);
        }
        let own = |l: &Light| matches!(l.aperture, Aperture::Surface { object: o } if o as usize == object);
        if scene.lights.iter().any(own) {
            aperture(viewer, ui, shown, node, object as u32);
        }
    }
}

fn list(ui: &mut egui::Ui, shown: &Shown, actions: &mut Vec<Action>) {
    let scene = &shown.scene;
    let mut entry = |ui: &mut egui::Ui, name: &str, node: u32| {
        if ui.selectable_label(false, name).clicked() {
            actions.push(Action::Select(node));
        }
    };
    let lights = scene.lights.iter().take(LISTED);
    ui.collapsing(counted(scene.lights.len(), "light"), |ui| {
        for light in lights {
            entry(ui, &light.name, light.node);
        }
    });
    let there: Vec<_> = (0u32..)
        .zip(&scene.objects)
        .filter(|(o, _)| !scene.is_gone(*o))
        .collect();
    ui.collapsing(counted(there.len(), "object"), |ui| {
        for (_, object) in there.iter().take(LISTED) {
            entry(ui, &object.name, object.node);
        }
        if there.len() > LISTED {
            ui.weak(format!("and {} more: click them", there.len() - LISTED));
        }
    });
}

/// "1 light", "2 lights".
fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// A field for a number; what is typed counts when it is finished.
fn number_field<N: egui::emath::Numeric>(value: &mut N) -> egui::DragValue<'_> {
    egui::DragValue::new(value).update_while_editing(false)
}

/// A field that is dragged or typed into: whether its value is new, and whether that begins a drag. A field that is only
/// clicked into says that it has changed, too, rounded to what it shows.
fn changed(response: &egui::Response, before: f64, after: f64) -> Option<bool> {
    let rounding = 1e-5 * before.abs().max(after.abs());
    (response.changed() && (after - before).abs() > rounding)
        .then(|| response.drag_started() || !response.dragged())
}

fn placement(viewer: &mut Viewer, ui: &mut egui::Ui, shown: &Shown, node: u32) {
    let known = viewer.place.filter(|(n, _)| *n == node).map(|(_, p)| p);
    let Some(mut place) = known.or_else(|| Place::of(&shown.json, node)) else {
        return;
    };
    let mut what = None;
    let (x, y, z) = place.rotation.to_euler(EulerRot::YXZ);
    let mut degrees = [y, x, z].map(f64::to_degrees);
    egui::Grid::new("place").num_columns(4).show(ui, |ui| {
        let mut row = |ui: &mut egui::Ui, text, values: &mut [f64; 3], speed, handle| {
            ui.label(text);
            for value in values {
                let before = *value;
                let field = number_field(value).speed(speed).max_decimals(4);
                let response = ui.add(field);
                // To what is shown.
                let after = if (*value - before).abs() > 5e-5 {
                    *value
                } else {
                    before
                };
                if let Some(first) = changed(&response, before, after) {
                    what = Some((handle, first));
                }
            }
            ui.end_row();
        };
        row(
            ui,
            "position",
            place.translation.as_mut(),
            0.01,
            Handle::Move,
        );
        row(ui, "rotation", &mut degrees, 0.5, Handle::Turn);
        row(ui, "scale", place.scale.as_mut(), 0.01, Handle::Scale);
    });
    if let Some((handle, first)) = what {
        if handle == Handle::Turn {
            let [y, x, z] = degrees.map(f64::to_radians);
            place.rotation = DQuat::from_euler(EulerRot::YXZ, x, y, z);
        }
        place = place.scaled_by(glam::DVec3::ONE);
        viewer.place = Some((node, place));
        viewer.ask(Request::Drag(place.edit(node, handle, false), first));
    }
}

//! The selection and what can be changed of it; without one, all there is to select.

use glam::{DQuat, EulerRot, Vec3};

use super::super::input::Action;
use super::super::place::{Handle, Place};
use super::super::shown::Shown;
use super::super::state::Viewer;
use super::super::units::{color_of_temperature, lumens_per_candela, strength_and_color};
use super::super::worker::Request;
use crate::scene::edit::{Edit, Name, Spot};
use crate::scene::{Aperture, Light};

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
    ui.collapsing(format!("{} lights", scene.lights.len()), |ui| {
        for light in lights {
            entry(ui, &light.name, light.node);
        }
    });
    let there: Vec<_> = (0u32..)
        .zip(&scene.objects)
        .filter(|(o, _)| !scene.is_gone(*o))
        .collect();
    ui.collapsing(format!("{} objects", there.len()), |ui| {
        for (_, object) in there.iter().take(LISTED) {
            entry(ui, &object.name, object.node);
        }
        if there.len() > LISTED {
            ui.weak(format!("and {} more: click them", there.len() - LISTED));
        }
    });
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

fn punctual(viewer: &mut Viewer, ui: &mut egui::Ui, node: u32, light: &Light) {
    let (mut strength, color) = strength_and_color(light);
    let mut edit = (None, None, None);
    let mut first = true;
    let mut number = |ui: &mut egui::Ui, value: &mut f32, unit: &str| {
        let (speed, before) = ((*value * 0.01).max(1e-3), *value);
        let field = number_field(value).speed(speed).range(0.0..=1e9);
        let response = ui.add(field.suffix(unit));
        let is_new = changed(&response, before.into(), (*value).into());
        first &= is_new.unwrap_or(true);
        is_new.is_some()
    };
    let kind = match light.aperture {
        Aperture::Point => "point light",
        Aperture::Spot { .. } => "spot light",
        _ => "sun",
    };
    ui.label(kind);
    ui.horizontal(|ui| match lumens_per_candela(&light.aperture) {
        Some(factor) => {
            let mut lumens = strength * factor;
            if number(ui, &mut strength, " cd") {
                edit.0 = Some(strength);
            }
            if number(ui, &mut lumens, " lm") {
                edit.0 = Some(lumens / factor);
            }
        }
        None => {
            if number(ui, &mut strength, " lx") {
                edit.0 = Some(strength);
            }
        }
    });
    ui.horizontal(|ui| {
        let mut rgb = color.to_array();
        let response = ui.color_edit_button_rgb(&mut rgb);
        if response.changed() {
            edit.1 = Some(Vec3::from_array(rgb));
            first = false;
        }
        let id = ui.id().with(("kelvin", node));
        let mut kelvin: f32 = ui.data(|d| d.get_temp(id)).unwrap_or(6500.0);
        let before = kelvin;
        let slider = egui::Slider::new(&mut kelvin, 1500.0..=15_000.0).logarithmic(true);
        let response = ui.add(slider.suffix(" K"));
        if let Some(is_first) = changed(&response, before.into(), kelvin.into()) {
            ui.data_mut(|d| d.insert_temp(id, kelvin));
            edit.1 = Some(color_of_temperature(kelvin));
            first &= is_first;
        }
    });
    if let Aperture::Spot { inner, outer } = light.aperture {
        let mut angles = [inner, outer].map(f32::to_degrees);
        ui.horizontal(|ui| {
            ui.label("cone");
            for angle in &mut angles {
                let before = *angle;
                let field = number_field(angle).speed(0.2).range(0.0..=90.0);
                let response = ui.add(field.suffix("°"));
                if let Some(is_first) = changed(&response, before.into(), (*angle).into()) {
                    first &= is_first;
                    edit.2 = Some(());
                }
            }
        });
        if edit.2.is_some() {
            let outer = angles[1].to_radians().min(std::f32::consts::FRAC_PI_2);
            let spot = Spot {
                inner_cone_angle: Some(f64::from(angles[0].to_radians().min(outer))),
                outer_cone_angle: Some(f64::from(outer)),
            };
            viewer.ask(Request::Drag(
                light_edit(node, None, None, Some(spot)),
                first,
            ));
            return;
        }
    }
    if edit.0.is_some() || edit.1.is_some() {
        viewer.ask(Request::Drag(light_edit(node, edit.0, edit.1, None), first));
    }
}

fn light_edit(node: u32, intensity: Option<f32>, color: Option<Vec3>, spot: Option<Spot>) -> Edit {
    Edit::Light {
        node: Name::Index(node),
        intensity: intensity.map(f64::from),
        color: color.map(|c| c.to_array().map(|v| f64::from(v.clamp(0.0, 1.0)))),
        spot,
    }
}

fn surface(viewer: &mut Viewer, ui: &mut egui::Ui, shown: &Shown, object: u32, index: u32) {
    let material = &shown.scene.materials[index as usize];
    let Some(source) = material.source else {
        ui.weak("the default material");
        return;
    };
    ui.push_id(("material", index), |ui| {
        ui.strong(&material.name);
        let emits = material.emission.max_element();
        let (mut base, mut glow) = (None, None);
        let mut first = true;
        ui.horizontal(|ui| {
            let mut rgb = material.base_color.truncate().to_array();
            ui.label("colour");
            if ui.color_edit_button_rgb(&mut rgb).changed() {
                base = Some(rgb);
                first = false;
            }
            if material.base_color_texture.is_some() {
                ui.weak("times its image");
            }
        });
        ui.horizontal(|ui| {
            ui.label("emits");
            let mut strength = emits;
            let speed = (strength * 0.01).max(0.01);
            let field = number_field(&mut strength).speed(speed).range(0.0..=1e9);
            let response = ui.add(field.suffix(" cd/m²"));
            if let Some(is_first) = changed(&response, emits.into(), strength.into()) {
                glow = Some(strength);
                first &= is_first;
            }
            // What an image leaves of it is not known here.
            if emits > 0.0 && material.emission_texture.is_none() {
                let per_unit = lumens_per_nit(shown, object, index);
                let before = emits * per_unit;
                let mut lumens = before;
                let speed = (lumens * 0.01).max(0.01);
                let field = number_field(&mut lumens).speed(speed).range(0.0..=1e9);
                let response = ui.add(field.suffix(" lm"));
                if let Some(is_first) = changed(&response, before.into(), lumens.into()) {
                    glow = Some(lumens / per_unit.max(f32::MIN_POSITIVE));
                    first &= is_first;
                }
            }
        });
        if base.is_none() && glow.is_none() {
            return;
        }
        let [r, g, b] = base.unwrap_or_default().map(f64::from);
        // What has never emitted begins white.
        let factor = (glow.is_some() && emits == 0.0).then_some([1.0; 3]);
        let largest = factor_of(shown, source);
        let edit = Edit::Material {
            material: Name::Index(source),
            base_color_factor: base.map(|_| [r, g, b, f64::from(material.base_color.w)]),
            emissive_factor: factor,
            emissive_strength: glow
                .map(|s| f64::from(s) / if factor.is_some() { 1.0 } else { largest }),
        };
        viewer.ask(Request::Drag(edit, first));
    });
}

/// Lumens that an object's surfaces of a material send out, per cd/m² of its strongest channel.
fn lumens_per_nit(shown: &Shown, object: u32, material: u32) -> f32 {
    let (scene, place) = (
        &shown.scene,
        &shown.scene.objects[object as usize].transform,
    );
    let (mesh, looks) = (scene.mesh(object), &scene.materials[material as usize]);
    let own = mesh.primitives.iter().filter(|p| p.material == material);
    let triangles = own.flat_map(|p| p.triangles.clone());
    let area: f32 = triangles
        .map(|t| {
            let corners = mesh.triangles[t as usize].map(|v| mesh.positions[v as usize]);
            let [a, b, c] = corners.map(|p| place.transform_point3(p));
            0.5 * (b - a).cross(c - a).length()
        })
        .sum();
    let sides = if looks.double_sided { 2.0 } else { 1.0 };
    let bright = looks.emission.dot(Vec3::new(0.2126, 0.7152, 0.0722));
    std::f32::consts::PI * sides * area * bright / looks.emission.max_element()
}

/// The largest channel of a material's emissive factor, which its strength multiplies; 1 where that is 0.
fn factor_of(shown: &Shown, source: u32) -> f64 {
    let factor = shown
        .json
        .pointer(&format!("/materials/{source}/emissiveFactor"))
        .and_then(|f| f.as_array())
        .map(|f| f.iter().filter_map(|v| v.as_f64()).fold(0.0, f64::max));
    factor.filter(|f| *f > 0.0).unwrap_or(1.0)
}

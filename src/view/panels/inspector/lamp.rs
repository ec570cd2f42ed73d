//! What can be changed of a light: strength, colour, cone, and how large what shines is.

use glam::{DVec3, Vec3};

use super::super::super::place::{Handle, Place};
use super::super::super::shown::Shown;
use super::super::super::state::Viewer;
use super::super::super::units::{color_of_temperature, lumens_per_candela, strength_and_color};
use super::super::super::worker::Request;
use super::{changed, number_field};
use crate::scene::edit::{Edit, Name, Spot};
use crate::scene::{Aperture, Light};

/// The size of what shines: its radiance stays, so that its lumens go with its area.
pub(super) fn aperture(
    viewer: &mut Viewer,
    ui: &mut egui::Ui,
    shown: &Shown,
    node: u32,
    object: u32,
) {
    let known = viewer.place.filter(|(n, _)| *n == node).map(|(_, p)| p);
    let Some(place) = known.or_else(|| Place::of(&shown.json, node)) else {
        return;
    };
    let mesh = shown.scene.mesh(object);
    let positions = || mesh.positions.iter().map(|p| p.as_dvec3());
    let low = positions().fold(DVec3::INFINITY, DVec3::min);
    let high = positions().fold(DVec3::NEG_INFINITY, DVec3::max);
    let before = place.size(high - low);
    let (mut size, mut what) = (before, None);
    ui.horizontal(|ui| {
        ui.label("lamp size")
            .on_hover_text("along its own axes; it keeps its cd/m², its lumens go with its area");
        for axis in 0..3 {
            // A flat lamp has two.
            if before[axis] <= 1e-6 * before.max_element() {
                continue;
            }
            let speed = (0.01 * before[axis]).max(1e-3);
            let field = number_field(&mut size[axis]).speed(speed);
            let response = ui.add(field.range(1e-3..=1e4).max_decimals(3).suffix(" m"));
            // To what is shown.
            if (size[axis] - before[axis]).abs() < 5e-4 {
                size[axis] = before[axis];
            }
            what = what.or(changed(&response, before[axis], size[axis]));
        }
    });
    if let Some(first) = what {
        let place = place.sized([low, high], size);
        viewer.place = Some((node, place));
        viewer.ask(Request::Drag(place.edit(node, Handle::Scale, true), first));
    }
}

pub(super) fn punctual(viewer: &mut Viewer, ui: &mut egui::Ui, node: u32, light: &Light) {
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

//! What can be changed of a material: its colour and what it emits.

use glam::Vec3;

use super::super::super::shown::Shown;
use super::super::super::state::Viewer;
use super::super::super::worker::Request;
use super::{changed, number_field};
use crate::scene::edit::{Edit, Name};

pub(super) fn surface(
    viewer: &mut Viewer,
    ui: &mut egui::Ui,
    shown: &Shown,
    object: u32,
    index: u32,
) {
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

//! Edits of what is there: transforms, lights, materials.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use std::path::Path;

use glam::{Affine3A, Quat};
use serde_json::{Value, json};

use super::super::{
    Document,
    json::{extension, list, object, punctual, remove, set},
    nodes::local,
};
use super::names::{self, Name, place};
use super::{Edit, EditError, Spot};

impl Edit {
    /// Changes the document; on an error it may be half changed. `folder` is where files to be added are.
    pub(super) fn write(&self, document: &mut Document, folder: &Path) -> Result<(), EditError> {
        match self {
            Self::Transform {
                node,
                translation,
                rotation,
                scale,
            } => transform(document, node, *translation, *rotation, *scale),
            Self::Light {
                node,
                intensity,
                color,
                spot,
            } => light(document, node, *intensity, *color, *spot),
            Self::Material {
                material: name,
                base_color_factor,
                emissive_factor,
                emissive_strength,
            } => material(
                document,
                name,
                *base_color_factor,
                *emissive_factor,
                *emissive_strength,
            ),
            Self::Add { file, name, parent } => {
                super::insert::add(document, folder, file, name, parent.as_ref())
            }
            Self::Copy { node, name } => super::insert::copy(document, node, name),
            Self::Remove { node } => super::insert::detach(document, node),
        }
    }
}

fn transform(
    document: &mut Document,
    name: &Name,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
) -> Result<(), EditError> {
    let node = names::node(&document.json, name)?;
    let place = place("node", list(&document.json, "nodes"), node);
    if translation.is_none() && rotation.is_none() && scale.is_none() {
        return Err(nothing(&place, "node", "translation, rotation or scale"));
    }
    finite(&place, "translation", &translation)?;
    finite(&place, "rotation", &rotation)?;
    finite(&place, "scale", &scale)?;
    let rotation = rotation.map(|r| unit(&place, r)).transpose()?;
    if scale.is_some_and(|s| s.iter().any(|s| !(*s as f32).is_normal())) {
        let why = "a factor is 0, which leaves nothing of the node; use \"remove\" to hide it";
        return Err(EditError::field(&place, "scale", why));
    }

    let before = local(&document.json["nodes"][node], &place)?;
    let element = &mut document.json["nodes"][node];
    if let Some(matrix) = element.get_mut("matrix") {
        if rotation.is_none() && scale.is_none() {
            for (i, t) in translation.unwrap_or_default().into_iter().enumerate() {
                matrix[12 + i] = t.into();
            }
            return Ok(());
        }
        let kept = parts(&before).filter(|_| rotation.is_none() || scale.is_none());
        if kept.is_none() && (rotation.is_none() || scale.is_none()) {
            let (field, other) = match rotation {
                Some(_) => ("rotation", "scale"),
                None => ("scale", "rotation"),
            };
            let why = format!(
                "the node's matrix shears, so that it has no {other} to keep; give the {other} too"
            );
            return Err(EditError::field(&place, field, why));
        }
        let (old_scale, old_rotation) = kept.unwrap_or_default();
        remove(element, "matrix");
        let t: [f32; 3] = before.translation.to_array();
        set(
            element,
            "translation",
            json!(translation.unwrap_or(t.map(f64::from))),
        );
        set(element, "rotation", json!(rotation.unwrap_or(old_rotation)));
        set(element, "scale", json!(scale.unwrap_or(old_scale)));
        return Ok(());
    }
    if let Some(translation) = translation {
        set(element, "translation", json!(translation));
    }
    if let Some(rotation) = rotation {
        set(element, "rotation", json!(rotation));
    }
    if let Some(scale) = scale {
        set(element, "scale", json!(scale));
    }
    Ok(())
}

/// Scale and rotation of a transform that is made of these alone.
fn parts(transform: &Affine3A) -> Option<([f64; 3], [f64; 4])> {
    let (scale, rotation, translation) = transform.to_scale_rotation_translation();
    let again = Affine3A::from_scale_rotation_translation(scale, rotation, translation);
    let size = transform
        .matrix3
        .to_cols_array()
        .into_iter()
        .fold(0.0, |size: f32, v| size.max(v.abs()));
    again
        .matrix3
        .abs_diff_eq(transform.matrix3, 1e-4 * size)
        .then(|| {
            (
                scale.to_array().map(f64::from),
                rotation.to_array().map(f64::from),
            )
        })
}

/// As it is, if it is a unit quaternion as far as single precision tells; made one otherwise.
fn unit(place: &str, rotation: [f64; 4]) -> Result<[f64; 4], EditError> {
    let length = rotation.iter().map(|r| r * r).sum::<f64>().sqrt();
    let single = Quat::from_array(rotation.map(|r| r as f32));
    if !(length.is_normal() && single.length().is_normal()) {
        let why = "it has no direction; [0, 0, 0, 1] is no rotation";
        return Err(EditError::field(place, "rotation", why));
    }
    Ok(if (length - 1.0).abs() < 1e-6 {
        rotation
    } else {
        rotation.map(|r| r / length)
    })
}

fn light(
    document: &mut Document,
    name: &Name,
    intensity: Option<f64>,
    color: Option<[f64; 3]>,
    spot: Option<Spot>,
) -> Result<(), EditError> {
    let node = names::node(&document.json, name)?;
    let nodes = list(&document.json, "nodes");
    let place = place("node", nodes, node);
    if intensity.is_none() && color.is_none() && spot.is_none_or(|s| s == Spot::default()) {
        return Err(nothing(&place, "node", "intensity, color or spot"));
    }
    let light_of = |node: &Value| {
        extension(node, "KHR_lights_punctual")?
            .get("light")?
            .as_u64()
    };
    let Some(mut light) = light_of(&nodes[node]) else {
        let why = "it has no punctual light; if it shines, its material does: use \"material\"";
        return Err(EditError::field(&place, "node", why));
    };
    not_negative(&place, "intensity", intensity)?;
    in_unit_range(&place, "color", &color)?;

    // Other nodes keep what they share with this one.
    if nodes.iter().filter(|n| light_of(n) == Some(light)).count() > 1 {
        let own = punctual(&document.json)[light as usize].clone();
        light = document.push_light(own) as u64;
        document.json["nodes"][node]["extensions"]["KHR_lights_punctual"]["light"] = light.into();
    }
    let element = &mut document.json["extensions"]["KHR_lights_punctual"]["lights"][light as usize];
    if let Some(spot) = spot {
        if element.get("type").and_then(Value::as_str) != Some("spot") {
            let why = "its light is no spot; leave it out, or add a spot from a file instead";
            return Err(EditError::field(&place, "spot", why));
        }
        cone(&place, object(element, "spot"), spot)?;
    }
    if let Some(intensity) = intensity {
        set(element, "intensity", intensity);
    }
    if let Some(color) = color {
        set(element, "color", json!(color));
    }
    Ok(())
}

fn cone(place: &str, element: &mut Value, spot: Spot) -> Result<(), EditError> {
    for (key, angle) in [
        ("innerConeAngle", spot.inner_cone_angle),
        ("outerConeAngle", spot.outer_cone_angle),
    ] {
        if let Some(angle) = angle {
            set(element, key, angle);
        }
    }
    let angle = |key, or| element.get(key).and_then(Value::as_f64).unwrap_or(or);
    let (inner, outer) = (
        angle("innerConeAngle", 0.0),
        angle("outerConeAngle", FRAC_PI_4),
    );
    // In single precision, as it is read: an angle that is written as pi/2 may be a little more.
    if 0.0 <= inner && inner <= outer && (outer as f32).is_normal() && outer <= FRAC_PI_2 + 1e-6 {
        return Ok(());
    }
    let why = format!(
        "0 <= innerConeAngle ({inner}) <= outerConeAngle ({outer}) <= pi/2 does not hold; give both, in radians"
    );
    Err(EditError::field(place, "spot", why))
}

fn material(
    document: &mut Document,
    name: &Name,
    base_color: Option<[f64; 4]>,
    emissive: Option<[f64; 3]>,
    strength: Option<f64>,
) -> Result<(), EditError> {
    let material = names::material(&document.json, name)?;
    let place = place("material", list(&document.json, "materials"), material);
    if base_color.is_none() && emissive.is_none() && strength.is_none() {
        let fields = "baseColorFactor, emissiveFactor or emissiveStrength";
        return Err(nothing(&place, "material", fields));
    }
    in_unit_range(&place, "baseColorFactor", &base_color)?;
    in_unit_range(&place, "emissiveFactor", &emissive)?;
    not_negative(&place, "emissiveStrength", strength)?;
    let element = &mut document.json["materials"][material];
    if let Some(color) = base_color {
        let pbr = object(element, "pbrMetallicRoughness");
        set(pbr, "baseColorFactor", json!(color));
    }
    if let Some(color) = emissive {
        set(element, "emissiveFactor", json!(color));
    }
    if let Some(strength) = strength {
        let extension = "KHR_materials_emissive_strength";
        let strengths = object(object(element, "extensions"), extension);
        set(strengths, "emissiveStrength", strength);
        document.use_extension(extension);
    }
    Ok(())
}

fn nothing(place: &str, field: &'static str, fields: &str) -> EditError {
    let why = format!("nothing of it is to be changed; give {fields}");
    EditError::field(place, field, why)
}

fn finite(
    place: &str,
    field: &'static str,
    values: &Option<impl AsRef<[f64]>>,
) -> Result<(), EditError> {
    let fine = |v: &f64| (*v as f32).is_finite();
    if values.as_ref().is_none_or(|v| v.as_ref().iter().all(fine)) {
        return Ok(());
    }
    let why = "a number is not finite in single precision (beyond 3.4e38); give a smaller one";
    Err(EditError::field(place, field, why))
}

fn not_negative(place: &str, field: &'static str, value: Option<f64>) -> Result<(), EditError> {
    finite(place, field, &value.map(|v| [v]))?;
    match value {
        Some(value) if value < 0.0 => {
            let why = format!("{value} is negative; give 0 or more");
            Err(EditError::field(place, field, why))
        }
        _ => Ok(()),
    }
}

fn in_unit_range(
    place: &str,
    field: &'static str,
    values: &Option<impl AsRef<[f64]>>,
) -> Result<(), EditError> {
    let values = values.as_ref().map_or(&[][..], |v| v.as_ref());
    let outside = values.iter().find(|v| !(0.0..=1.0).contains(*v));
    match outside {
        Some(value) => {
            let instead = match field {
                "color" => "; brightness is \"intensity\"",
                "emissiveFactor" => "; brightness is \"emissiveStrength\"",
                _ => "",
            };
            let why = format!("{value} is not between 0 and 1{instead}");
            Err(EditError::field(place, field, why))
        }
        None => Ok(()),
    }
}

//! Lights that the user adds to a scene: a sun, points, and the lights of another file. They enter the document too.

use std::path::Path;

use glam::{Affine3A, Quat, Vec3};
use serde_json::{Value, json};

use super::{
    Aperture, Light, Scene,
    copier::Copier,
    document::Document,
    error::SceneError,
    json::{extension, list, punctual},
};

impl Scene {
    /// Adds a sun. `elevation` and `azimuth` say where it stands, in degrees: above the horizon (-90 to 90), and around Y
    /// from -Z (0) over +X (90). `lux` is the illuminance of a surface that faces it, times the linear RGB `color`.
    ///
    /// # Errors
    /// [`SceneError::BadLight`] for values that are not finite, out of range, or dark.
    pub fn add_sun(
        &mut self,
        document: &mut Document,
        elevation: f32,
        azimuth: f32,
        lux: f32,
        color: Vec3,
    ) -> Result<(), SceneError> {
        if !((-90.0..=90.0).contains(&elevation) && azimuth.is_finite()) {
            let why =
                "the elevation must be between -90 and 90 degrees, the azimuth a number of degrees"
                    .into();
            return Err(SceneError::BadLight {
                what: "the sun".into(),
                why,
            });
        }
        let intensity = shining("the sun", "lux", lux, color)?;
        // Turns +Z, which the light comes from, to where the sun stands.
        let rotation = Quat::from_rotation_y(std::f32::consts::PI - azimuth.to_radians())
            * Quat::from_rotation_x(-elevation.to_radians());
        self.add_light(
            document,
            "sun",
            Aperture::Directional,
            intensity,
            Affine3A::from_quat(rotation),
        );
        Ok(())
    }

    /// Adds a point light of `candela` times the linear RGB `color` at a place in the world, metres.
    ///
    /// # Errors
    /// [`SceneError::BadLight`] for values that are not finite or dark.
    pub fn add_point(
        &mut self,
        document: &mut Document,
        position: Vec3,
        candela: f32,
        color: Vec3,
    ) -> Result<(), SceneError> {
        if !position.is_finite() {
            return Err(SceneError::BadLight {
                what: "the point light".into(),
                why: "its position must be three finite numbers".into(),
            });
        }
        let intensity = shining("the point light", "candela", candela, color)?;
        self.add_light(
            document,
            "point",
            Aperture::Point,
            intensity,
            Affine3A::from_translation(position),
        );
        Ok(())
    }

    fn add_light(
        &mut self,
        document: &mut Document,
        name: &str,
        aperture: Aperture,
        intensity: Vec3,
        transform: Affine3A,
    ) {
        let kind = if aperture == Aperture::Point {
            "point"
        } else {
            "directional"
        };
        let strength = intensity.max_element();
        // The scene gets what a reader of the written file gets, so that both bake alike.
        let color = intensity / strength;
        let light =
            json!({ "type": kind, "name": name, "color": color.to_array(), "intensity": strength });
        let (_, rotation, translation) = transform.to_scale_rotation_translation();
        let node = json!({ "name": name, "translation": translation.to_array(), "rotation": rotation.to_array() });
        let node = push_light(document, light, node);
        let transform = super::nodes::rigid(&Affine3A::from_rotation_translation(
            rotation / rotation.length(),
            translation,
        ));
        self.lights.push(Light {
            name: name.into(),
            node: node as u32,
            aperture,
            intensity: color * strength,
            transform,
        });
    }
}

/// Lays the lights of another glTF file over a scene: its punctual lights and its objects that emit (whole meshes, with
/// their materials), where they stand in that file. The scene is then read from the document again.
///
/// # Errors
/// [`SceneError::In`] for whatever is wrong with the other file, its having no light included; what [`Scene::from_document`]
/// finds in both together. Scene and document are then as they were.
pub fn overlay_lights(
    scene: &mut Scene,
    document: &mut Document,
    path: &Path,
) -> Result<(), SceneError> {
    let (other, source) = Scene::load(path)
        .and_then(|(other, source)| match other.lights.len() {
            0 => Err(SceneError::NoLight),
            _ => Ok((other, source)),
        })
        .map_err(|cause| match cause {
            SceneError::Read { .. } => cause,
            cause => SceneError::In {
                path: path.into(),
                cause: Box::new(cause),
            },
        })?;
    let mut merged = document.clone();
    let mut copier = Copier::new(&source, &mut merged, "the file of --lights".into());
    for light in &other.lights {
        let node = &list(&source.json, "nodes")[light.node as usize];
        if let Aperture::Surface { object } = light.aperture {
            let object = &other.objects[object as usize];
            let mesh = copier.mesh(other.meshes[object.mesh as usize].source as usize)?;
            let matrix = glam::Mat4::from(object.transform).to_cols_array();
            copier
                .to
                .push_root(json!({ "name": object.name, "mesh": mesh, "matrix": matrix }));
        } else if let Some(i) = extension(node, "KHR_lights_punctual")
            .and_then(|e| e.get("light"))
            .and_then(Value::as_u64)
        {
            let light_of_node = punctual(&source.json)[i as usize].clone();
            let (_, rotation, translation) = light.transform.to_scale_rotation_translation();
            let node = json!({ "name": light.name, "translation": translation.to_array(), "rotation": rotation.to_array() });
            push_light(copier.to, light_of_node, node);
        }
    }
    copier.extensions();
    *scene = Scene::from_document(&merged)?;
    *document = merged;
    Ok(())
}

/// Adds a `KHR_lights_punctual` light and the node that carries it; returns the node.
pub(super) fn push_light(document: &mut Document, light: Value, mut node: Value) -> usize {
    let light = document.push_light(light);
    node["extensions"] = json!({ "KHR_lights_punctual": { "light": light } });
    document.push_root(node)
}

fn shining(what: &str, unit: &str, strength: f32, color: Vec3) -> Result<Vec3, SceneError> {
    let intensity = color * strength;
    if intensity.is_finite()
        && intensity.min_element() >= 0.0
        && intensity.max_element() > 0.0
        && strength > 0.0
    {
        return Ok(intensity);
    }
    let why = format!("its {unit} and its colour must be positive, finite numbers");
    Err(SceneError::BadLight {
        what: what.into(),
        why,
    })
}

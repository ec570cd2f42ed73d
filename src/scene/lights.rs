//! Lights that the user adds to a scene: a sun, points, and the lights of another file. They enter the document too.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use glam::{Affine3A, Quat, Vec3};
use serde_json::{Value, json};

use super::{
    Aperture, Light, Scene,
    document::{Document, ImageData},
    error::{SceneError, invalid},
    json::{extension, list, push},
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
        let transform = super::load::rigid(&Affine3A::from_rotation_translation(
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
    let mut copier = Copier {
        from: &source,
        to: &mut merged,
        copied: BTreeMap::new(),
    };
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
            let punctual = extension(&source.json, "KHR_lights_punctual")
                .map_or(&[][..], |e| list(e, "lights"));
            let (_, rotation, translation) = light.transform.to_scale_rotation_translation();
            let node = json!({ "name": light.name, "translation": translation.to_array(), "rotation": rotation.to_array() });
            push_light(copier.to, punctual[i as usize].clone(), node);
        }
    }
    for name in [
        "KHR_materials_emissive_strength",
        "KHR_texture_transform",
        "KHR_materials_unlit",
    ] {
        if list(&source.json, "extensionsUsed")
            .iter()
            .any(|used| used == name)
        {
            merged.use_extension(name);
        }
    }
    *scene = Scene::from_document(&merged)?;
    *document = merged;
    Ok(())
}

/// Adds a `KHR_lights_punctual` light and the node that carries it; returns the node.
pub(super) fn push_light(document: &mut Document, light: Value, mut node: Value) -> usize {
    document.use_extension("KHR_lights_punctual");
    if !document.json["extensions"].is_object() {
        document.json["extensions"] = json!({});
    }
    let light = push(
        &mut document.json["extensions"]["KHR_lights_punctual"],
        "lights",
        light,
    );
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

/// Copies parts of one document into another, each once, and renumbers what they refer to.
struct Copier<'a> {
    from: &'a Document,
    to: &'a mut Document,
    copied: BTreeMap<(&'static str, usize), usize>,
}

impl Copier<'_> {
    fn mesh(&mut self, mesh: usize) -> Result<usize, SceneError> {
        self.element("meshes", mesh, |copier, mesh| {
            for primitive in mesh
                .get_mut("primitives")
                .and_then(Value::as_array_mut)
                .into_iter()
                .flatten()
            {
                for key in ["extensions", "targets"] {
                    remove(primitive, key);
                }
                copier.link(primitive, "indices", Self::accessor)?;
                copier.link(primitive, "material", Self::material)?;
                for (_, attribute) in primitive
                    .get_mut("attributes")
                    .and_then(Value::as_object_mut)
                    .into_iter()
                    .flatten()
                {
                    let index = attribute.as_u64().unwrap_or(u64::MAX) as usize;
                    *attribute = copier.accessor(index)?.into();
                }
            }
            remove(mesh, "weights");
            Ok(())
        })
    }

    fn accessor(&mut self, accessor: usize) -> Result<usize, SceneError> {
        self.element("accessors", accessor, |copier, accessor| {
            copier.link(accessor, "bufferView", Self::view)?;
            for part in ["indices", "values"] {
                if let Some(part) = accessor
                    .get_mut("sparse")
                    .and_then(|sparse| sparse.get_mut(part))
                {
                    copier.link(part, "bufferView", Self::view)?;
                }
            }
            Ok(())
        })
    }

    fn view(&mut self, view: usize) -> Result<usize, SceneError> {
        self.element("bufferViews", view, |copier, element| {
            let ImageData::View {
                buffer,
                start,
                length,
            } = copier.from.view(view, &"--lights")?
            else {
                return Ok(());
            };
            let bytes = copier.from.buffers[buffer][start..start + length].to_vec();
            push(
                &mut copier.to.json,
                "buffers",
                json!({ "byteLength": length }),
            );
            copier.to.buffers.push(Arc::new(bytes));
            remove(element, "byteOffset");
            element["buffer"] = (copier.to.buffers.len() - 1).into();
            Ok(())
        })
    }

    fn material(&mut self, material: usize) -> Result<usize, SceneError> {
        self.element("materials", material, |copier, material| {
            // Only what this renderer reads: other extensions may hold texture references of their own.
            if let Some(extensions) = material
                .get_mut("extensions")
                .and_then(Value::as_object_mut)
            {
                extensions.retain(|name, _| {
                    ["KHR_materials_emissive_strength", "KHR_materials_unlit"]
                        .contains(&name.as_str())
                });
            }
            for key in ["emissiveTexture", "normalTexture", "occlusionTexture"] {
                if let Some(info) = material.get_mut(key) {
                    copier.link(info, "index", Self::texture)?;
                }
            }
            for key in ["baseColorTexture", "metallicRoughnessTexture"] {
                if let Some(info) = material
                    .get_mut("pbrMetallicRoughness")
                    .and_then(|pbr| pbr.get_mut(key))
                {
                    copier.link(info, "index", Self::texture)?;
                }
            }
            Ok(())
        })
    }

    fn texture(&mut self, texture: usize) -> Result<usize, SceneError> {
        self.element("textures", texture, |copier, texture| {
            remove(texture, "extensions");
            copier.link(texture, "sampler", |copier, sampler| {
                copier.element("samplers", sampler, |_, _| Ok(()))
            })?;
            copier.link(texture, "source", Self::image)
        })
    }

    fn image(&mut self, image: usize) -> Result<usize, SceneError> {
        self.element("images", image, |copier, element| {
            let mut encoded = copier.from.images[image].clone();
            encoded.data = ImageData::Bytes(Arc::new(copier.from.image_bytes(image).to_vec()));
            for key in ["uri", "bufferView"] {
                remove(element, key);
            }
            copier.to.images.push(encoded);
            Ok(())
        })
    }

    /// Replaces the index under `key` by that of its copy.
    fn link(
        &mut self,
        element: &mut Value,
        key: &str,
        copy: impl FnOnce(&mut Self, usize) -> Result<usize, SceneError>,
    ) -> Result<(), SceneError> {
        if let Some(index) = element.get(key).and_then(Value::as_u64) {
            element[key] = copy(self, index as usize)?.into();
        }
        Ok(())
    }

    /// Copies one element of a top-level array; `fix` renumbers inside the copy.
    fn element(
        &mut self,
        kind: &'static str,
        index: usize,
        fix: impl FnOnce(&mut Self, &mut Value) -> Result<(), SceneError>,
    ) -> Result<usize, SceneError> {
        if let Some(copy) = self.copied.get(&(kind, index)) {
            return Ok(*copy);
        }
        let Some(mut element) = list(&self.from.json, kind).get(index).cloned() else {
            return Err(invalid(
                "the file of --lights",
                format_args!("there is no {index} in its {kind}"),
            ));
        };
        fix(self, &mut element)?;
        let copy = push(&mut self.to.json, kind, element);
        self.copied.insert((kind, index), copy);
        Ok(copy)
    }
}

fn remove(element: &mut Value, key: &str) {
    if let Some(element) = element.as_object_mut() {
        element.shift_remove(key);
    }
}

//! Copies parts of one document into another.

use std::{collections::BTreeMap, sync::Arc};

use serde_json::{Value, json};

use super::{
    document::{Document, ImageData},
    error::{SceneError, invalid},
    json::{list, punctual, push, remove},
};

/// Copies parts of one document into another, each once, and renumbers what they refer to.
///
/// What is there already is used again, whichever way it came: so adding a file a second time adds no mesh, image or
/// material to it.
pub(super) struct Copier<'a> {
    from: &'a Document,
    /// Where the copies go.
    pub to: &'a mut Document,
    /// How errors name `from`.
    name: String,
    copied: BTreeMap<(&'static str, usize), usize>,
}

/// Extensions that what is copied may use.
const EXTENSIONS: [&str; 4] = [
    "KHR_materials_emissive_strength",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

impl<'a> Copier<'a> {
    pub fn new(from: &'a Document, to: &'a mut Document, name: String) -> Self {
        Self {
            from,
            to,
            name,
            copied: BTreeMap::new(),
        }
    }

    /// Lists the extensions that copies may use and their source does.
    pub fn extensions(&mut self) {
        for name in EXTENSIONS {
            for list_name in ["extensionsUsed", "extensionsRequired"] {
                let lists = |json: &Value| list(json, list_name).iter().any(|used| used == name);
                if lists(&self.from.json) && !lists(&self.to.json) {
                    push(&mut self.to.json, list_name, name.into());
                }
            }
        }
    }

    /// A punctual light.
    pub fn light(&mut self, light: usize) -> Result<usize, SceneError> {
        let Some(element) = punctual(&self.from.json).get(light).cloned() else {
            return Err(self.missing(light, "lights"));
        };
        let known = punctual(&self.to.json).iter().position(|l| *l == element);
        Ok(known.unwrap_or_else(|| self.to.push_light(element)))
    }

    /// A mesh with all that it uses.
    pub fn mesh(&mut self, mesh: usize) -> Result<usize, SceneError> {
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
            } = copier.from.view(view, &copier.name)?
            else {
                return Ok(());
            };
            let bytes = &copier.from.buffers[buffer][start..start + length];
            let known = copier.to.buffers.iter().position(|b| ***b == *bytes);
            let buffer = known.unwrap_or_else(|| {
                copier.to.buffers.push(Arc::new(bytes.to_vec()));
                let buffer = json!({ "byteLength": length });
                push(&mut copier.to.json, "buffers", buffer)
            });
            remove(element, "byteOffset");
            element["buffer"] = buffer.into();
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
        let bytes = self.from.image_bytes(image);
        let known = (0..self.to.images.len()).find(|i| self.to.image_bytes(*i) == bytes);
        if let Some(known) = known.filter(|_| !bytes.is_empty()) {
            return Ok(known);
        }
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
            return Err(self.missing(index, kind));
        };
        let images = self.to.images.len();
        fix(self, &mut element)?;
        let known = list(&self.to.json, kind).iter().position(|e| *e == element);
        // An image is more than its element.
        let copy = match known.filter(|_| images == self.to.images.len()) {
            Some(known) => known,
            None => push(&mut self.to.json, kind, element),
        };
        self.copied.insert((kind, index), copy);
        Ok(copy)
    }

    fn missing(&self, index: usize, kind: &str) -> SceneError {
        invalid(
            &self.name,
            format_args!("there is no {index} in its {kind}"),
        )
    }
}

//! glTF materials and the images that they use, decoded on all cores.

use std::{collections::BTreeMap, io::Cursor, sync::Arc};

use glam::{Affine2, Mat2, Vec2, Vec3, Vec4};
use image::{ImageReader, Limits};
use rayon::prelude::*;
use serde_json::Value;

use super::{
    AlphaMode, Material, Texture, TextureRef, Wrap,
    assets::{Assets, Indexed, LoadedImage},
    document::{Document, image_place},
    error::{SceneError, invalid},
    json::{extension, index, integer, list, name, number, numbers},
};

/// Texels along an image's side.
const SIDE_LIMIT: u32 = 16_384;
/// Texels of all images together: 4 GiB decoded.
const TEXEL_LIMIT: u64 = 1 << 30;

/// glTF's materials after the default one, and the images that their base colours and emissions use, in the order of their
/// first use. Those that `assets` holds are not decoded again.
///
/// The albedo of a metal is its base colour too: transport is diffuse only, and a black metal would swallow its light.
///
/// # Errors
/// References to what is not there, numbers that are none, images that cannot be decoded or are too large.
pub(super) fn load_materials(
    document: &Document,
    assets: &Assets,
) -> Result<(Vec<Material>, Indexed<LoadedImage>), SceneError> {
    let (materials, used) = read_materials(document, assets.quiet)?;
    let mut total = 0;
    for &image in &used {
        let place = image_place(&document.json, image);
        let (width, height) = match assets.images.get(&image) {
            Some(known) => (known.texture.width, known.texture.height),
            None => dimensions(document.image_bytes(image), &place)?,
        };
        total += u64::from(width) * u64::from(height);
        if width > SIDE_LIMIT || height > SIDE_LIMIT || total > TEXEL_LIMIT {
            let why = format!(
                "{width} x {height} texels; at most {SIDE_LIMIT} a side and 2^30 in all images are held"
            );
            return Err(SceneError::TooLarge { place, why });
        }
    }
    let images: Vec<Result<_, SceneError>> = used
        .par_iter()
        .map(|&image| match assets.images.get(&image) {
            Some(known) => Ok((image, known.clone())),
            None => {
                let place = image_place(&document.json, image);
                let texture = decode(document.image_bytes(image), &place)?;
                Ok((image, LoadedImage::new(texture)))
            }
        })
        .collect();
    Ok((materials, images.into_iter().collect::<Result<_, _>>()?))
}

/// The images that [`load_materials`] gives, in its order.
///
/// # Errors
/// References to what is not there, numbers that are none.
pub(super) fn images_in_use(document: &Document) -> Result<Vec<usize>, SceneError> {
    read_materials(document, true).map(|(_, images)| images)
}

fn read_materials(
    document: &Document,
    quiet: bool,
) -> Result<(Vec<Material>, Vec<usize>), SceneError> {
    let mut used = Images {
        document,
        indices: BTreeMap::new(),
        order: Vec::new(),
        quiet,
    };
    let mut materials = vec![Material::default()];
    for (i, element) in list(&document.json, "materials").iter().enumerate() {
        materials.push(load_material(element, i, &mut used)?);
    }
    Ok((materials, used.order))
}

impl Default for Material {
    /// glTF's default material: white, opaque, single-sided, dark.
    fn default() -> Self {
        Self {
            name: "default".into(),
            source: None,
            base_color: Vec4::ONE,
            base_color_texture: None,
            emission: Vec3::ZERO,
            emission_texture: None,
            double_sided: false,
            alpha: AlphaMode::Opaque,
        }
    }
}

fn load_material(element: &Value, i: usize, images: &mut Images) -> Result<Material, SceneError> {
    let name = name(element, "material", i);
    let place = format!("material {i} ({name})");
    let none = Value::Null;
    let pbr = element.get("pbrMetallicRoughness").unwrap_or(&none);
    let base_color = numbers::<4>(pbr, "baseColorFactor", &place)?
        .map_or(Vec4::ONE, |c| Vec4::from(c).clamp(Vec4::ZERO, Vec4::ONE));
    let strength = match extension(element, "KHR_materials_emissive_strength") {
        Some(extension) => number(extension, "emissiveStrength", &place)?
            .unwrap_or(1.0)
            .max(0.0),
        None => 1.0,
    };
    let emission = numbers::<3>(element, "emissiveFactor", &place)?
        .map_or(Vec3::ZERO, |e| Vec3::from(e).max(Vec3::ZERO))
        * strength;
    if !emission.is_finite() {
        return Err(invalid(place, "its emission is not finite"));
    }
    if extension(element, "KHR_materials_transmission").is_some() && !images.quiet {
        tracing::warn!(
            "{place}: KHR_materials_transmission is not followed, light does not pass it"
        );
    }
    let alpha = match element.get("alphaMode").and_then(Value::as_str) {
        Some("MASK") => AlphaMode::Mask {
            cutoff: number(element, "alphaCutoff", &place)?.unwrap_or(0.5),
        },
        Some("BLEND") => AlphaMode::Mask { cutoff: 0.5 },
        _ => AlphaMode::Opaque,
    };
    Ok(Material {
        source: Some(i as u32),
        base_color,
        base_color_texture: images.texture(pbr.get("baseColorTexture"), &place)?,
        emission,
        // The texture of what does not shine need not be decoded.
        emission_texture: if emission == Vec3::ZERO {
            None
        } else {
            images.texture(element.get("emissiveTexture"), &place)?
        },
        double_sided: element
            .get("doubleSided")
            .and_then(Value::as_bool)
            .unwrap_or(false),
        alpha,
        name,
    })
}

/// Collects the images in use, each once, in the order of their first use.
struct Images<'a> {
    document: &'a Document,
    indices: BTreeMap<usize, u32>,
    order: Vec<usize>,
    quiet: bool,
}

impl Images<'_> {
    fn texture(
        &mut self,
        info: Option<&Value>,
        place: &String,
    ) -> Result<Option<TextureRef>, SceneError> {
        let json = &self.document.json;
        let Some(info) = info else { return Ok(None) };
        let textures = list(json, "textures");
        let i = index(info, "index", textures.len(), place)?
            .ok_or_else(|| invalid(place, "a texture of it has no index"))?;
        let texture = &textures[i];
        let Some(image) = index(
            texture,
            "source",
            self.document.images.len(),
            &format_args!("texture {i}"),
        )?
        else {
            if !self.quiet {
                tracing::warn!("{place}: texture {i} has no PNG or JPEG image, white is used");
            }
            return Ok(None);
        };
        let samplers = list(json, "samplers");
        let sampler = index(
            texture,
            "sampler",
            samplers.len(),
            &format_args!("texture {i}"),
        )?
        .map(|s| &samplers[s]);
        let wrap = |key| match sampler.and_then(|s| s.get(key)).and_then(Value::as_u64) {
            Some(33071) => Wrap::Clamp,
            Some(33648) => Wrap::Mirror,
            _ => Wrap::Repeat,
        };
        let mut texcoord = integer(info, "texCoord", place)?.unwrap_or(0);
        let mut transform = Affine2::IDENTITY;
        if let Some(extension) = extension(info, "KHR_texture_transform") {
            texcoord = integer(extension, "texCoord", place)?.unwrap_or(texcoord);
            let offset = numbers::<2>(extension, "offset", place)?.unwrap_or([0.0; 2]);
            let scale = numbers::<2>(extension, "scale", place)?.unwrap_or([1.0; 2]);
            let (sin, cos) = number(extension, "rotation", place)?
                .unwrap_or(0.0)
                .sin_cos();
            // Translation * rotation * scale; the extension turns counter-clockwise with v downwards.
            let matrix = Mat2::from_cols(
                Vec2::new(cos, -sin) * scale[0],
                Vec2::new(sin, cos) * scale[1],
            );
            transform = Affine2::from_mat2_translation(matrix, offset.into());
        }
        if texcoord > 1 {
            return Err(invalid(
                place,
                format_args!(
                    "a texture of it uses TEXCOORD_{texcoord}, but only sets 0 and 1 are read"
                ),
            ));
        }
        let next = self.order.len() as u32;
        let texture = *self.indices.entry(image).or_insert(next);
        if texture == next {
            self.order.push(image);
        }
        Ok(Some(TextureRef {
            texture,
            texcoord: texcoord as u32,
            transform,
            wrap: [wrap("wrapS"), wrap("wrapT")],
        }))
    }
}

fn reader<'a>(bytes: &'a [u8], place: &str) -> Result<ImageReader<Cursor<&'a [u8]>>, SceneError> {
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|error| SceneError::Image {
            place: place.into(),
            why: error.to_string(),
        })?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(SIDE_LIMIT);
    limits.max_image_height = Some(SIDE_LIMIT);
    limits.max_alloc = Some(8 * TEXEL_LIMIT);
    reader.limits(limits);
    Ok(reader)
}

fn dimensions(bytes: &[u8], place: &str) -> Result<(u32, u32), SceneError> {
    reader(bytes, place)?
        .into_dimensions()
        .map_err(|error| image_error(place, &error))
}

fn decode(bytes: &[u8], place: &str) -> Result<Arc<Texture>, SceneError> {
    let image = reader(bytes, place)?
        .decode()
        .map_err(|error| image_error(place, &error))?
        .into_rgba8();
    let texels = image.pixels().map(|pixel| pixel.0).collect();
    Ok(Arc::new(Texture {
        width: image.width(),
        height: image.height(),
        texels,
    }))
}

fn image_error(place: &str, error: &image::ImageError) -> SceneError {
    SceneError::Image {
        place: place.into(),
        why: super::error::one_line(&error.to_string()),
    }
}

//! The glTF file as it was loaded: its JSON, its buffers and its images still encoded, so that all of it can be written back.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use serde_json::Value;

use super::{
    Scene,
    error::{SceneError, invalid, one_line},
    json::{integer, list, push},
    uri::{Source, read_file, resolve},
};

/// A glTF 2.0 file in memory. Buffers and images are complete; data URIs are taken out of the JSON.
#[derive(Clone, Debug, Default)]
pub struct Document {
    /// The whole JSON, unknown content included.
    pub json: Value,
    /// One per `json.buffers`, exactly `byteLength` bytes long.
    pub buffers: Vec<Arc<Vec<u8>>>,
    /// One per `json.images`.
    pub images: Vec<EncodedImage>,
}

/// An image as the file holds it.
#[derive(Clone, Debug)]
pub struct EncodedImage {
    /// Media type: the file's, or else guessed from the first bytes.
    pub mime: String,
    /// Where its bytes are.
    pub data: ImageData,
}

/// Where an image's bytes are.
#[derive(Clone, Debug)]
pub enum ImageData {
    /// In `buffers[buffer][start..start + length]`.
    View {
        /// Index into [`Document::buffers`].
        buffer: usize,
        /// First byte.
        start: usize,
        /// Number of bytes.
        length: usize,
    },
    /// From a file or a data URI. Empty for an EXR (a lightmap of an earlier bake) whose file is gone.
    Bytes(Arc<Vec<u8>>),
}

impl Document {
    /// Reads a .gltf or .glb file and all it refers to. The kind is told by the content, not by the name.
    ///
    /// # Errors
    /// Unreadable, truncated or malformed files; references that are missing or leave the file's folder.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let bytes = read_file(path).map_err(|cause| SceneError::Read {
            path: path.into(),
            cause,
        })?;
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        Self::parse(&bytes, Some(folder))
    }

    /// Reads .gltf or .glb content; `folder` is where relative references are looked up, if any are allowed.
    ///
    /// # Errors
    /// As for [`Self::load`].
    pub fn parse(bytes: &[u8], folder: Option<&Path>) -> Result<Self, SceneError> {
        let not_gltf = |why: &str| SceneError::NotGltf { why: why.into() };
        let (text, mut bin) = match bytes.strip_prefix(b"glTF") {
            Some(_) => glb_chunks(bytes)?,
            None => (bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), None),
        };
        let json: Value = serde_json::from_slice(text).map_err(|e| SceneError::NotGltf {
            why: one_line(&format!("its JSON is broken: {e}")),
        })?;
        if !json.is_object() {
            return Err(not_gltf("its JSON is not an object"));
        }
        let version = json
            .get("asset")
            .and_then(|asset| asset.get("version"))
            .and_then(Value::as_str);
        if !version.is_some_and(|version| version.starts_with("2.")) {
            return Err(not_gltf("its asset.version is not 2.x"));
        }
        let mut document = Document {
            json,
            buffers: Vec::new(),
            images: Vec::new(),
        };
        let mut files = Files {
            folder,
            read: BTreeMap::new(),
        };
        for (i, buffer) in list(&document.json, "buffers").iter().enumerate() {
            let place = format!("buffer {i}");
            let bytes = match buffer.get("uri").and_then(Value::as_str) {
                Some(uri) => files.bytes(uri, &place)?.1,
                None => match bin.take().filter(|_| i == 0) {
                    Some(bin) => Arc::new(bin.to_vec()),
                    None => return Err(invalid(place, "it has neither a URI nor a binary chunk")),
                },
            };
            let length = integer(buffer, "byteLength", &place)?.unwrap_or(bytes.len());
            if length > bytes.len() {
                return Err(invalid(
                    place,
                    format_args!(
                        "byteLength is {length}, but only {} bytes are there",
                        bytes.len()
                    ),
                ));
            }
            document.buffers.push(if length == bytes.len() {
                bytes
            } else {
                Arc::new(bytes[..length].to_vec())
            });
        }
        for (i, image) in list(&document.json, "images").iter().enumerate() {
            let place = image_place(&document.json, i);
            let (mime, data) = match image.get("uri").and_then(Value::as_str) {
                Some(uri) => match files.bytes(uri, &place) {
                    Ok((mime, bytes)) => (mime, ImageData::Bytes(bytes)),
                    Err(SceneError::Missing { .. })
                        if uri.to_ascii_lowercase().ends_with(".exr") =>
                    {
                        tracing::warn!(
                            "{place}: {} is gone; if it is an earlier lightmap, that does not matter",
                            one_line(uri)
                        );
                        ("image/x-exr".into(), ImageData::Bytes(Arc::default()))
                    }
                    Err(error) => return Err(error),
                },
                None => match integer(image, "bufferView", &place)? {
                    Some(view) => (String::new(), document.view(view, &place)?),
                    None => return Err(invalid(place, "it has neither a URI nor a bufferView")),
                },
            };
            document.images.push(EncodedImage { mime, data });
            let given = image
                .get("mimeType")
                .and_then(Value::as_str)
                .map(str::to_owned);
            if let Some(mime) =
                given.or_else(|| guess_mime(document.image_bytes(i)).map(str::to_owned))
            {
                document.images[i].mime = mime;
            }
        }
        for kind in ["buffers", "images"] {
            for element in document
                .json
                .get_mut(kind)
                .and_then(Value::as_array_mut)
                .into_iter()
                .flatten()
            {
                let embedded = element
                    .get("uri")
                    .and_then(Value::as_str)
                    .is_some_and(|uri| uri.starts_with("data:"));
                if let Some(element) = element.as_object_mut().filter(|_| embedded) {
                    element.shift_remove("uri");
                }
            }
        }
        Ok(document)
    }

    /// The encoded bytes of an image; empty if there is no such image.
    pub fn image_bytes(&self, image: usize) -> &[u8] {
        match self.images.get(image).map(|image| &image.data) {
            Some(ImageData::Bytes(bytes)) => bytes,
            Some(ImageData::View {
                buffer,
                start,
                length,
            }) => self
                .buffers
                .get(*buffer)
                .and_then(|bytes| bytes.get(*start..start.checked_add(*length)?))
                .unwrap_or(&[]),
            None => &[],
        }
    }

    /// The bytes of a buffer view, checked against its buffer.
    pub(super) fn view(
        &self,
        view: usize,
        place: &dyn std::fmt::Display,
    ) -> Result<ImageData, SceneError> {
        let views = list(&self.json, "bufferViews");
        let element = views
            .get(view)
            .ok_or_else(|| invalid(place, format_args!("there is no bufferView {view}")))?;
        let here = format!("bufferView {view}");
        let buffer = integer(element, "buffer", &here)?
            .ok_or_else(|| invalid(&here, "it names no buffer"))?;
        let start = integer(element, "byteOffset", &here)?.unwrap_or(0);
        let length = integer(element, "byteLength", &here)?
            .ok_or_else(|| invalid(&here, "it has no byteLength"))?;
        let size = self
            .buffers
            .get(buffer)
            .ok_or_else(|| invalid(&here, format_args!("there is no buffer {buffer}")))?
            .len();
        match start.checked_add(length) {
            Some(end) if end <= size => Ok(ImageData::View {
                buffer,
                start,
                length,
            }),
            _ => Err(invalid(
                here,
                format_args!(
                    "{length} bytes from {start} on reach beyond buffer {buffer} ({size} bytes)"
                ),
            )),
        }
    }

    /// Adds a name to `extensionsUsed`, if it is not there yet.
    pub(super) fn use_extension(&mut self, name: &str) {
        if !list(&self.json, "extensionsUsed")
            .iter()
            .any(|used| used == name)
        {
            push(&mut self.json, "extensionsUsed", name.into());
        }
    }

    /// Adds a definition to those of `KHR_lights_punctual`; returns its index.
    pub(super) fn push_light(&mut self, light: Value) -> usize {
        self.use_extension("KHR_lights_punctual");
        if !self.json["extensions"].is_object() {
            self.json["extensions"] = Value::Object(Default::default());
        }
        push(
            &mut self.json["extensions"]["KHR_lights_punctual"],
            "lights",
            light,
        )
    }

    /// Adds a node without a parent to the scene that is shown; returns its index.
    pub(super) fn push_root(&mut self, node: Value) -> usize {
        // Without any scene all nodes that are no children are shown: then there is no list to add it to.
        let node = push(&mut self.json, "nodes", node);
        let shown = self.json.get("scene").and_then(Value::as_u64).unwrap_or(0) as usize;
        if let Some(scene) = self
            .json
            .get_mut("scenes")
            .and_then(|scenes| scenes.get_mut(shown))
        {
            push(scene, "nodes", node.into());
        }
        node
    }
}

impl Scene {
    /// Reads a .gltf or .glb file. It may lack light: see [`Scene::validate`].
    ///
    /// # Errors
    /// As for [`Document::load`] and [`Scene::from_document`].
    pub fn load(path: &Path) -> Result<(Scene, Document), SceneError> {
        let document = Document::load(path)?;
        Ok((Scene::from_document(&document)?, document))
    }
}

/// An image as errors name it: by its index, and its file or name.
pub(super) fn image_place(json: &Value, image: usize) -> String {
    let element = list(json, "images").get(image);
    let text = |key| element.and_then(|e| e.get(key)).and_then(Value::as_str);
    match text("uri")
        .filter(|uri| !uri.starts_with("data:"))
        .or(text("name"))
    {
        Some(name) => format!("image {image} ({})", one_line(name)),
        None => format!("image {image}"),
    }
}

/// External files, each read once however often it is named.
struct Files<'a> {
    folder: Option<&'a Path>,
    read: BTreeMap<PathBuf, Arc<Vec<u8>>>,
}

impl Files<'_> {
    fn bytes(&mut self, uri: &str, place: &str) -> Result<(String, Arc<Vec<u8>>), SceneError> {
        match resolve(uri, self.folder, place)? {
            Source::Data(mime, bytes) => Ok((mime, Arc::new(bytes))),
            Source::File(path) => {
                if let Some(bytes) = self.read.get(&path) {
                    return Ok((String::new(), bytes.clone()));
                }
                let bytes = read_file(&path).map_err(|e| SceneError::Missing {
                    place: place.into(),
                    uri: one_line(uri),
                    why: e.to_string(),
                })?;
                let bytes = Arc::new(bytes);
                self.read.insert(path, bytes.clone());
                Ok((String::new(), bytes))
            }
        }
    }
}

/// Splits a GLB container into its JSON and its binary chunk (glTF 2.0, section 4.4).
fn glb_chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), SceneError> {
    let broken = |why: &str| SceneError::NotGltf { why: why.into() };
    let word = |at: usize| {
        bytes
            .get(at..at + 4)
            .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    };
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(broken("its GLB header is cut off"));
    };
    if version != 2 {
        return Err(broken("its GLB container is not version 2"));
    }
    let length = length as usize;
    if length > bytes.len() {
        return Err(broken(&format!(
            "it is cut off after {} of {length} bytes",
            bytes.len()
        )));
    }
    let (mut text, mut bin, mut at) = (None, None, 12);
    while at + 8 <= length {
        let (Some(size), Some(kind)) = (word(at), bytes.get(at + 4..at + 8)) else {
            break;
        };
        let Some(chunk) = (at + 8)
            .checked_add(size as usize)
            .filter(|end| *end <= length)
            .and_then(|end| bytes.get(at + 8..end))
        else {
            return Err(broken(
                "a chunk of its GLB container reaches beyond the end",
            ));
        };
        match kind {
            b"JSON" if text.is_none() => text = Some(chunk),
            b"BIN\0" if bin.is_none() => bin = Some(chunk),
            _ => {}
        }
        at = at + 8 + chunk.len();
    }
    Ok((
        text.ok_or_else(|| broken("its GLB container has no JSON chunk"))?,
        bin,
    ))
}

fn guess_mime(bytes: &[u8]) -> Option<&'static str> {
    let kinds: [(&[u8], &str); 4] = [
        (b"\x89PNG", "image/png"),
        (b"\xff\xd8\xff", "image/jpeg"),
        (b"\x76\x2f\x31\x01", "image/x-exr"),
        (b"\xabKTX", "image/ktx2"),
    ];
    kinds
        .iter()
        .find(|(magic, _)| bytes.starts_with(magic))
        .map(|(_, mime)| *mime)
}

//! Writes a document back: as one GLB, or as glTF text with everything embedded, whole or not at all.

use std::{fs, path::Path};

use serde_json::{Value, json};

use super::{
    document::{Document, ImageData},
    error::SceneError,
    json::push,
    uri::base64_encode,
};

impl Document {
    /// The file as a single GLB: all buffers in one, all images embedded, everything else as it was.
    ///
    /// # Errors
    /// [`SceneError::TooLarge`] beyond the 4 GiB that the container can hold.
    pub fn to_glb(&self) -> Result<Vec<u8>, SceneError> {
        let (json, bin) = self.packed();
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let length = 12 + 8 + text.len() + if bin.is_empty() { 0 } else { 8 + bin.len() };
        let Ok(total) = u32::try_from(length) else {
            return Err(SceneError::TooLarge {
                place: "the GLB file".into(),
                why: format!("{length} bytes, but at most 4 GiB fit"),
            });
        };
        let mut glb = Vec::with_capacity(length);
        glb.extend_from_slice(b"glTF");
        glb.extend_from_slice(&2u32.to_le_bytes());
        glb.extend_from_slice(&total.to_le_bytes());
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &bin)] {
            if !chunk.is_empty() {
                glb.extend_from_slice(&(chunk.len() as u32).to_le_bytes());
                glb.extend_from_slice(kind);
                glb.extend_from_slice(chunk);
            }
        }
        Ok(glb)
    }

    /// The file as .gltf text with everything embedded.
    pub fn to_gltf(&self) -> String {
        let (mut json, bin) = self.packed();
        if !bin.is_empty() {
            json["buffers"][0]["uri"] = format!(
                "data:application/octet-stream;base64,{}",
                base64_encode(&bin)
            )
            .into();
        }
        let mut text = serde_json::to_string_pretty(&json).unwrap_or_else(|_| json.to_string());
        text.push('\n');
        text
    }

    /// Writes a single self-contained file: .gltf by that extension, GLB otherwise. Whole or not at all.
    ///
    /// # Errors
    /// As for [`Self::to_glb`] and [`write_whole`].
    pub fn write(&self, path: &Path) -> Result<(), SceneError> {
        let text = path
            .extension()
            .is_some_and(|extension| extension.eq_ignore_ascii_case("gltf"));
        write_whole(
            path,
            &if text {
                self.to_gltf().into_bytes()
            } else {
                self.to_glb()?
            },
        )
    }

    /// Everything in one buffer, its length a multiple of 4.
    fn packed(&self) -> (Value, Vec<u8>) {
        let mut json = self.json.clone();
        let mut bin = Vec::new();
        let mut append = |bytes: &[u8]| {
            // 8 keeps every alignment that an accessor inside may rely on.
            bin.resize(bin.len().next_multiple_of(8), 0);
            let start = bin.len();
            bin.extend_from_slice(bytes);
            start
        };
        let starts: Vec<usize> = self.buffers.iter().map(|buffer| append(buffer)).collect();
        for view in json
            .get_mut("bufferViews")
            .and_then(Value::as_array_mut)
            .into_iter()
            .flatten()
        {
            let buffer = view.get("buffer").and_then(Value::as_u64).unwrap_or(0) as usize;
            let offset = view.get("byteOffset").and_then(Value::as_u64).unwrap_or(0) as usize;
            if let (Some(start), Some(view)) = (starts.get(buffer), view.as_object_mut()) {
                view.insert("buffer".into(), 0.into());
                if view.contains_key("byteOffset") || start + offset > 0 {
                    view.insert("byteOffset".into(), (start + offset).into());
                }
            }
        }
        for (i, image) in self.images.iter().enumerate() {
            if let ImageData::Bytes(bytes) = &image.data
                && !bytes.is_empty()
            {
                let start = append(bytes);
                let view = push(
                    &mut json,
                    "bufferViews",
                    json!({ "buffer": 0, "byteOffset": start, "byteLength": bytes.len() }),
                );
                if let Some(element) = json["images"].get_mut(i).and_then(Value::as_object_mut) {
                    element.shift_remove("uri");
                    element.insert("mimeType".into(), image.mime.clone().into());
                    element.insert("bufferView".into(), view.into());
                }
            }
        }
        bin.resize(bin.len().next_multiple_of(4), 0);
        if let Some(json) = json.as_object_mut() {
            if bin.is_empty() {
                json.shift_remove("buffers");
            } else {
                json.insert("buffers".into(), json!([{ "byteLength": bin.len() }]));
            }
        }
        (json, bin)
    }
}

/// Writes a file beside its place and moves it there, so that nobody ever sees a part of it.
///
/// # Errors
/// [`SceneError::Write`]; what was there before is then still there.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), SceneError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let beside = path.with_file_name(format!(".{name}.{}.part", std::process::id()));
    fs::write(&beside, bytes)
        .and_then(|()| fs::rename(&beside, path))
        .map_err(|cause| {
            // The first error is the one to tell; a leftover that cannot be removed either changes nothing about it.
            let _ = fs::remove_file(&beside);
            SceneError::Write {
                path: path.into(),
                cause,
            }
        })
}

//! Accessors of a glTF document as raw bytes: copied by element, written anew, and the space of the old ones given back.

use std::collections::BTreeSet;
use std::sync::Arc;

use serde_json::{Value, json};

use crate::scene::{Document, ImageData};

/// `value[key]` as an index or a count.
pub(super) fn number(value: &Value, key: &str) -> Option<usize> {
    value.get(key)?.as_u64()?.try_into().ok()
}

/// The elements of `value[key]`.
pub(super) fn list<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value
        .get(key)
        .and_then(Value::as_array)
        .map_or(&[], Vec::as_slice)
}

/// Appends to the array `value[key]`, made if it is absent; returns the index.
pub(super) fn push(value: &mut Value, key: &str, element: Value) -> usize {
    match value[key].as_array_mut() {
        Some(array) => array.push(element),
        None => value[key] = json!([element]),
    }
    list(value, key).len() - 1
}

/// A vertex attribute, copied out of a document.
#[derive(Clone, Debug)]
pub(super) struct Attribute {
    /// `componentType`, `type` and `normalized`, as the file has them.
    component: u64,
    kind: String,
    normalized: bool,
    /// Bytes of one element.
    width: usize,
    /// All elements, without gaps.
    bytes: Vec<u8>,
}

impl Attribute {
    /// Two floats an element.
    pub fn texcoords(values: &[[f32; 2]]) -> Self {
        Self {
            component: 5126,
            kind: "VEC2".into(),
            normalized: false,
            width: 8,
            bytes: bytemuck::cast_slice(values).to_vec(),
        }
    }

    /// Reads an accessor; none if anything about it is not as it must be.
    pub fn read(document: &Document, accessor: usize) -> Option<Self> {
        let element = list(&document.json, "accessors").get(accessor)?;
        let component = element.get("componentType")?.as_u64()?;
        let size = match component {
            5120 | 5121 => 1,
            5122 | 5123 => 2,
            5125 | 5126 => 4,
            _ => return None,
        };
        let kind = element.get("type")?.as_str()?.to_owned();
        let width = size
            * match kind.as_str() {
                "SCALAR" => 1,
                "VEC2" => 2,
                "VEC3" => 3,
                "VEC4" => 4,
                _ => return None,
            };
        let count = number(element, "count")?;
        let mut bytes = match number(element, "bufferView") {
            Some(view) => {
                let offset = number(element, "byteOffset").unwrap_or(0);
                strided(document, view, offset, width, count)?
            }
            // Zeros, which cost a hostile file nothing: the loader has bounded the count of what it read.
            None if count <= 16_000_000 => vec![0; count * width],
            None => return None,
        };
        if let Some(sparse) = element.get("sparse") {
            overlay(document, sparse, width, count, &mut bytes)?;
        }
        let normalized = element
            .get("normalized")
            .and_then(Value::as_bool)
            .unwrap_or(false);
        Some(Self {
            component,
            kind,
            normalized,
            width,
            bytes,
        })
    }

    /// The elements with the given indices; none if one is beyond the end.
    pub fn gather(&self, indices: &[u32]) -> Option<Self> {
        let mut bytes = Vec::with_capacity(indices.len() * self.width);
        for &i in indices {
            let start = i as usize * self.width;
            bytes.extend_from_slice(self.bytes.get(start..start + self.width)?);
        }
        Some(Self {
            bytes,
            kind: self.kind.clone(),
            ..*self
        })
    }

    /// Smallest and largest of each component, where they are floats: glTF wants them for positions.
    fn range(&self) -> Option<[Vec<f32>; 2]> {
        let n = self.width / 4;
        if self.component != 5126 || self.bytes.is_empty() {
            return None;
        }
        let (mut min, mut max) = (vec![f32::INFINITY; n], vec![f32::NEG_INFINITY; n]);
        for (i, b) in self.bytes.chunks_exact(4).enumerate() {
            let value = f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
            min[i % n] = min[i % n].min(value);
            max[i % n] = max[i % n].max(value);
        }
        Some([min, max])
    }
}

/// The bytes of a buffer view.
fn view_bytes(document: &Document, view: usize) -> Option<&[u8]> {
    let view = list(&document.json, "bufferViews").get(view)?;
    let start = number(view, "byteOffset").unwrap_or(0);
    let end = start.checked_add(number(view, "byteLength")?)?;
    document
        .buffers
        .get(number(view, "buffer")?)?
        .get(start..end)
}

/// `count` elements of `width` bytes, without the gaps between them.
fn strided(
    document: &Document,
    view: usize,
    offset: usize,
    width: usize,
    count: usize,
) -> Option<Vec<u8>> {
    let bytes = view_bytes(document, view)?;
    let stride = number(&list(&document.json, "bufferViews")[view], "byteStride").unwrap_or(width);
    let end = |i: usize| {
        i.checked_mul(stride)?
            .checked_add(offset)?
            .checked_add(width)
    };
    if count > 0 && end(count - 1)? > bytes.len() {
        return None;
    }
    Some(
        (0..count)
            .flat_map(|i| bytes[offset + i * stride..][..width].iter().copied())
            .collect(),
    )
}

/// Writes a sparse accessor's elements over the dense ones.
fn overlay(
    document: &Document,
    sparse: &Value,
    width: usize,
    count: usize,
    bytes: &mut [u8],
) -> Option<()> {
    let n = number(sparse, "count")?;
    let (at, values) = (sparse.get("indices")?, sparse.get("values")?);
    let size = match at.get("componentType")?.as_u64()? {
        5121 => 1,
        5123 => 2,
        5125 => 4,
        _ => return None,
    };
    let part = |of: &Value, width| {
        strided(
            document,
            number(of, "bufferView")?,
            number(of, "byteOffset").unwrap_or(0),
            width,
            n,
        )
    };
    let (at, values) = (part(at, size)?, part(values, width)?);
    for (at, value) in at.chunks_exact(size).zip(values.chunks_exact(width)) {
        let i = at
            .iter()
            .rev()
            .fold(0usize, |i, b| i << 8 | usize::from(*b));
        if i >= count {
            return None;
        }
        bytes[i * width..][..width].copy_from_slice(value);
    }
    Some(())
}

/// Adds accessors to a document. Slots of accessors and buffer views that nothing uses any more are filled first, so that all
/// others keep their indices.
pub(super) struct Writer<'a> {
    document: &'a mut Document,
    free_accessors: Vec<usize>,
    free_views: Vec<usize>,
    buffer: usize,
    bytes: Vec<u8>,
}

impl<'a> Writer<'a> {
    /// `dead` are accessors that nothing will refer to.
    pub fn new(document: &'a mut Document, dead: &BTreeSet<usize>) -> Self {
        let mut used = BTreeSet::new();
        for (i, accessor) in list(&document.json, "accessors").iter().enumerate() {
            if !dead.contains(&i) {
                used.extend(views_of(accessor));
            }
        }
        used.extend(
            list(&document.json, "images")
                .iter()
                .filter_map(|i| number(i, "bufferView")),
        );
        let freed: BTreeSet<usize> = dead
            .iter()
            .filter_map(|i| list(&document.json, "accessors").get(*i))
            .flat_map(views_of)
            .filter(|view| !used.contains(view))
            .collect();
        let buffer = document.buffers.len();
        Self {
            document,
            free_accessors: dead.iter().rev().copied().collect(),
            free_views: freed.into_iter().rev().collect(),
            buffer,
            bytes: Vec::new(),
        }
    }

    /// Adds a vertex attribute; returns its accessor. `positions` get their range.
    pub fn attribute(&mut self, attribute: &Attribute, positions: bool) -> usize {
        // Every element of a vertex attribute starts at a multiple of 4 (glTF 2.0, section 3.6.2.4).
        let stride = attribute.width.next_multiple_of(4);
        let (start, padding) = (self.bytes.len(), stride - attribute.width);
        for element in attribute.bytes.chunks_exact(attribute.width) {
            self.bytes.extend_from_slice(element);
            self.bytes.extend_from_slice(&[0; 3][..padding]);
        }
        let mut view = self.view(start, 34962);
        if padding > 0 {
            view["byteStride"] = stride.into();
        }
        let view = self.put("bufferViews", view);
        let mut accessor = json!({
            "bufferView": view,
            "componentType": attribute.component,
            "count": attribute.bytes.len() / attribute.width,
            "type": attribute.kind,
        });
        if attribute.normalized {
            accessor["normalized"] = true.into();
        }
        if let Some([min, max]) = attribute.range().filter(|_| positions) {
            accessor["min"] = min.into();
            accessor["max"] = max.into();
        }
        self.put("accessors", accessor)
    }

    /// Adds indices; returns their accessor.
    pub fn indices(&mut self, indices: &[u32], vertices: usize) -> usize {
        let start = self.bytes.len();
        // The largest value of each type is reserved for restarting strips.
        let component = if vertices <= usize::from(u16::MAX) {
            self.bytes
                .extend(indices.iter().flat_map(|i| (*i as u16).to_le_bytes()));
            5123
        } else {
            self.bytes
                .extend(indices.iter().flat_map(|i| i.to_le_bytes()));
            5125
        };
        let view = self.view(start, 34963);
        let view = self.put("bufferViews", view);
        let accessor = json!({ "bufferView": view, "componentType": component, "count": indices.len(), "type": "SCALAR" });
        self.put("accessors", accessor)
    }

    /// Puts what was added into a buffer of its own and lets go of the bytes that nothing refers to any more.
    pub fn finish(mut self) {
        // A slot that was freed and not filled again must not keep its old content alive.
        for view in std::mem::take(&mut self.free_views) {
            self.bytes.resize(self.bytes.len().max(4), 0);
            let buffer = self.buffer;
            self.document.json["bufferViews"][view] = json!({ "buffer": buffer, "byteLength": 4 });
        }
        for accessor in std::mem::take(&mut self.free_accessors) {
            self.document.json["accessors"][accessor] =
                json!({ "componentType": 5121, "count": 1, "type": "SCALAR" });
        }
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let length = self.bytes.len();
        push(
            &mut self.document.json,
            "buffers",
            json!({ "byteLength": length }),
        );
        self.document.buffers.push(Arc::new(self.bytes));
        compact(self.document);
    }

    fn view(&mut self, start: usize, target: u32) -> Value {
        let length = self.bytes.len() - start;
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        json!({ "buffer": self.buffer, "byteOffset": start, "byteLength": length, "target": target })
    }

    fn put(&mut self, key: &str, element: Value) -> usize {
        let free = if key == "accessors" {
            &mut self.free_accessors
        } else {
            &mut self.free_views
        };
        match free.pop() {
            Some(slot) => {
                self.document.json[key][slot] = element;
                slot
            }
            None => push(&mut self.document.json, key, element),
        }
    }
}

/// The buffer views that an accessor reads.
fn views_of(accessor: &Value) -> Vec<usize> {
    let sparse = accessor.get("sparse");
    let parts = [
        Some(accessor),
        sparse.and_then(|s| s.get("indices")),
        sparse.and_then(|s| s.get("values")),
    ];
    parts
        .into_iter()
        .flatten()
        .filter_map(|p| number(p, "bufferView"))
        .collect()
}

/// Copies what buffer views hold into one buffer, and nothing else. Left alone if extensions may refer to buffers.
fn compact(document: &mut Document) {
    let views = list(&document.json, "bufferViews");
    if views.iter().any(|v| v.get("extensions").is_some()) {
        return;
    }
    let mut bytes: Vec<u8> = Vec::new();
    let mut starts = Vec::with_capacity(views.len());
    for i in 0..views.len() {
        // Unreadable views are what an earlier reader did not need either; they stay as they are, without bytes.
        let part = view_bytes(document, i).unwrap_or(&[]);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        starts.push((bytes.len(), part.len()));
        bytes.extend_from_slice(part);
    }
    let images: Vec<Option<usize>> = list(&document.json, "images")
        .iter()
        .map(|i| number(i, "bufferView"))
        .collect();
    for (view, (start, length)) in starts.iter().enumerate() {
        let element = &mut document.json["bufferViews"][view];
        element["buffer"] = 0.into();
        element["byteOffset"] = (*start).into();
        element["byteLength"] = (*length).into();
    }
    for (image, view) in document.images.iter_mut().zip(images) {
        if let (ImageData::View { .. }, Some(&(start, length))) =
            (&image.data, view.and_then(|v| starts.get(v)))
        {
            image.data = ImageData::View {
                buffer: 0,
                start,
                length,
            };
        }
    }
    document.json["buffers"] = json!([{ "byteLength": bytes.len() }]);
    document.buffers = vec![Arc::new(bytes)];
}

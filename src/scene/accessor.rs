//! Reads accessors without trusting them: every byte is checked against its buffer before anything is allocated.

use serde_json::Value;

use super::{
    document::{Document, ImageData},
    error::{SceneError, invalid},
    json::{integer, list},
};

/// No accessor may have more elements; a u32 index over all of a scene's vertices could not hold more than a few such.
pub(super) const COUNT_LIMIT: usize = 100_000_000;
/// Elements of an accessor that has no buffer behind it, so that its size costs a hostile file nothing.
const UNBACKED_LIMIT: usize = 16_000_000;

/// An accessor whose elements all lie inside their buffers.
pub(super) struct Accessor<'a> {
    /// Number of elements.
    pub count: usize,
    /// Which one, for error messages.
    place: String,
    component: Component,
    width: usize,
    normalized: bool,
    /// Strided elements; none if all are zero but for the sparse ones.
    dense: Option<Strided<'a>>,
    sparse: Option<Sparse<'a>>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

struct Strided<'a> {
    bytes: &'a [u8],
    stride: usize,
}

struct Sparse<'a> {
    count: usize,
    indices: Strided<'a>,
    component: Component,
    values: Strided<'a>,
}

impl Component {
    fn parse(value: &Value, place: &str) -> Result<Self, SceneError> {
        Ok(match value.get("componentType").and_then(Value::as_u64) {
            Some(5120) => Self::I8,
            Some(5121) => Self::U8,
            Some(5122) => Self::I16,
            Some(5123) => Self::U16,
            Some(5125) => Self::U32,
            Some(5126) => Self::F32,
            _ => return Err(invalid(place, "its componentType is none of glTF's six")),
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The number at the start of `bytes`, which hold it.
    fn float(self, bytes: &[u8], normalized: bool) -> f32 {
        let (value, scale) = match self {
            Self::I8 => (f32::from(bytes[0] as i8), 127.0),
            Self::U8 => (f32::from(bytes[0]), 255.0),
            Self::I16 => (f32::from(i16::from_le_bytes([bytes[0], bytes[1]])), 32767.0),
            Self::U16 => (f32::from(u16::from_le_bytes([bytes[0], bytes[1]])), 65535.0),
            Self::U32 => (self.unsigned(bytes) as f32, 1.0),
            Self::F32 => return f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
        };
        if normalized {
            (value / scale).max(-1.0)
        } else {
            value
        }
    }

    fn unsigned(self, bytes: &[u8]) -> u32 {
        match self {
            Self::U8 => bytes[0].into(),
            Self::U16 => u16::from_le_bytes([bytes[0], bytes[1]]).into(),
            _ => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
        }
    }
}

impl<'a> Accessor<'a> {
    /// Checks accessor `index` as an element of `place` (a mesh's primitive) in the role `role` (`POSITION`, `indices`).
    pub fn new(
        document: &'a Document,
        index: usize,
        place: &dyn std::fmt::Display,
        role: &str,
    ) -> Result<Self, SceneError> {
        let place = format!("{place}, {role} (accessor {index})");
        let accessors = list(&document.json, "accessors");
        let element = accessors.get(index).ok_or_else(|| {
            invalid(
                &place,
                format_args!("there are only {} accessors", accessors.len()),
            )
        })?;
        let count =
            integer(element, "count", &place)?.ok_or_else(|| invalid(&place, "it has no count"))?;
        let component = Component::parse(element, &place)?;
        let width = match element.get("type").and_then(Value::as_str) {
            Some("SCALAR") => 1,
            Some("VEC2") => 2,
            Some("VEC3") => 3,
            Some("VEC4") => 4,
            _ => {
                return Err(invalid(
                    &place,
                    "its type is none of SCALAR, VEC2, VEC3, VEC4",
                ));
            }
        };
        let dense = match integer(element, "bufferView", &place)? {
            Some(view) => {
                let offset = integer(element, "byteOffset", &place)?.unwrap_or(0);
                Some(strided(
                    document,
                    view,
                    offset,
                    count,
                    component.size() * width,
                    &place,
                )?)
            }
            None if count > UNBACKED_LIMIT => {
                return Err(invalid(
                    &place,
                    format_args!(
                        "{count} elements without a bufferView; at most {UNBACKED_LIMIT} are allowed"
                    ),
                ));
            }
            None => None,
        };
        if count > COUNT_LIMIT {
            return Err(SceneError::TooLarge {
                place,
                why: format!("{count} elements, more than {COUNT_LIMIT}"),
            });
        }
        let sparse = match element.get("sparse") {
            Some(sparse) => Some(Sparse::new(
                document,
                sparse,
                count,
                component.size() * width,
                &place,
            )?),
            None => None,
        };
        let normalized = element
            .get("normalized")
            .and_then(Value::as_bool)
            .unwrap_or(false);
        Ok(Self {
            count,
            place,
            component,
            width,
            normalized,
            dense,
            sparse,
        })
    }

    /// The elements as `N` floats each; normalized integers become 0..1 or -1..1 (glTF 2.0, section 3.6.2.2).
    pub fn floats<const N: usize>(&self) -> Result<Vec<[f32; N]>, SceneError> {
        if self.width != N || self.component == Component::U32 {
            return Err(invalid(
                &self.place,
                format_args!("{N} floats or small integers an element are needed"),
            ));
        }
        let read = |bytes: &[u8]| {
            std::array::from_fn(|i| {
                bytes
                    .get(i * self.component.size()..)
                    .map_or(0.0, |b| self.component.float(b, self.normalized))
            })
        };
        self.elements([0.0; N], read)
    }

    /// The elements as vertex indices.
    pub fn indices(&self) -> Result<Vec<u32>, SceneError> {
        if self.width != 1
            || !matches!(
                self.component,
                Component::U8 | Component::U16 | Component::U32
            )
        {
            return Err(invalid(
                &self.place,
                "indices must be unsigned 8, 16 or 32 bit scalars",
            ));
        }
        self.elements(0, |bytes| self.component.unsigned(bytes))
    }

    /// An error about this accessor.
    pub fn invalid(&self, why: impl std::fmt::Display) -> SceneError {
        invalid(&self.place, why)
    }

    fn elements<T: Copy>(&self, zero: T, read: impl Fn(&[u8]) -> T) -> Result<Vec<T>, SceneError> {
        let size = self.component.size() * self.width;
        let mut elements = match &self.dense {
            Some(dense) => (0..self.count)
                .map(|i| read(dense.element(i, size)))
                .collect(),
            None => vec![zero; self.count],
        };
        if let Some(sparse) = &self.sparse {
            for i in 0..sparse.count {
                let index = sparse
                    .component
                    .unsigned(sparse.indices.element(i, sparse.component.size()));
                match elements.get_mut(index as usize) {
                    Some(element) => *element = read(sparse.values.element(i, size)),
                    None => {
                        return Err(invalid(
                            &self.place,
                            format_args!(
                                "its sparse index {index} is not below its count, {}",
                                self.count
                            ),
                        ));
                    }
                }
            }
        }
        Ok(elements)
    }
}

impl<'a> Strided<'a> {
    /// Element `i`; `strided` has made sure that it is there.
    fn element(&self, i: usize, size: usize) -> &'a [u8] {
        &self.bytes[i * self.stride..][..size]
    }
}

impl<'a> Sparse<'a> {
    fn new(
        document: &'a Document,
        sparse: &Value,
        count: usize,
        size: usize,
        place: &str,
    ) -> Result<Self, SceneError> {
        let number = integer(sparse, "count", &place)?.unwrap_or(0);
        if number > count {
            return Err(invalid(
                place,
                format_args!("{number} sparse elements, but a count of {count}"),
            ));
        }
        let part = |key: &str, size: usize| -> Result<Strided<'a>, SceneError> {
            let part = &sparse[key];
            let view = integer(part, "bufferView", &place)?
                .ok_or_else(|| invalid(place, format_args!("sparse.{key} has no bufferView")))?;
            strided(
                document,
                view,
                integer(part, "byteOffset", &place)?.unwrap_or(0),
                number,
                size,
                place,
            )
        };
        let component = Component::parse(&sparse["indices"], place)?;
        if !matches!(component, Component::U8 | Component::U16 | Component::U32) {
            return Err(invalid(place, "sparse indices must be unsigned"));
        }
        Ok(Self {
            count: number,
            indices: part("indices", component.size())?,
            component,
            values: part("values", size)?,
        })
    }
}

/// `count` elements of `size` bytes in a view, from `offset` on, at the view's stride.
fn strided<'a>(
    document: &'a Document,
    view: usize,
    offset: usize,
    count: usize,
    size: usize,
    place: &str,
) -> Result<Strided<'a>, SceneError> {
    let ImageData::View {
        buffer,
        start,
        length,
    } = document.view(view, &place)?
    else {
        return Err(invalid(place, "its bufferView has no buffer"));
    };
    let stride = match integer(
        &list(&document.json, "bufferViews")[view],
        "byteStride",
        &place,
    )?
    .unwrap_or(0)
    {
        0 => size,
        stride if stride < size => {
            return Err(invalid(
                place,
                format_args!("a byteStride of {stride}, but elements of {size} bytes"),
            ));
        }
        stride => stride,
    };
    let end = match count.checked_sub(1) {
        Some(last) => last
            .checked_mul(stride)
            .and_then(|n| n.checked_add(size))
            .and_then(|n| n.checked_add(offset)),
        None => Some(0),
    };
    match end {
        Some(end) if end <= length => {
            let from = if count == 0 { start } else { start + offset };
            Ok(Strided {
                bytes: &document.buffers[buffer][from..start + length],
                stride,
            })
        }
        _ => Err(invalid(
            place,
            format_args!(
                "{count} elements do not fit into the {length} bytes of bufferView {view}"
            ),
        )),
    }
}

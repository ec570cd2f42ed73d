//! Reading glTF's JSON without trusting it: absent is `None`, a wrong type is an error that names the place.

use serde_json::{Map, Value};

use super::error::{SceneError, invalid, one_line};

/// The elements of a top-level or nested array; empty if it is absent or no array.
pub(super) fn list<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value
        .get(key)
        .and_then(Value::as_array)
        .map_or(&[], Vec::as_slice)
}

/// `value.extensions.NAME`.
pub(super) fn extension<'a>(value: &'a Value, name: &str) -> Option<&'a Value> {
    value.get("extensions")?.get(name)
}

/// The punctual lights that nodes refer to.
pub(super) fn punctual(json: &Value) -> &[Value] {
    extension(json, "KHR_lights_punctual").map_or(&[], |lights| list(lights, "lights"))
}

/// Sets a key of what should be an object, and is one afterwards: a file's `null` or 3 in its place means nothing.
pub(super) fn set(element: &mut Value, key: &str, value: impl Into<Value>) {
    *entry(element, key) = value.into();
}

/// The object under a key, made if it is absent or something else.
pub(super) fn object<'a>(element: &'a mut Value, key: &str) -> &'a mut Value {
    let value = entry(element, key);
    if !value.is_object() {
        *value = Value::Object(Map::new());
    }
    value
}

fn entry<'a>(element: &'a mut Value, key: &str) -> &'a mut Value {
    if !element.is_object() {
        *element = Value::Object(Map::new());
    }
    &mut element[key]
}

/// Removes a key; the others keep their order.
pub(super) fn remove(element: &mut Value, key: &str) {
    if let Some(element) = element.as_object_mut() {
        element.shift_remove(key);
    }
}

/// An element's `name`, made fit for one line, or `kind N`.
pub(super) fn name(value: &Value, kind: &str, index: usize) -> String {
    match value.get("name").and_then(Value::as_str) {
        Some(name) if !name.is_empty() => one_line(name),
        _ => format!("{kind} {index}"),
    }
}

/// A non-negative integer, if the key is there.
pub(super) fn integer(
    value: &Value,
    key: &str,
    place: &dyn std::fmt::Display,
) -> Result<Option<usize>, SceneError> {
    match value.get(key) {
        None => Ok(None),
        Some(number) => match number.as_u64().and_then(|n| usize::try_from(n).ok()) {
            Some(number) => Ok(Some(number)),
            None => Err(invalid(
                place,
                format_args!("\"{key}\" is not a non-negative integer"),
            )),
        },
    }
}

/// An index into a list of `length` elements, if the key is there.
pub(super) fn index(
    value: &Value,
    key: &str,
    length: usize,
    place: &dyn std::fmt::Display,
) -> Result<Option<usize>, SceneError> {
    match integer(value, key, place)? {
        Some(index) if index >= length => Err(invalid(
            place,
            format_args!("\"{key}\" is {index}, but there are only {length}"),
        )),
        index => Ok(index),
    }
}

/// A finite number, if the key is there.
pub(super) fn number(
    value: &Value,
    key: &str,
    place: &dyn std::fmt::Display,
) -> Result<Option<f32>, SceneError> {
    match value.get(key) {
        None => Ok(None),
        Some(number) => match finite(number) {
            Some(number) => Ok(Some(number)),
            None => Err(invalid(
                place,
                format_args!("\"{key}\" is not a finite number"),
            )),
        },
    }
}

/// `N` finite numbers, if the key is there.
pub(super) fn numbers<const N: usize>(
    value: &Value,
    key: &str,
    place: &dyn std::fmt::Display,
) -> Result<Option<[f32; N]>, SceneError> {
    let Some(value) = value.get(key) else {
        return Ok(None);
    };
    let mut numbers = [0.0; N];
    let elements = value.as_array().map_or(&[][..], Vec::as_slice);
    let complete = elements.len() == N
        && numbers
            .iter_mut()
            .zip(elements)
            .all(|(n, v)| finite(v).map(|v| *n = v).is_some());
    if complete {
        Ok(Some(numbers))
    } else {
        Err(invalid(
            place,
            format_args!("\"{key}\" is not a list of {N} finite numbers"),
        ))
    }
}

fn finite(value: &Value) -> Option<f32> {
    value.as_f64().map(|n| n as f32).filter(|n| n.is_finite())
}

/// Appends to an array of a JSON object, making it if it is absent; returns the index.
pub(super) fn push(object: &mut Value, key: &str, element: Value) -> usize {
    if !object.is_object() {
        *object = Value::Object(Map::new());
    }
    if !object[key].is_array() {
        object[key] = Value::Array(Vec::new());
    }
    match object[key].as_array_mut() {
        Some(array) => {
            array.push(element);
            array.len() - 1
        }
        None => 0,
    }
}

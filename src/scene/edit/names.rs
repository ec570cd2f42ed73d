//! Nodes and materials by name or by index.

use std::fmt;

use serde::{Deserialize, Deserializer, Serialize, de};
use serde_json::Value;

use super::super::{
    error::one_line,
    json::{self, list},
    nodes::walk,
};
use super::EditError;

/// A node or material: by its name in the file, or by its index, which also finds what has no name of its own.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum Name {
    /// Into glTF's `nodes` or `materials`.
    Index(u32),
    /// As the file has it, and only once; `node 5` and `material 5` for those without a name.
    Name(String),
}

impl From<&str> for Name {
    fn from(name: &str) -> Self {
        Self::Name(name.into())
    }
}

impl From<u32> for Name {
    fn from(index: u32) -> Self {
        Self::Index(index)
    }
}

impl<'de> Deserialize<'de> for Name {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl de::Visitor<'_> for Visitor {
            type Value = Name;
            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a name in quotes or an index")
            }
            fn visit_str<E: de::Error>(self, name: &str) -> Result<Name, E> {
                Ok(Name::Name(name.into()))
            }
            fn visit_u64<E: de::Error>(self, index: u64) -> Result<Name, E> {
                u32::try_from(index)
                    .map(Name::Index)
                    .map_err(|_| E::invalid_value(de::Unexpected::Unsigned(index), &self))
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Index(index) => index.fmt(f),
            Self::Name(name) => write!(f, "\"{}\"", one_line(name)),
        }
    }
}

/// Finds a node of the scene that is shown.
pub(super) fn node(document: &Value, name: &Name) -> Result<usize, EditError> {
    let shown: Vec<usize> = walk(document, true)?.iter().map(|p| p.node).collect();
    find("node", list(document, "nodes"), &shown, name)
}

/// Finds a material.
pub(super) fn material(document: &Value, name: &Name) -> Result<usize, EditError> {
    let materials = list(document, "materials");
    let all: Vec<usize> = (0..materials.len()).collect();
    find("material", materials, &all, name)
}

/// How errors name an element.
pub(super) fn place(kind: &'static str, elements: &[Value], index: usize) -> String {
    let name = elements
        .get(index)
        .map_or_else(String::new, |e| json::name(e, kind, index));
    format!("{kind} {index} ({name})")
}

/// A name for a new node that none of the scene has: the one that is asked for, or one like `base`.
pub(super) fn fresh(
    document: &Value,
    asked: &Option<String>,
    base: &str,
) -> Result<String, EditError> {
    let shown = walk(document, true)?;
    let taken = |name: &str| {
        let own = |e: &Value| e.get("name").and_then(Value::as_str) == Some(name);
        shown
            .iter()
            .find(|p| own(p.element) || p.name == name)
            .map(|p| p.node)
    };
    match asked {
        Some(name) if name.is_empty() => {
            let why = "it is empty; give one or leave it out";
            Err(EditError::field("the new node", "name", why))
        }
        Some(name) => match taken(name) {
            Some(node) => {
                let why = format!(
                    "\"{}\" is the name of node {node}; give another one",
                    one_line(name)
                );
                Err(EditError::field("the new node", "name", why))
            }
            None => Ok(name.clone()),
        },
        None if taken(base).is_none() && !base.is_empty() => Ok(base.into()),
        None => Ok((2u64..)
            .map(|i| format!("{base} {i}"))
            .find(|name| taken(name).is_none())
            .unwrap_or_default()),
    }
}

fn find(
    kind: &'static str,
    elements: &[Value],
    candidates: &[usize],
    name: &Name,
) -> Result<usize, EditError> {
    let unknown = |way_out: String| EditError::Unknown {
        kind,
        name: name.to_string(),
        way_out,
    };
    let text = match name {
        Name::Index(index) => {
            let index = *index as usize;
            if candidates.binary_search(&index).is_ok() {
                return Ok(index);
            }
            return Err(unknown(match elements.len() {
                count if index < count => format!(
                    "the file has it, but the scene does not show it (any more); undo what removed {}",
                    place(kind, elements, index)
                ),
                0 => format!("the scene has no {kind}s"),
                count => format!("the last one is {}", count - 1),
            }));
        }
        Name::Name(text) => text,
    };
    let matches = |index: usize| {
        let element = &elements[index];
        element.get("name").and_then(Value::as_str) == Some(text)
            || json::name(element, kind, index) == *text
    };
    let found: Vec<usize> = candidates.iter().copied().filter(|i| matches(*i)).collect();
    match found[..] {
        [one] => Ok(one),
        [] => {
            let names = candidates
                .iter()
                .map(|&i| json::name(&elements[i], kind, i));
            Err(unknown(match closest(text, names) {
                Some(like) => format!("did you mean \"{like}\"?"),
                None => format!("the scene has no {kind}s"),
            }))
        }
        _ => {
            let numbers: Vec<String> = found.iter().take(8).map(usize::to_string).collect();
            Err(EditError::Ambiguous {
                kind,
                name: one_line(text),
                count: found.len(),
                numbers: numbers.join(", ") + if found.len() > 8 { ", …" } else { "" },
            })
        }
    }
}

/// The name that takes the fewest changes of a character (Levenshtein 1966) to become `text`.
fn closest(text: &str, names: impl Iterator<Item = String>) -> Option<String> {
    let text: Vec<char> = text.chars().take(80).collect();
    names.min_by_key(|name| {
        let mut row: Vec<usize> = (0..=text.len()).collect();
        for (i, c) in name.chars().enumerate() {
            let mut diagonal = std::mem::replace(&mut row[0], i + 1);
            for (j, t) in text.iter().enumerate() {
                let changed = diagonal + usize::from(c != *t);
                diagonal = row[j + 1];
                row[j + 1] = changed.min(diagonal + 1).min(row[j] + 1);
            }
        }
        row[text.len()]
    })
}

//! What an edit did to a document, kept so that it can be taken back and done again, exactly.

use std::sync::Arc;

use serde_json::{Map, Value};

use super::super::{Document, EncodedImage};

/// The difference between two versions of a document. Buffers and images are only ever appended.
#[derive(Debug)]
pub(super) struct Patch {
    places: Vec<Place>,
    buffers: Vec<Arc<Vec<u8>>>,
    images: Vec<EncodedImage>,
}

#[derive(Debug)]
struct Place {
    path: Vec<Step>,
    what: What,
}

#[derive(Clone, Debug)]
enum Step {
    Key(String),
    Index(usize),
}

#[derive(Debug)]
enum What {
    Replaced {
        old: Value,
        new: Value,
    },
    /// At the end of an array.
    Elements(Vec<Value>),
    /// At the end of an object.
    Entries(Vec<(String, Value)>),
}

impl Patch {
    /// From `old` to `new`.
    pub fn between(old: &Document, new: &Document) -> Self {
        let mut places = Vec::new();
        compare(&old.json, &new.json, &mut Vec::new(), &mut places);
        Self {
            places,
            buffers: new.buffers[old.buffers.len()..].to_vec(),
            images: new.images[old.images.len()..].to_vec(),
        }
    }

    /// Makes the new version of the old one.
    pub fn apply(&self, document: &mut Document) {
        for place in &self.places {
            let target = reach(&mut document.json, &place.path);
            match &place.what {
                What::Replaced { new, .. } => *target = new.clone(),
                What::Elements(elements) => {
                    let array = target.as_array_mut().expect("it was one");
                    array.extend(elements.iter().cloned());
                }
                What::Entries(entries) => {
                    let object = target.as_object_mut().expect("it was one");
                    object.extend(entries.iter().cloned());
                }
            }
        }
        document.buffers.extend(self.buffers.iter().cloned());
        document.images.extend(self.images.iter().cloned());
    }

    /// Makes the old version of the new one.
    pub fn revert(&self, document: &mut Document) {
        for place in self.places.iter().rev() {
            let target = reach(&mut document.json, &place.path);
            match &place.what {
                What::Replaced { old, .. } => *target = old.clone(),
                What::Elements(elements) => {
                    let array = target.as_array_mut().expect("it was one");
                    array.truncate(array.len() - elements.len());
                }
                What::Entries(entries) => {
                    let object = target.as_object_mut().expect("it was one");
                    for (key, _) in entries {
                        object.shift_remove(key);
                    }
                }
            }
        }
        let count = document.buffers.len() - self.buffers.len();
        document.buffers.truncate(count);
        let count = document.images.len() - self.images.len();
        document.images.truncate(count);
    }
}

/// Paths lead to where they led when the patch was made: it is only used on the two documents that it stands between.
fn reach<'a>(json: &'a mut Value, path: &[Step]) -> &'a mut Value {
    path.iter().fold(json, |value, step| match step {
        Step::Key(key) => &mut value[key.as_str()],
        Step::Index(index) => &mut value[*index],
    })
}

fn compare(old: &Value, new: &Value, path: &mut Vec<Step>, places: &mut Vec<Place>) {
    let mut add = |path: &[Step], what| {
        places.push(Place {
            path: path.to_vec(),
            what,
        });
    };
    match (old, new) {
        (Value::Array(a), Value::Array(b)) if a.len() <= b.len() => {
            if a.len() < b.len() {
                add(path, What::Elements(b[a.len()..].to_vec()));
            }
            for (i, (a, b)) in a.iter().zip(b).enumerate() {
                path.push(Step::Index(i));
                compare(a, b, path, places);
                path.pop();
            }
        }
        (Value::Object(a), Value::Object(b)) if extends(a, b) => {
            if a.len() < b.len() {
                let entries = b.iter().skip(a.len());
                let entries = entries.map(|(k, v)| (k.clone(), v.clone())).collect();
                add(path, What::Entries(entries));
            }
            for ((key, a), b) in a.iter().zip(b.values()) {
                path.push(Step::Key(key.clone()));
                compare(a, b, path, places);
                path.pop();
            }
        }
        (Value::Number(a), Value::Number(b)) if same_number(a, b) => {}
        (Value::Array(_) | Value::Object(_) | Value::Number(_), _) => add(
            path,
            What::Replaced {
                old: old.clone(),
                new: new.clone(),
            },
        ),
        (a, b) if a == b => {}
        _ => add(
            path,
            What::Replaced {
                old: old.clone(),
                new: new.clone(),
            },
        ),
    }
}

/// Whether `b` is `a` with entries appended, the order being told.
fn extends(a: &Map<String, Value>, b: &Map<String, Value>) -> bool {
    a.len() <= b.len() && a.keys().zip(b.keys()).all(|(a, b)| a == b)
}

/// -0 is not 0, and 1.0 is not 1: they are written differently.
fn same_number(a: &serde_json::Number, b: &serde_json::Number) -> bool {
    a == b && a.as_f64().map(f64::to_bits) == b.as_f64().map(f64::to_bits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn values() -> impl Strategy<Value = Value> {
        let leaf = prop_oneof![
            Just(Value::Null),
            any::<bool>().prop_map(Value::from),
            prop::sample::select(vec![0.0, -0.0, 1.5]).prop_map(Value::from),
            (0u32..3).prop_map(Value::from),
        ];
        leaf.prop_recursive(3, 24, 4, |inner| {
            let key = prop::sample::select(vec!["a", "b", "c", "d"]);
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..4).prop_map(Value::from),
                prop::collection::vec((key, inner), 0..4)
                    .prop_map(|e| { e.into_iter().map(|(k, v)| (k.to_owned(), v)).collect() }),
            ]
        })
    }

    proptest! {
        #[test]
        fn leads_there_and_back(a in values(), b in values()) {
            let document = |json: &Value| Document { json: json.clone(), ..Document::default() };
            let patch = Patch::between(&document(&a), &document(&b));
            let mut edited = document(&a);
            patch.apply(&mut edited);
            // As text: the order of keys and the sign of zero count.
            prop_assert_eq!(edited.json.to_string(), b.to_string());
            patch.revert(&mut edited);
            prop_assert_eq!(edited.json.to_string(), a.to_string());
        }
    }
}

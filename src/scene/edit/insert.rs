//! Edits of the tree: nodes added, copied and removed. Nodes are only ever appended, and removed ones stay where they are,
//! out of the tree, so that a node's index is for life.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Value, json};

use super::super::{
    Document, Scene,
    copier::Copier,
    error::SceneError,
    json::{extension, integer, list, name, push, remove, set},
    nodes::{roots, shown_scene, walk},
    uri::inside,
};
use super::EditError;
use super::names::{self, Name};

/// Nodes that one edit may add: copies of copies double with every line of a script.
const ADDED_LIMIT: usize = 1 << 16;
/// Nodes that a document may have after it.
const NODE_LIMIT: usize = 1 << 22;

/// What a node of another file keeps, beside its mesh, its light and its children.
const KEPT: [&str; 6] = [
    "name",
    "translation",
    "rotation",
    "scale",
    "matrix",
    "extras",
];

pub(super) fn add(
    document: &mut Document,
    folder: &Path,
    file: &str,
    name: &Option<String>,
    parent: Option<&Name>,
) -> Result<(), EditError> {
    let parent = parent.map(|p| names::node(&document.json, p)).transpose()?;
    let stem = Path::new(file).file_stem().unwrap_or_default();
    let name = names::fresh(&document.json, name, &stem.to_string_lossy())?;
    let refused = |cause: SceneError| EditError::file(file, cause);
    let path = inside(file, Some(folder), "the edit").map_err(refused)?;
    let (scene, source) = Scene::load(&path).map_err(refused)?;
    if scene.objects.is_empty() && scene.lights.is_empty() {
        return Err(refused(SceneError::Empty));
    }
    drop(scene);

    let placed = walk(&source.json, true).map_err(refused)?;
    let first = list(&document.json, "nodes").len();
    limit(first, 1 + placed.len())?;
    let numbers: BTreeMap<usize, usize> = placed
        .iter()
        .enumerate()
        .map(|(rank, node)| (node.node, first + 1 + rank))
        .collect();
    let mut copier = Copier::new(&source, document, format!("\"{file}\""));
    let mut nodes = Vec::new();
    for node in &placed {
        let mut copy = json!({});
        for key in KEPT {
            if let Some(value) = node.element.get(key) {
                copy[key] = value.clone();
            }
        }
        if let Some(mesh) = integer(node.element, "mesh", &node.place()).map_err(refused)? {
            copy["mesh"] = copier.mesh(mesh).map_err(refused)?.into();
        }
        if let Some(light) = extension(node.element, "KHR_lights_punctual") {
            let light = integer(light, "light", &node.place()).map_err(refused)?;
            let light = copier.light(light.unwrap_or(usize::MAX)).map_err(refused)?;
            copy["extensions"] = json!({ "KHR_lights_punctual": { "light": light } });
        }
        renumber(&mut copy, list(node.element, "children"), &numbers);
        nodes.push(copy);
    }
    copier.extensions();
    let tops = roots(&source.json, list(&source.json, "nodes").len()).map_err(refused)?;
    let mut top = json!({ "name": name });
    let tops: Vec<Value> = tops.into_iter().map(Value::from).collect();
    renumber(&mut top, &tops, &numbers);
    // The new node first: whoever is asked for the one that was added finds it there.
    for node in [top].into_iter().chain(nodes) {
        push(&mut document.json, "nodes", node);
    }
    attach(document, parent, first)
}

pub(super) fn copy(
    document: &mut Document,
    node: &Name,
    name_of_copy: &Option<String>,
) -> Result<(), EditError> {
    let node = names::node(&document.json, node)?;
    let nodes = list(&document.json, "nodes");
    let base = name(&nodes[node], "node", node);
    let name_of_copy = names::fresh(&document.json, name_of_copy, &base)?;
    let mut subtree = vec![node];
    let mut next = 0;
    while let Some(&at) = subtree.get(next) {
        next += 1;
        subtree.extend(children(&nodes[at]));
    }
    // In the order of their nodes, as a file's are.
    subtree.sort_unstable();
    let first = nodes.len();
    limit(first, subtree.len())?;
    let numbers: BTreeMap<usize, usize> = subtree
        .iter()
        .enumerate()
        .map(|(rank, node)| (*node, first + rank))
        .collect();
    let copies: Vec<Value> = subtree
        .iter()
        .map(|&old| {
            let mut copy = nodes[old].clone();
            renumber(&mut copy, list(&nodes[old], "children"), &numbers);
            if old == node {
                set(&mut copy, "name", name_of_copy.clone());
            }
            copy
        })
        .collect();
    let parent = parent(&document.json, node)?;
    for copy in copies {
        push(&mut document.json, "nodes", copy);
    }
    attach(document, parent, numbers[&node])
}

pub(super) fn detach(document: &mut Document, node: &Name) -> Result<(), EditError> {
    let node = names::node(&document.json, node)?;
    let parent = parent(&document.json, node)?;
    let json = &mut document.json;
    let scene = match shown_scene(json)? {
        Some(scene) => scene,
        None => {
            // All that is nobody's child is shown: what leaves its parent would be, too. So the roots are told from now on.
            let roots = roots(json, list(json, "nodes").len())?;
            json["scenes"] = json!([{ "nodes": roots }]);
            json["scene"] = 0.into();
            0
        }
    };
    let (owner, key) = match parent {
        Some(parent) => (&mut json["nodes"][parent], "children"),
        None => (&mut json["scenes"][scene], "nodes"),
    };
    let rest: Vec<Value> = list(owner, key)
        .iter()
        .filter(|child| child.as_u64() != Some(node as u64))
        .cloned()
        .collect();
    // glTF has no empty lists.
    if rest.is_empty() {
        remove(owner, key);
    } else {
        owner[key] = rest.into();
    }
    Ok(())
}

/// Hangs a node that nobody has onto another one, or onto the scene that is shown.
fn attach(document: &mut Document, parent: Option<usize>, node: usize) -> Result<(), EditError> {
    match parent {
        Some(parent) => {
            push(&mut document.json["nodes"][parent], "children", node.into());
        }
        None => {
            // Without scenes it is shown because it is nobody's child.
            if let Some(scene) = shown_scene(&document.json)? {
                push(&mut document.json["scenes"][scene], "nodes", node.into());
            }
        }
    }
    Ok(())
}

/// The node that has another one as its child, both shown.
fn parent(json: &Value, node: usize) -> Result<Option<usize>, EditError> {
    let placed = walk(json, true)?;
    let parent = placed
        .iter()
        .find(|p| children(p.element).any(|child| child == node));
    Ok(parent.map(|p| p.node))
}

fn children(node: &Value) -> impl Iterator<Item = usize> {
    let children = list(node, "children").iter();
    children.filter_map(|child| child.as_u64().map(|child| child as usize))
}

/// Gives a copy the copies of some children.
fn renumber(copy: &mut Value, children: &[Value], numbers: &BTreeMap<usize, usize>) {
    let children: Vec<usize> = children
        .iter()
        .filter_map(|child| numbers.get(&(child.as_u64()? as usize)).copied())
        .collect();
    if !children.is_empty() {
        set(copy, "children", children);
    }
}

fn limit(nodes: usize, added: usize) -> Result<(), EditError> {
    let why = if added > ADDED_LIMIT {
        format!("{added} nodes at once are more than {ADDED_LIMIT}; copy or add less")
    } else if nodes + added > NODE_LIMIT {
        format!(
            "{} nodes, removed ones included, are more than {NODE_LIMIT}; copy or add less",
            nodes + added
        )
    } else {
        return Ok(());
    };
    Err(EditError::Scene {
        place: "the edited scene".into(),
        why,
    })
}

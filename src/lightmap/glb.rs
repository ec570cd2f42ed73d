//! The input file with the lightmap in it: a mesh per object with atlas coordinates, and `MOZ_lightmap` on its materials.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use serde_json::{Value, json};

use super::raw::{Attribute, Writer, list, number, push};
use super::{Atlas, ObjectAtlas};
use crate::scene::{Document, EncodedImage, ImageData, Object, Primitive, Scene};

/// The name of page `page`'s file.
pub fn page_file(page: u32) -> String {
    format!("lightmap_{page}.exr")
}

/// `document` with every object of `scene` (which was read from it) lit by its place in `atlas`: its mesh is its own, with
/// `TEXCOORD_1` in the atlas, and its materials carry `MOZ_lightmap` with a texture whose image is [`page_file`]. Everything else stays.
///
/// Where a material reads the old `TEXCOORD_1` for another texture, that set moves to the first free number and
/// the material with it.
pub fn lit_document(document: &Document, scene: &Scene, atlas: &Atlas) -> Document {
    let mut lit = document.clone();
    let textures = page_textures(&mut lit, atlas);
    let mut materials = Materials {
        document,
        textures,
        made: BTreeMap::new(),
        taken: BTreeSet::new(),
    };
    // What an edit removed is left as it is, out of the scene.
    let lit_objects: Vec<(&Object, &ObjectAtlas)> = (0..)
        .zip(scene.objects.iter().zip(&atlas.objects))
        .filter(|(i, _)| !scene.is_gone(*i))
        .map(|(_, object)| object)
        .collect();
    let shown: BTreeSet<usize> = lit_objects.iter().map(|(o, _)| o.node as usize).collect();
    let replaced: BTreeSet<(u32, u32)> = lit_objects
        .iter()
        .flat_map(|(object, _)| {
            let mesh = &scene.meshes[object.mesh as usize];
            mesh.primitives.iter().map(|p| (mesh.source, p.source))
        })
        .collect();
    let users = mesh_users(document);
    let mut in_place = BTreeSet::new();
    let dead = unused_after(document, &shown, &replaced, &users);
    let mut writer = Writer::new(&mut lit, &dead);
    let mut meshes: Vec<(usize, Option<usize>, Value)> = Vec::new();
    for (object, place) in lit_objects {
        let mesh = &scene.meshes[object.mesh as usize];
        let source = mesh.source as usize;
        let mut element = list(&document.json, "meshes")[source].clone();
        for primitive in &mesh.primitives {
            let split = Split::new(primitive, place, atlas.page_size);
            let slot = &mut element["primitives"][primitive.source as usize];
            let material = number(slot, "material");
            let original = material.and_then(|m| list(&document.json, "materials").get(m));
            let moved = original
                .filter(|m| reads_set_1(m))
                .and_then(|_| free_set(slot));
            split.write(document, slot, moved, &mut writer);
            slot["material"] = json!({ "of": material, "page": place.page, "set": moved });
        }
        // The first to come takes the mesh's own slot, unless a node outside the scene still shows it as it was.
        let shared = users
            .get(&source)
            .is_some_and(|nodes| nodes.iter().any(|n| !shown.contains(n)));
        let own = (!shared && in_place.insert(source)).then_some(source);
        meshes.push((object.node as usize, own, element));
    }
    writer.finish();
    for (node, own, mut element) in meshes {
        for slot in element["primitives"].as_array_mut().into_iter().flatten() {
            if let Some(key) = slot.get("material").filter(|m| m.is_object()).cloned() {
                slot["material"] = materials.get(&mut lit, &key).into();
            }
        }
        let mesh = match own {
            Some(slot) => {
                lit.json["meshes"][slot] = element;
                slot
            }
            None => push(&mut lit.json, "meshes", element),
        };
        lit.json["nodes"][node]["mesh"] = mesh.into();
    }
    for extension in ["MOZ_lightmap", "EXT_texture_exr"] {
        if !list(&lit.json, "extensionsUsed")
            .iter()
            .any(|used| used == extension)
        {
            push(&mut lit.json, "extensionsUsed", extension.into());
        }
    }
    lit
}

/// A primitive's vertices, one for every corner that the layout keeps apart.
struct Split {
    /// Vertices of the primitive, as its attributes count them.
    sources: Vec<u32>,
    coordinates: Vec<[f32; 2]>,
    indices: Vec<u32>,
}

impl Split {
    fn new(primitive: &Primitive, place: &ObjectAtlas, page_size: u32) -> Self {
        let mut split = Self {
            sources: Vec::new(),
            coordinates: Vec::new(),
            indices: Vec::new(),
        };
        let mut renumbered = HashMap::new();
        let range = primitive.triangles.start as usize..primitive.triangles.end as usize;
        for &v in place.layout.triangles[range].as_flattened() {
            let next = split.sources.len() as u32;
            let index = *renumbered.entry(v).or_insert(next);
            if index == next {
                let vertex = place.layout.vertices[v as usize];
                let uv = (vertex.uv + place.origin.as_vec2()) / page_size as f32;
                split.sources.push(vertex.source - primitive.vertices.start);
                split.coordinates.push(uv.to_array());
            }
            split.indices.push(index);
        }
        split
    }

    /// Replaces the attributes and indices of the primitive `slot`; its `TEXCOORD_1` moves to `TEXCOORD_{moved}`.
    fn write(
        &self,
        document: &Document,
        slot: &mut Value,
        moved: Option<usize>,
        writer: &mut Writer,
    ) {
        let mut copy = |attributes: &Value| {
            let mut copied = serde_json::Map::new();
            for (name, accessor) in attributes.as_object().into_iter().flatten() {
                let name = match (name.as_str(), moved) {
                    ("TEXCOORD_1", None) => continue,
                    ("TEXCOORD_1", Some(set)) => format!("TEXCOORD_{set}"),
                    _ => name.clone(),
                };
                let read = accessor
                    .as_u64()
                    .and_then(|a| Attribute::read(document, a as usize));
                match read.and_then(|a| a.gather(&self.sources)) {
                    Some(attribute) => {
                        let written = writer.attribute(&attribute, name == "POSITION");
                        copied.insert(name, written.into());
                    }
                    None => tracing::warn!(
                        "attribute {name} cannot be read and is left out of scene.glb"
                    ),
                }
            }
            copied
        };
        let mut attributes = copy(&slot["attributes"]);
        let targets: Vec<Value> = list(slot, "targets")
            .iter()
            .map(|t| copy(t).into())
            .collect();
        if !targets.is_empty() {
            slot["targets"] = targets.into();
        }
        let coordinates = writer.attribute(&Attribute::texcoords(&self.coordinates), false);
        attributes.insert("TEXCOORD_1".into(), coordinates.into());
        slot["attributes"] = attributes.into();
        slot["indices"] = writer.indices(&self.indices, self.sources.len()).into();
        if let Some(slot) = slot.as_object_mut() {
            slot.shift_remove("mode");
        }
    }
}

/// The first texture coordinate set that a primitive does not have, if it has `TEXCOORD_1`.
fn free_set(primitive: &Value) -> Option<usize> {
    let attributes = primitive.get("attributes")?;
    attributes.get("TEXCOORD_1")?;
    (2..).find(|set| attributes.get(format!("TEXCOORD_{set}")).is_none())
}

/// Materials with lightmaps, one per material, page and moved coordinate set.
struct Materials<'a> {
    /// As it was read.
    document: &'a Document,
    textures: Vec<usize>,
    made: BTreeMap<String, usize>,
    /// Materials of the file that have become one of these; a further one is a copy.
    taken: BTreeSet<usize>,
}

impl Materials<'_> {
    fn get(&mut self, lit: &mut Document, key: &Value) -> usize {
        if let Some(made) = self.made.get(&key.to_string()) {
            return *made;
        }
        let of = number(key, "of");
        let page = number(key, "page").unwrap_or(0);
        let original = of.and_then(|of| list(&self.document.json, "materials").get(of));
        let mut material = original.cloned().unwrap_or_else(|| json!({}));
        if let Some(set) = number(key, "set") {
            move_set(&mut material, set);
        }
        if !material["extensions"].is_object() {
            material["extensions"] = json!({});
        }
        material["extensions"]["MOZ_lightmap"] =
            json!({ "index": self.textures[page], "texCoord": 1, "intensity": 1 });
        let index = match of.filter(|of| self.taken.insert(*of)) {
            Some(own) => {
                lit.json["materials"][own] = material;
                own
            }
            None => {
                if let Some(name) = material.get("name").and_then(Value::as_str) {
                    material["name"] = format!("{name} (lightmap {page})").into();
                }
                push(&mut lit.json, "materials", material)
            }
        };
        self.made.insert(key.to_string(), index);
        index
    }
}

/// Whether a texture of the material, its lightmap apart, reads `TEXCOORD_1`.
fn reads_set_1(value: &Value) -> bool {
    match value {
        Value::Object(map) => map.iter().any(|(key, v)| match key.as_str() {
            "texCoord" => v.as_u64() == Some(1),
            "MOZ_lightmap" => false,
            _ => reads_set_1(v),
        }),
        Value::Array(array) => array.iter().any(reads_set_1),
        _ => false,
    }
}

/// Makes every texture of a material that reads set 1 read `set`.
fn move_set(value: &mut Value, set: usize) {
    match value {
        Value::Object(map) => {
            for (key, v) in map {
                if key == "texCoord" && v.as_u64() == Some(1) {
                    *v = set.into();
                } else {
                    move_set(v, set);
                }
            }
        }
        Value::Array(array) => array.iter_mut().for_each(|v| move_set(v, set)),
        _ => {}
    }
}

/// A texture for every page. Those of an earlier bake are used again.
fn page_textures(document: &mut Document, atlas: &Atlas) -> Vec<usize> {
    let mut sampler = None;
    (0..atlas.pages)
        .map(|page| {
            let file = page_file(page);
            let image = list(&document.json, "images")
                .iter()
                .position(|i| i.get("uri").and_then(Value::as_str) == Some(&file));
            let empty = EncodedImage { mime: "image/x-exr".into(), data: ImageData::Bytes(Arc::default()) };
            let image = match image {
                Some(image) => {
                    // Loaded from beside the file, it would be embedded.
                    if let Some(old) = document.images.get_mut(image) {
                        *old = empty;
                    }
                    image
                }
                None => {
                    document.images.push(empty);
                    push(&mut document.json, "images", json!({ "uri": file, "mimeType": "image/x-exr" }))
                }
            };
            let source = |t: &Value| number(t.get("extensions")?.get("EXT_texture_exr")?, "source");
            let known = list(&document.json, "textures").iter().position(|t| source(t) == Some(image));
            known.unwrap_or_else(|| {
                let sampler = *sampler.get_or_insert_with(|| {
                    // Bilinear, without mip levels, clamped.
                    let clamped = json!({ "magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071 });
                    push(&mut document.json, "samplers", clamped)
                });
                let texture = json!({ "sampler": sampler, "extensions": { "EXT_texture_exr": { "source": image } } });
                push(&mut document.json, "textures", texture)
            })
        })
        .collect()
}

/// Which nodes show which mesh.
fn mesh_users(document: &Document) -> BTreeMap<usize, Vec<usize>> {
    let mut users: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (node, element) in list(&document.json, "nodes").iter().enumerate() {
        if let Some(mesh) = number(element, "mesh") {
            users.entry(mesh).or_default().push(node);
        }
    }
    users
}

/// The accessors that only the replaced primitives use, as far as anything known can tell.
fn unused_after(
    document: &Document,
    shown: &BTreeSet<usize>,
    replaced: &BTreeSet<(u32, u32)>,
    users: &BTreeMap<usize, Vec<usize>>,
) -> BTreeSet<usize> {
    let (mut dead, mut alive) = (BTreeSet::new(), BTreeSet::new());
    for (m, mesh) in list(&document.json, "meshes").iter().enumerate() {
        let nodes = users.get(&m).map_or(&[][..], Vec::as_slice);
        let kept = nodes.iter().any(|n| !shown.contains(n));
        for (p, primitive) in list(mesh, "primitives").iter().enumerate() {
            let gone = !kept && replaced.contains(&(m as u32, p as u32));
            let into = if gone { &mut dead } else { &mut alive };
            into.extend(number(primitive, "indices"));
            let maps = primitive
                .get("attributes")
                .into_iter()
                .chain(list(primitive, "targets"));
            for map in maps.filter_map(Value::as_object) {
                into.extend(map.values().filter_map(|v| v.as_u64().map(|v| v as usize)));
            }
        }
    }
    for sampler in list(&document.json, "animations")
        .iter()
        .flat_map(|a| list(a, "samplers"))
    {
        alive.extend(number(sampler, "input"));
        alive.extend(number(sampler, "output"));
    }
    alive.extend(
        list(&document.json, "skins")
            .iter()
            .filter_map(|s| number(s, "inverseBindMatrices")),
    );
    let nodes = list(&document.json, "nodes").iter();
    for instancing in nodes.filter_map(|n| {
        n.get("extensions")?
            .get("EXT_mesh_gpu_instancing")?
            .get("attributes")
    }) {
        let accessors = instancing.as_object().into_iter().flatten();
        alive.extend(accessors.filter_map(|(_, v)| v.as_u64().map(|v| v as usize)));
    }
    let count = list(&document.json, "accessors").len();
    dead.retain(|a| *a < count && !alive.contains(a));
    dead
}

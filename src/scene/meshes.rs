//! glTF meshes to triangles: attributes checked and read, strips and fans unrolled.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde_json::Value;

use super::{
    Mesh, Primitive,
    accessor::{Accessor, COUNT_LIMIT},
    assets::{Assets, Indexed, LoadedMesh},
    document::Document,
    error::{SceneError, invalid},
    json::{index, integer, list, name},
};

/// Reads the meshes with the given glTF indices, in that order. `materials` is the number of glTF materials. Those that
/// `assets` holds are not read again.
///
/// # Errors
/// Anything in an accessor that does not fit, with mesh, primitive and accessor named.
pub(super) fn load_meshes(
    document: &Document,
    used: &[usize],
    materials: usize,
    assets: &Assets,
) -> Result<Indexed<LoadedMesh>, SceneError> {
    // Primitives may share accessors, so a small file can ask for any number of vertices: count before reading.
    let mut total = 0usize;
    for &source in used {
        for primitive in list(&list(&document.json, "meshes")[source], "primitives") {
            for accessor in [
                primitive.get("indices"),
                primitive.get("attributes").and_then(|a| a.get("POSITION")),
            ] {
                let element = accessor
                    .and_then(Value::as_u64)
                    .and_then(|i| list(&document.json, "accessors").get(i as usize));
                total = total.saturating_add(
                    element
                        .and_then(|e| e.get("count"))
                        .and_then(Value::as_u64)
                        .unwrap_or(0) as usize,
                );
            }
        }
    }
    // Three indices and a vertex each: more than any real scene, and still in memory.
    if total > 4 * COUNT_LIMIT {
        return Err(SceneError::TooLarge {
            place: "the meshes".into(),
            why: format!(
                "{total} vertices and indices, more than {}",
                4 * COUNT_LIMIT
            ),
        });
    }
    // Collected in order, so that the first error is the same one whatever the threads do.
    let meshes: Vec<Result<_, SceneError>> = used
        .par_iter()
        .map(|&source| match assets.meshes.get(&source) {
            Some(known) => Ok((source, known.clone())),
            None => {
                let mesh = load_mesh(document, source, materials)?;
                Ok((source, LoadedMesh::new(Arc::new(mesh))))
            }
        })
        .collect();
    meshes.into_iter().collect()
}

fn load_mesh(document: &Document, source: usize, materials: usize) -> Result<Mesh, SceneError> {
    let element = &list(&document.json, "meshes")[source];
    let mut mesh = Mesh {
        name: name(element, "mesh", source),
        source: source as u32,
        ..Mesh::default()
    };
    for (i, primitive) in list(element, "primitives").iter().enumerate() {
        let place = format!("mesh {source} ({}), primitive {i}", mesh.name);
        load_primitive(document, primitive, i, materials, &place, &mut mesh)?;
    }
    gather_strays(&mut mesh);
    // A set that only some primitives have is filled up: zero is what glTF's samplers would read.
    for set in &mut mesh.texcoords {
        if !set.is_empty() {
            set.resize(mesh.positions.len(), Vec2::ZERO);
        }
    }
    Ok(mesh)
}

/// Moves vertices that no triangle uses to one that is used. Primitives that share attributes have many; they must not widen the
/// scene's bounds, which suns depend on, since a file that is written has none of them.
fn gather_strays(mesh: &mut Mesh) {
    let Some(&[first, ..]) = mesh.triangles.first() else {
        return;
    };
    let mut used = vec![false; mesh.positions.len()];
    for &vertex in mesh.triangles.as_flattened() {
        used[vertex as usize] = true;
    }
    let place = mesh.positions[first as usize];
    for (position, _) in mesh
        .positions
        .iter_mut()
        .zip(used)
        .filter(|(_, used)| !used)
    {
        *position = place;
    }
}

fn load_primitive(
    document: &Document,
    primitive: &Value,
    source: usize,
    materials: usize,
    place: &String,
    mesh: &mut Mesh,
) -> Result<(), SceneError> {
    let mode = integer(primitive, "mode", place)?.unwrap_or(4);
    if mode < 4 {
        tracing::warn!("{place}: points and lines are left out");
        return Ok(());
    }
    if mode > 6 {
        return Err(invalid(
            place,
            format_args!("mode {mode} is none of glTF's seven"),
        ));
    }
    let accessors = list(&document.json, "accessors").len();
    let attributes = &primitive["attributes"];
    let attribute = |role: &str| -> Result<Option<Accessor>, SceneError> {
        match index(attributes, role, accessors, place)? {
            Some(i) => Ok(Some(Accessor::new(document, i, place, role)?)),
            None => Ok(None),
        }
    };
    let material = index(primitive, "material", materials, place)?;
    let Some(positions) = attribute("POSITION")? else {
        if primitive
            .get("extensions")
            .and_then(|e| e.get("KHR_draco_mesh_compression"))
            .is_some()
        {
            return Err(SceneError::Extensions {
                names: vec!["KHR_draco_mesh_compression".into()],
            });
        }
        tracing::warn!("{place}: no positions, left out");
        return Ok(());
    };
    let count = positions.count;
    let same_count = |accessor: &Accessor| {
        if accessor.count == count {
            Ok(())
        } else {
            Err(accessor.invalid(format_args!(
                "{} elements for {count} vertices",
                accessor.count
            )))
        }
    };

    let first = mesh.positions.len() as u32;
    for (i, position) in positions.floats::<3>()?.into_iter().enumerate() {
        let position = Vec3::from(position);
        if !position.is_finite() {
            return Err(positions.invalid(format_args!(
                "vertex {i} is at {position}, which is no place"
            )));
        }
        mesh.positions.push(position);
    }
    match attribute("NORMAL")? {
        Some(normals) => {
            same_count(&normals)?;
            mesh.normals.extend(
                normals
                    .floats::<3>()?
                    .into_iter()
                    .map(|n| unit(Vec3::from(n))),
            );
        }
        None => mesh.normals.resize(mesh.positions.len(), Vec3::ZERO),
    }
    for (set, role) in ["TEXCOORD_0", "TEXCOORD_1"].into_iter().enumerate() {
        if let Some(coordinates) = attribute(role)? {
            same_count(&coordinates)?;
            let set = &mut mesh.texcoords[set];
            set.resize(first as usize, Vec2::ZERO);
            set.extend(
                coordinates
                    .floats::<2>()?
                    .into_iter()
                    .map(|uv| finite_or_zero(Vec2::from(uv))),
            );
        }
    }

    let start = mesh.triangles.len() as u32;
    match index(primitive, "indices", accessors, place)? {
        Some(i) => {
            let accessor = Accessor::new(document, i, place, "indices")?;
            let indices = accessor.indices()?;
            if let Some(at) = indices.iter().position(|i| *i as usize >= count) {
                return Err(accessor.invalid(format_args!(
                    "index {at} is {}, but there are only {count} vertices",
                    indices[at]
                )));
            }
            unroll(
                mode,
                indices.len(),
                |i| first + indices[i],
                &mut mesh.triangles,
            );
        }
        None => unroll(mode, count, |i| first + i as u32, &mut mesh.triangles),
    }
    mesh.primitives.push(Primitive {
        triangles: start..mesh.triangles.len() as u32,
        vertices: first..mesh.positions.len() as u32,
        material: material.map_or(0, |m| m as u32 + 1),
        source: source as u32,
    });
    Ok(())
}

/// Triangles (4), strip (5) or fan (6), wound as glTF 2.0 section 3.7.2.1 says. What is left over at the end is left out.
fn unroll(mode: usize, count: usize, vertex: impl Fn(usize) -> u32, triangles: &mut Vec<[u32; 3]>) {
    match mode {
        4 => triangles.extend((0..count / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2].map(&vertex))),
        5 => triangles.extend(
            (0..count.saturating_sub(2)).map(|i| [i, i + 1 + i % 2, i + 2 - i % 2].map(&vertex)),
        ),
        _ => triangles.extend((0..count.saturating_sub(2)).map(|i| [i + 1, i + 2, 0].map(&vertex))),
    }
}

/// The direction, or zero if there is none.
fn unit(normal: Vec3) -> Vec3 {
    // In two steps, since the square of a short vector may be zero and that of a long one infinite.
    let largest = normal.abs().max_element();
    if largest.is_finite() && largest > 0.0 && !normal.is_nan() {
        (normal / largest).normalize_or_zero()
    } else {
        Vec3::ZERO
    }
}

fn finite_or_zero(uv: Vec2) -> Vec2 {
    if uv.is_finite() { uv } else { Vec2::ZERO }
}

impl Mesh {
    /// The primitive that a triangle belongs to.
    pub fn primitive_of(&self, triangle: u32) -> &Primitive {
        &self.primitives[self
            .primitives
            .partition_point(|primitive| primitive.triangles.end <= triangle)]
    }
}

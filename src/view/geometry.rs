//! The scene as the device draws it: vertices with all that surfaces are looked up by, in parts that objects share.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{Affine3A, Mat4, Vec2, Vec3};

use super::look::Look;
use crate::gpu::{Buffer, Commands, Gpu, Memory, Result, Sides, Stage};
use crate::lightmap::{Atlas, UvLayout};
use crate::scene::{AlphaMode, Bounds, Material, Mesh, Scene, TextureRef};

/// As in `view_scene.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct Vertex {
    pub(super) position: [f32; 3],
    pub(super) normal: [f32; 3],
    pub(super) color_uv: [f32; 2],
    pub(super) emission_uv: [f32; 2],
    pub(super) light_uv: [f32; 2],
}

/// An object in its place: as in `view_scene.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct Placed {
    pub(super) columns: [[f32; 3]; 4],
    pub(super) origin: [f32; 2],
    pub(super) page: f32,
}

/// A material: as in `view_scene.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct Surface {
    pub(super) color: [f32; 3],
    pub(super) alpha: f32,
    pub(super) emission: [f32; 3],
    pub(super) cutoff: f32,
}

/// A mesh in one layout, on the device.
pub(super) struct Part {
    pub vertices: Buffer,
    pub indices: Buffer,
    /// Material, range of indices.
    runs: Vec<(u32, Range<u32>)>,
    /// Object space.
    bounds: Bounds,
    /// What it was made from stays alive, so that its address names it.
    _mesh: Arc<Mesh>,
    _layout: Option<Arc<UvLayout>>,
}

/// A draw call.
pub(super) struct Draw {
    pub part: Arc<Part>,
    pub object: u32,
    pub material: u32,
    pub indices: Range<u32>,
    pub sides: Sides,
    pub kind: Kind,
}

/// What a material needs of its shader.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Kind {
    /// Some of it is not there: comes last, when what hides it has been drawn.
    pub masked: bool,
    pub color_image: bool,
    pub emits: bool,
}

impl Kind {
    fn of(material: &Material) -> Self {
        Self {
            masked: material.alpha != AlphaMode::Opaque,
            color_image: material.base_color_texture.is_some(),
            emits: material.emission != Vec3::ZERO,
        }
    }

    /// What a look needs of it.
    pub(super) fn for_look(self, look: Look) -> Self {
        let colors = matches!(look, Look::Lit | Look::Unbaked);
        Self {
            masked: self.masked,
            color_image: self.color_image && (colors || self.masked),
            emits: self.emits && look == Look::Lit,
        }
    }

    /// As the shader's constants.
    pub(super) fn constants(self) -> [u32; 3] {
        [self.masked, self.color_image, self.emits].map(u32::from)
    }
}

/// All that is drawn of a scene.
#[derive(Default)]
pub(super) struct Geometry {
    parts: BTreeMap<(usize, usize), Arc<Part>>,
    pub draws: Vec<Draw>,
    pub placed: Vec<Placed>,
    pub surfaces: Vec<Surface>,
    /// World space, by object.
    pub bounds: Vec<Bounds>,
}

impl Geometry {
    /// Of a scene; parts that `before` has are shared. Without an atlas nothing can be lit.
    pub(super) fn new(
        gpu: &Gpu,
        scene: &Scene,
        atlas: Option<&Atlas>,
        before: Option<&Self>,
    ) -> Result<Self> {
        let mut new = Self::default();
        let mut cmd = gpu.commands()?;
        for (o, object) in (0u32..).zip(&scene.objects) {
            let mesh = &scene.meshes[object.mesh as usize];
            let place = atlas.and_then(|a| a.objects.get(o as usize));
            new.placed.push(Placed {
                origin: place.map_or([0.0; 2], |p| p.origin.as_vec2().to_array()),
                page: place.map_or(0.0, |p| p.page as f32),
                ..Placed::default().at(&object.transform)
            });
            if scene.is_gone(o) {
                new.bounds.push(Bounds::EMPTY);
                continue;
            }
            let layout = place.map(|p| &p.layout).filter(|l| !l.triangles.is_empty());
            let key = (
                Arc::as_ptr(mesh) as usize,
                layout.map_or(0, |l| Arc::as_ptr(l) as usize),
            );
            let known = before.and_then(|b| b.parts.get(&key));
            let part = match new.parts.get(&key).or(known) {
                Some(part) => Arc::clone(part),
                None => Arc::new(Part::new(gpu, &mut cmd, scene, mesh, layout)?),
            };
            new.bounds.push(moved(&part.bounds, &object.transform));
            for (material, indices) in &part.runs {
                let sides = match scene.materials[*material as usize].double_sided {
                    true => Sides::Both,
                    false if scene.mirrored(o) => Sides::Back,
                    false => Sides::Front,
                };
                new.draws.push(Draw {
                    sides,
                    kind: Kind::of(&scene.materials[*material as usize]),
                    part: Arc::clone(&part),
                    object: o,
                    material: *material,
                    indices: indices.clone(),
                });
            }
            new.parts.insert(key, part);
        }
        cmd.barrier(Stage::Transfer, Stage::All);
        let _in_order = cmd.submit()?;
        new.surfaces = scene
            .materials
            .iter()
            .map(|m| Surface {
                color: m.base_color.truncate().to_array(),
                alpha: m.base_color.w,
                emission: m.emission.to_array(),
                cutoff: match m.alpha {
                    AlphaMode::Opaque => 0.0,
                    AlphaMode::Mask { cutoff } => cutoff,
                },
            })
            .collect();
        Ok(new)
    }

    /// The box around an object that is there, in its own space.
    pub(super) fn own_bounds(&self, object: u32) -> Option<Bounds> {
        let draw = self.draws.iter().find(|d| d.object == object)?;
        Some(draw.part.bounds)
    }

    /// What may be seen, the nearest first, so that little is shaded in vain; what can be seen through comes last.
    pub(super) fn seen(&self, eye: Vec3, clip: &Mat4) -> Vec<&Draw> {
        let away = |b: &Bounds| (eye - eye.clamp(b.min, b.max)).length_squared();
        let mut seen: Vec<(bool, f32, &Draw)> = self
            .draws
            .iter()
            .filter(|draw| self.sees(draw.object, clip))
            .map(|draw| {
                let bounds = &self.bounds[draw.object as usize];
                (draw.kind.masked, away(bounds), draw)
            })
            .collect();
        seen.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        seen.into_iter().map(|(.., draw)| draw).collect()
    }

    /// Whether any of an object may be seen.
    fn sees(&self, object: u32, clip: &Mat4) -> bool {
        let b = &self.bounds[object as usize];
        let corners = (0..8).map(|i| {
            let pick = |axis: usize| {
                if i >> axis & 1 == 0 {
                    b.min[axis]
                } else {
                    b.max[axis]
                }
            };
            *clip * Vec3::new(pick(0), pick(1), pick(2)).extend(1.0)
        });
        // Outside of one plane with all corners: not seen. (Infinitely far is not too far.)
        let mut outside = [true; 5];
        for c in corners {
            let inside = [c.x > -c.w, c.x < c.w, c.y > -c.w, c.y < c.w, c.z < c.w];
            for (outside, inside) in outside.iter_mut().zip(inside) {
                *outside &= !inside;
            }
        }
        !outside.contains(&true)
    }
}

impl Placed {
    fn at(self, transform: &Affine3A) -> Self {
        Self {
            columns: transform.to_cols_array_2d(),
            ..self
        }
    }
}

impl Part {
    fn new(
        gpu: &Gpu,
        cmd: &mut Commands,
        scene: &Scene,
        mesh: &Arc<Mesh>,
        layout: Option<&Arc<UvLayout>>,
    ) -> Result<Self> {
        let normals = normals(mesh);
        let uvs: Vec<[[f32; 2]; 2]> = uvs(scene, mesh);
        let vertex = |source: usize, light: Vec2| Vertex {
            position: mesh.positions[source].to_array(),
            normal: normals[source].to_array(),
            color_uv: uvs[source][0],
            emission_uv: uvs[source][1],
            light_uv: light.to_array(),
        };
        let (vertices, triangles): (Vec<Vertex>, &[[u32; 3]]) = match layout {
            Some(layout) => (
                layout
                    .vertices
                    .iter()
                    .map(|v| vertex(v.source as usize, v.uv))
                    .collect(),
                &layout.triangles,
            ),
            None => (
                (0..mesh.positions.len())
                    .map(|i| vertex(i, Vec2::ZERO))
                    .collect(),
                &mesh.triangles,
            ),
        };
        let name = &mesh.name;
        let mut upload = |what: &str, bytes: &[u8]| -> Result<Buffer> {
            let size = bytes.len() as u64;
            let buffer = gpu.buffer(&format!("{what} of {name}"), size, Memory::Device)?;
            cmd.upload(&buffer, 0, bytes)?;
            Ok(buffer)
        };
        Ok(Self {
            vertices: upload("vertices", bytemuck::cast_slice(&vertices))?,
            indices: upload("indices", bytemuck::cast_slice(triangles.as_flattened()))?,
            runs: mesh
                .primitives
                .iter()
                .filter(|p| !p.triangles.is_empty())
                .map(|p| (p.material, p.triangles.start * 3..p.triangles.end * 3))
                .collect(),
            bounds: mesh.positions.iter().fold(Bounds::EMPTY, |b, p| b.with(*p)),
            _mesh: Arc::clone(mesh),
            _layout: layout.cloned(),
        })
    }
}

/// Vertex normals; where the file gives none, those of the triangles around.
fn normals(mesh: &Mesh) -> Vec<Vec3> {
    let mut normals = mesh.normals.clone();
    normals.resize(mesh.positions.len(), Vec3::ZERO);
    let missing: Vec<bool> = normals.iter().map(|n| *n == Vec3::ZERO).collect();
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        let face = (b - a).cross(c - a);
        for v in t.map(|v| v as usize).into_iter().filter(|v| missing[*v]) {
            normals[v] += face;
        }
    }
    normals
        .iter()
        .map(|n| n.try_normalize().unwrap_or(Vec3::Y))
        .collect()
}

/// By vertex, where its material's colour and emission are looked up.
fn uvs(scene: &Scene, mesh: &Mesh) -> Vec<[[f32; 2]; 2]> {
    let mut uvs = vec![[[0.0; 2]; 2]; mesh.positions.len()];
    for primitive in &mesh.primitives {
        let material = &scene.materials[primitive.material as usize];
        let look_up = |texture: &Option<TextureRef>, vertex: usize| {
            let Some(texture) = texture else {
                return [0.0; 2];
            };
            let set = &mesh.texcoords[texture.texcoord as usize];
            let uv = set.get(vertex).copied().unwrap_or_default();
            texture.transform.transform_point2(uv).to_array()
        };
        let range = primitive.vertices.start as usize..primitive.vertices.end as usize;
        for (v, uv) in range.clone().zip(&mut uvs[range]) {
            *uv = [
                look_up(&material.base_color_texture, v),
                look_up(&material.emission_texture, v),
            ];
        }
    }
    uvs
}

/// A box around a box that is moved.
fn moved(bounds: &Bounds, transform: &Affine3A) -> Bounds {
    (0..8).fold(Bounds::EMPTY, |all, i| {
        let pick = |axis: usize| {
            if i >> axis & 1 == 0 {
                bounds.min[axis]
            } else {
                bounds.max[axis]
            }
        };
        all.with(transform.transform_point3(Vec3::new(pick(0), pick(1), pick(2))))
    })
}

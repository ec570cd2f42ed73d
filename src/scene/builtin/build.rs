//! Assembles a glTF document in memory: the pencil that the built-in scenes are drawn with.

use std::{io::Cursor, sync::Arc};

use glam::{Mat3, Quat, Vec3};
use serde_json::{Value, json};

use super::{
    super::{
        document::{Document, EncodedImage, ImageData},
        json::push,
        lights::push_light,
    },
    shape::Shape,
    turning::{cos, sin},
};

/// A document under construction.
pub(super) struct Builder {
    document: Document,
    bin: Vec<u8>,
}

/// A light's colour and strength: candela or lux.
#[derive(Clone, Copy)]
pub(super) struct Glow {
    /// Linear RGB, the largest 1.
    pub color: [f32; 3],
    /// Candela (point, spot) or lux (directional).
    pub intensity: f32,
}

impl Builder {
    /// A document with an empty scene of the given name.
    pub fn new(name: &str) -> Self {
        let json = json!({
            "asset": { "version": "2.0", "generator": "rebake" },
            "scene": 0,
            "scenes": [{ "name": name, "nodes": [] }],
        });
        Self {
            document: Document {
                json,
                ..Document::default()
            },
            bin: Vec::new(),
        }
    }

    /// A diffuse material of linear RGB albedo.
    pub fn material(&mut self, name: &str, albedo: [f32; 3]) -> usize {
        let material = json!({
            "name": name,
            "pbrMetallicRoughness": { "baseColorFactor": exact(&[albedo[0], albedo[1], albedo[2], 1.0]), "metallicFactor": 0.0 },
        });
        push(&mut self.document.json, "materials", material)
    }

    /// A diffuse material that emits `color` times `strength` cd/m², linear RGB, the largest of `color` being at most 1.
    pub fn emitter(
        &mut self,
        name: &str,
        albedo: [f32; 3],
        color: [f32; 3],
        strength: f32,
    ) -> usize {
        self.document
            .use_extension("KHR_materials_emissive_strength");
        let material = self.material(name, albedo);
        let element = &mut self.document.json["materials"][material];
        element["emissiveFactor"] = exact(&color);
        element["extensions"] = json!({ "KHR_materials_emissive_strength": { "emissiveStrength": shortest(strength) } });
        material
    }

    /// A diffuse material whose albedo is a repeating image of `size` x `size` texels, sRGB; `texel` makes it.
    pub fn textured(
        &mut self,
        name: &str,
        size: u32,
        texel: impl Fn(u32, u32) -> [u8; 3],
    ) -> usize {
        let image = image::RgbImage::from_fn(size, size, |x, y| image::Rgb(texel(x, y)));
        let mut png = Cursor::new(Vec::new());
        // Writing to memory cannot fail; without its image the material would be white.
        let material = self.material(name, [1.0; 3]);
        if image.write_to(&mut png, image::ImageFormat::Png).is_ok() {
            let json = &mut self.document.json;
            let image = push(
                json,
                "images",
                json!({ "name": name, "mimeType": "image/png" }),
            );
            let texture = push(json, "textures", json!({ "source": image }));
            json["materials"][material]["pbrMetallicRoughness"]["baseColorTexture"] =
                json!({ "index": texture });
            let data = ImageData::Bytes(Arc::new(png.into_inner()));
            self.document.images.push(EncodedImage {
                mime: "image/png".into(),
                data,
            });
        }
        material
    }

    /// Makes a material show and reflect on both sides.
    pub fn both_sides(&mut self, material: usize) {
        self.document.json["materials"][material]["doubleSided"] = true.into();
    }

    /// Adds a mesh with one primitive per shape and material. Empty shapes are left out.
    pub fn mesh(&mut self, name: &str, parts: &[(&Shape, usize)]) -> usize {
        let mut primitives = Vec::new();
        for (shape, material) in parts
            .iter()
            .filter(|(shape, _)| !shape.triangles.is_empty())
        {
            let [min, max] = shape.extent();
            let positions = self.accessor(
                shape
                    .positions
                    .iter()
                    .flat_map(|p| p.to_array())
                    .map(f32::to_le_bytes),
                shape.positions.len(),
                "VEC3",
                5126,
            );
            let accessor = &mut self.document.json["accessors"][positions];
            accessor["min"] = exact(&min.to_array());
            accessor["max"] = exact(&max.to_array());
            let normals = self.accessor(
                shape
                    .normals
                    .iter()
                    .flat_map(|n| n.to_array())
                    .map(f32::to_le_bytes),
                shape.normals.len(),
                "VEC3",
                5126,
            );
            let mut attributes = json!({ "POSITION": positions, "NORMAL": normals });
            if !shape.uvs.is_empty() {
                attributes["TEXCOORD_0"] = self
                    .accessor(
                        shape
                            .uvs
                            .iter()
                            .flat_map(|uv| uv.to_array())
                            .map(f32::to_le_bytes),
                        shape.uvs.len(),
                        "VEC2",
                        5126,
                    )
                    .into();
            }
            let indices = shape.triangles.iter().flatten();
            let count = shape.triangles.len() * 3;
            let indices = if shape.positions.len() <= usize::from(u16::MAX) {
                self.accessor(
                    indices.map(|i| (*i as u16).to_le_bytes()),
                    count,
                    "SCALAR",
                    5123,
                )
            } else {
                self.accessor(indices.map(|i| i.to_le_bytes()), count, "SCALAR", 5125)
            };
            primitives.push(
                json!({ "attributes": attributes, "indices": indices, "material": material }),
            );
        }
        push(
            &mut self.document.json,
            "meshes",
            json!({ "name": name, "primitives": primitives }),
        )
    }

    fn accessor<const N: usize>(
        &mut self,
        data: impl Iterator<Item = [u8; N]>,
        count: usize,
        kind: &str,
        component: u32,
    ) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let start = self.bin.len();
        self.bin.extend(data.flatten());
        let target = if kind == "SCALAR" { 34963 } else { 34962 };
        let view = json!({ "buffer": 0, "byteOffset": start, "byteLength": self.bin.len() - start, "target": target });
        let view = push(&mut self.document.json, "bufferViews", view);
        let accessor =
            json!({ "bufferView": view, "componentType": component, "count": count, "type": kind });
        push(&mut self.document.json, "accessors", accessor)
    }

    /// Places a mesh; returns the node.
    pub fn place(
        &mut self,
        name: &str,
        mesh: usize,
        at: Vec3,
        rotation: Quat,
        scale: Vec3,
    ) -> usize {
        let mut node = json!({ "name": name, "mesh": mesh });
        if at != Vec3::ZERO {
            node["translation"] = exact(&at.to_array());
        }
        if rotation != Quat::IDENTITY {
            node["rotation"] = exact(&rotation.to_array());
        }
        if scale != Vec3::ONE {
            node["scale"] = exact(&scale.to_array());
        }
        self.document.push_root(node)
    }

    /// Adds a mesh of one shape where it was drawn.
    pub fn object(&mut self, name: &str, shape: &Shape, material: usize) {
        let mesh = self.mesh(name, &[(shape, material)]);
        self.place(name, mesh, Vec3::ZERO, Quat::IDENTITY, Vec3::ONE);
    }

    /// Adds a point light.
    pub fn point(&mut self, name: &str, at: Vec3, glow: Glow) {
        let light = json!({ "type": "point", "name": name, "color": exact(&glow.color), "intensity": shortest(glow.intensity) });
        push_light(
            &mut self.document,
            light,
            json!({ "name": name, "translation": exact(&at.to_array()) }),
        );
    }

    /// Adds a spot light that aims from `at` to `target`, with half angles in radians, in a fixture (a mesh that points along -Z).
    pub fn spot(
        &mut self,
        name: &str,
        [at, target]: [Vec3; 2],
        glow: Glow,
        [inner, outer]: [f32; 2],
        fixture: Option<usize>,
    ) {
        let light = json!({
            "type": "spot", "name": name, "color": exact(&glow.color), "intensity": shortest(glow.intensity),
            "spot": { "innerConeAngle": shortest(inner), "outerConeAngle": shortest(outer) },
        });
        let mut node = json!({
            "name": name, "translation": exact(&at.to_array()), "rotation": exact(&aim(target - at).to_array()),
        });
        if let Some(mesh) = fixture {
            node["mesh"] = mesh.into();
        }
        push_light(&mut self.document, light, node);
    }

    /// Adds a sun that shines along a direction.
    pub fn sun(&mut self, name: &str, direction: Vec3, glow: Glow) {
        let light = json!({ "type": "directional", "name": name, "color": exact(&glow.color), "intensity": shortest(glow.intensity) });
        push_light(
            &mut self.document,
            light,
            json!({ "name": name, "rotation": exact(&aim(direction).to_array()) }),
        );
    }

    /// Adds a camera that looks from `eye` at `target`; the vertical field of view is in radians.
    pub fn camera(&mut self, name: &str, eye: Vec3, target: Vec3, fov_y: f32) {
        let camera = json!({ "type": "perspective", "name": name, "perspective": { "yfov": shortest(fov_y), "znear": 0.05 } });
        let camera = push(&mut self.document.json, "cameras", camera);
        let node = json!({
            "name": name, "camera": camera, "translation": exact(&eye.to_array()), "rotation": exact(&aim(target - eye).to_array()),
        });
        self.document.push_root(node);
    }

    /// The finished document.
    pub fn finish(mut self) -> Document {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        if !self.bin.is_empty() {
            self.document.json["buffers"] = json!([{ "byteLength": self.bin.len() }]);
            self.document.buffers.push(Arc::new(self.bin));
        }
        self.document
    }
}

/// The rotation that turns -Z to `direction`, with Y as far up as it goes.
pub(super) fn aim(direction: Vec3) -> Quat {
    let back = -direction.normalize();
    let right = match Vec3::Y.cross(back).normalize_or_zero() {
        Vec3::ZERO => Vec3::X,
        right => right,
    };
    Quat::from_mat3(&Mat3::from_cols(right, back.cross(right), back))
}

/// Numbers as text that is short and still reads back to the same single-precision values.
fn exact(numbers: &[f32]) -> Value {
    numbers.iter().map(|n| shortest(*n)).collect()
}

fn shortest(number: f32) -> Value {
    // The shortest decimal of the f32 is a f64 that rounds to it again.
    let decimal: f64 = number.to_string().parse().unwrap_or(f64::from(number));
    json!(decimal)
}

/// A rotation around Y, in degrees.
pub(super) fn turned(degrees: f32) -> Quat {
    let half = degrees.to_radians() / 2.0;
    Quat::from_xyzw(0.0, sin(half), 0.0, cos(half))
}

/// A repeatable number between 0 and 1 for a place in a list (PCG output permutation, Jarzynski and Olano 2020).
pub(super) fn chance(list: u32, item: u32) -> f32 {
    let state = (item.wrapping_mul(0x9E37_79B9) ^ list.wrapping_mul(0x85EB_CA6B))
        .wrapping_mul(747_796_405)
        .wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    ((word >> 22) ^ word) as f32 / u32::MAX as f32
}

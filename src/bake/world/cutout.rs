//! Where triangles of masked materials let light pass: one bit a texel, and which triangles need to ask for it.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use glam::Vec2;

use crate::bake::device::pool::Pool;
use crate::bake::device::records::Cutout;
use crate::scene::{AlphaMode, Scene, Texture, Wrap};

/// The alpha masks of materials, as bits: set where light is stopped. Rows start at whole words.
#[derive(Default)]
pub(super) struct Masks {
    pub(super) bits: Vec<u32>,
    words: Pool,
    /// First word, by material of the scene last learned; none where it was not asked for or has no mask.
    first: Vec<Option<u32>>,
    made: Vec<Mask>,
}

struct Mask {
    texture: Arc<Texture>,
    /// Alpha factor and cutoff.
    alpha: [u32; 2],
    words: Range<u32>,
    /// Instances that ask for it.
    users: BTreeSet<u32>,
}

/// What a triangle's alpha leaves of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Coverage {
    Whole,
    Nothing,
    Part(Cutout),
}

impl Masks {
    /// Makes the masks that the materials of objects need, each in an instance, and that are not there yet: returns where their
    /// bits are.
    pub(super) fn learn(
        &mut self,
        scene: &Scene,
        objects: &[u32],
        instances: &[u32],
    ) -> Vec<Range<u32>> {
        let mut new = Vec::new();
        let mut masks = BTreeMap::new();
        self.first = vec![None; scene.materials.len()];
        for (&object, &instance) in objects.iter().zip(instances) {
            for primitive in &scene.mesh(object).primitives {
                let material = primitive.material;
                let mask = *masks
                    .entry(material)
                    .or_insert_with(|| self.mask(scene, material, &mut new));
                if let Some(mask) = mask.map(|mask: usize| &mut self.made[mask]) {
                    mask.users.insert(instance);
                    self.first[material as usize] = Some(mask.words.start);
                }
            }
        }
        new
    }

    /// Instances are no more: masks that no other one asks for make room.
    pub(super) fn forget(&mut self, instances: &[u32]) {
        for mask in &mut self.made {
            for instance in instances {
                mask.users.remove(instance);
            }
        }
        for mask in self.made.extract_if(.., |mask| mask.users.is_empty()) {
            self.words.give(mask.words);
        }
    }

    /// A material's mask, if it has one.
    fn mask(&mut self, scene: &Scene, material: u32, new: &mut Vec<Range<u32>>) -> Option<usize> {
        let material = &scene.materials[material as usize];
        let AlphaMode::Mask { cutoff } = material.alpha else {
            return None;
        };
        let texture = &scene.textures[material.base_color_texture.as_ref()?.texture as usize];
        if texture.texels.is_empty() {
            return None;
        }
        let alpha = [material.base_color.w.to_bits(), cutoff.to_bits()];
        let same = |mask: &Mask| Arc::ptr_eq(&mask.texture, texture) && mask.alpha == alpha;
        if let Some(mask) = self.made.iter().position(same) {
            return Some(mask);
        }
        let stops = |t: &[u8; 4]| material.base_color.w * (f32::from(t[3]) / 255.0) >= cutoff;
        let rows = texture.texels.chunks(texture.width as usize);
        let bits: Vec<u32> = rows
            .flat_map(|row| row.chunks(32))
            .map(|word| {
                (0..)
                    .zip(word)
                    .fold(0, |bits, (i, t)| bits | u32::from(stops(t)) << i)
            })
            .collect();
        let words = self.words.take(bits.len() as u32);
        let end = self.bits.len().max(words.end as usize);
        self.bits.resize(end, 0);
        self.bits[words.start as usize..words.end as usize].copy_from_slice(&bits);
        new.push(words.clone());
        self.made.push(Mask {
            texture: texture.clone(),
            alpha,
            words,
            users: BTreeSet::new(),
        });
        Some(self.made.len() - 1)
    }

    /// What is left of an object's triangle; corners in the order of [`Scene::world_triangle`].
    pub(super) fn coverage(&self, scene: &Scene, object: u32, triangle: u32) -> Coverage {
        let mesh = scene.mesh(object);
        let material = mesh.primitive_of(triangle).material as usize;
        let AlphaMode::Mask { cutoff } = scene.materials[material].alpha else {
            return Coverage::Whole;
        };
        let untextured = if scene.materials[material].base_color.w < cutoff {
            Coverage::Nothing
        } else {
            Coverage::Whole
        };
        let (Some(first), Some(reference)) = (
            self.first[material],
            &scene.materials[material].base_color_texture,
        ) else {
            return untextured;
        };
        let texture = &scene.textures[reference.texture as usize];
        let set = &mesh.texcoords[reference.texcoord as usize];
        let mut uv = mesh.triangles[triangle as usize].map(|v| {
            let uv = set.get(v as usize).copied().unwrap_or(Vec2::ZERO);
            reference.transform.transform_point2(uv)
        });
        if uv.iter().any(|uv| !uv.is_finite()) {
            return untextured;
        }
        if scene.mirrored(object) {
            uv.swap(1, 2);
        }
        let size = [texture.width, texture.height];
        let range = [0, 1].map(|axis| {
            let low = uv[0][axis].min(uv[1][axis]).min(uv[2][axis]);
            let high = uv[0][axis].max(uv[1][axis]).max(uv[2][axis]);
            // Whole periods are taken off, so that the shader's interpolation keeps its digits.
            let shift = match reference.wrap[axis] {
                Wrap::Repeat => low.floor(),
                Wrap::Mirror => 2.0 * (0.5 * low).floor(),
                Wrap::Clamp => 0.0,
            };
            for uv in &mut uv {
                uv[axis] -= shift;
            }
            // Every texel that bilinear filtering between the corners can fetch.
            let first = ((low - shift) * size[axis] as f32 - 1.0).floor();
            let last = ((high - shift) * size[axis] as f32 + 1.0).ceil();
            let inside = first >= 0.0 && last < size[axis] as f32;
            if inside || reference.wrap[axis] == Wrap::Clamp {
                let clamp = |texel: f32| (texel.max(0.0) as u32).min(size[axis] - 1);
                clamp(first)..=clamp(last)
            } else {
                0..=size[axis] - 1
            }
        });
        let row_words = size[0].div_ceil(32);
        let (mut stops, mut passes) = (false, false);
        'scan: for y in range[1].clone() {
            for x in range[0].clone() {
                let word = self.bits[(first + y * row_words + x / 32) as usize];
                let stop = word >> (x % 32) & 1 == 1;
                stops |= stop;
                passes |= !stop;
                if stops && passes {
                    break 'scan;
                }
            }
        }
        match (stops, passes) {
            (true, false) => Coverage::Whole,
            (false, _) => Coverage::Nothing,
            (true, true) => Coverage::Part(Cutout {
                uv: uv.map(|uv| uv.to_array()),
                first,
                size,
                wrap: wrap_code(reference.wrap[0]) | wrap_code(reference.wrap[1]) << 2,
            }),
        }
    }
}

fn wrap_code(wrap: Wrap) -> u32 {
    match wrap {
        Wrap::Repeat => crate::bake::device::shared::WRAP_REPEAT,
        Wrap::Mirror => crate::bake::device::shared::WRAP_MIRROR,
        Wrap::Clamp => crate::bake::device::shared::WRAP_CLAMP,
    }
}

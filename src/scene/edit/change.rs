//! What is different between two versions of a scene.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::Affine3A;
use rayon::prelude::*;

use super::super::{AlphaMode, Aperture, Bounds, Light, Material, Scene, TextureRef};

/// What became different, for those who keep something per object, surface or light. Found by comparing what the versions
/// are, never by how one became the other. All lists are ascending.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Change {
    /// Objects that moved, appeared, vanished, or stop light elsewhere than before (by their alpha): occluders and receivers
    /// differ. An index may be beyond the objects of one version: undoing an addition takes the last objects away.
    pub objects: Vec<u32>,
    /// Other objects with a material that reflects differently.
    pub surfaces: Vec<u32>,
    /// [`Light::id`]s of lights that differ in any way, appeared or vanished.
    pub lights: Vec<u32>,
    /// Whether [`Scene::bounds`] differ. Directional lights start there: then all of them are in `lights`.
    pub bounds_changed: bool,
}

impl Change {
    /// From `old` to `new`, two versions of one session.
    pub fn between(old: &Scene, new: &Scene) -> Self {
        let count = old.objects.len().max(new.objects.len()) as u32;
        let materials = Materials::compare(old, new);
        let mut change = Self::default();
        let mut surface = BTreeMap::new();
        for object in 0..count {
            let differs = match (present(old, object), present(new, object)) {
                (false, false) => continue,
                (true, true) => {
                    moved(old, new, object) || any(new, object, &materials, |m| m.passes)
                }
                _ => true,
            };
            if differs {
                change.objects.push(object);
            } else if any(new, object, &materials, |m| m.reflects) {
                change.surfaces.push(object);
            }
            let emits = differs || any(new, object, &materials, |m| m.emits);
            surface.insert(object, emits);
        }
        change.bounds_changed = change.moves_bounds(old, new);
        let by_id = |scene: &'_ Scene| -> BTreeMap<u32, usize> {
            let lights = scene.lights.iter().enumerate();
            lights.map(|(i, light)| (light.id(), i)).collect()
        };
        let (before, after) = (by_id(old), by_id(new));
        let mut ids: Vec<u32> = before.keys().chain(after.keys()).copied().collect();
        ids.sort_unstable();
        ids.dedup();
        ids.retain(|id| match (before.get(id), after.get(id)) {
            (Some(&a), Some(&b)) => {
                let (a, b) = (&old.lights[a], &new.lights[b]);
                let aperture = match b.aperture {
                    Aperture::Surface { object } => surface.get(&object) == Some(&true),
                    Aperture::Directional => change.bounds_changed,
                    _ => false,
                };
                aperture || !same_light(a, b)
            }
            _ => true,
        });
        change.lights = ids;
        change
    }

    /// Whether the scene's bounds differ, which only `objects` can bring about.
    fn moves_bounds(&self, old: &Scene, new: &Scene) -> bool {
        let all = |scene: &Scene| {
            let objects = self.objects.iter().filter(|o| present(scene, **o));
            objects.fold(Bounds::EMPTY, |all, o| all.union(&scene.object_bounds(*o)))
        };
        let (before, after) = (all(old), all(new));
        // What stayed is the same in both: it is looked at once, and only if there is a need.
        before != after && {
            let stayed = (0..new.objects.len() as u32)
                .into_par_iter()
                .filter(|o| self.objects.binary_search(o).is_err())
                .map(|o| new.object_bounds(o))
                .reduce(|| Bounds::EMPTY, |a, b| a.union(&b));
            stayed.union(&before) != stayed.union(&after)
        }
    }

    /// Whether nothing differs.
    pub fn is_empty(&self) -> bool {
        self.objects.is_empty() && self.surfaces.is_empty() && self.lights.is_empty()
    }

    /// World bounds of each of [`Self::objects`], before and after, where it was there: what light may meet differently.
    pub fn boxes(&self, old: &Scene, new: &Scene) -> Vec<Bounds> {
        self.objects
            .iter()
            .flat_map(|object| [(old, *object), (new, *object)])
            .filter(|(scene, object)| present(scene, *object))
            .map(|(scene, object)| scene.object_bounds(object))
            .collect()
    }
}

fn present(scene: &Scene, object: u32) -> bool {
    (object as usize) < scene.objects.len() && !scene.is_gone(object)
}

fn moved(old: &Scene, new: &Scene, object: u32) -> bool {
    let (a, b) = (&old.objects[object as usize], &new.objects[object as usize]);
    let (mesh, other) = (&old.meshes[a.mesh as usize], &new.meshes[b.mesh as usize]);
    a.node != b.node
        || bits(&a.transform) != bits(&b.transform)
        || !(Arc::ptr_eq(mesh, other) || mesh == other)
}

fn bits(transform: &Affine3A) -> [u32; 12] {
    transform.to_cols_array().map(f32::to_bits)
}

fn same_light(a: &Light, b: &Light) -> bool {
    a.aperture == b.aperture
        && a.intensity.to_array().map(f32::to_bits) == b.intensity.to_array().map(f32::to_bits)
        && bits(&a.transform) == bits(&b.transform)
}

/// How a material differs.
#[derive(Clone, Copy, Default)]
struct Difference {
    /// Light passes it elsewhere.
    passes: bool,
    /// It reflects something else.
    reflects: bool,
    /// It emits something else.
    emits: bool,
}

/// The differences of all materials of the new scene.
struct Materials(Vec<Difference>);

impl Materials {
    fn compare(old: &Scene, new: &Scene) -> Self {
        let textures = |a: &Option<TextureRef>, b: &Option<TextureRef>| match (a, b) {
            (None, None) => true,
            (Some(a), Some(b)) => {
                let (s, t) = (
                    &old.textures[a.texture as usize],
                    &new.textures[b.texture as usize],
                );
                // Which number a texture has does not matter.
                let renamed = TextureRef {
                    texture: b.texture,
                    ..a.clone()
                };
                renamed == *b && (Arc::ptr_eq(s, t) || s == t)
            }
            _ => false,
        };
        let difference = |a: &Material, b: &Material| {
            let base = textures(&a.base_color_texture, &b.base_color_texture);
            let masked = a.alpha != AlphaMode::Opaque || b.alpha != AlphaMode::Opaque;
            Difference {
                passes: masked && (a.alpha != b.alpha || a.base_color.w != b.base_color.w || !base),
                reflects: a.base_color.truncate() != b.base_color.truncate()
                    || !base
                    || a.double_sided != b.double_sided,
                emits: a.emission != b.emission
                    || !textures(&a.emission_texture, &b.emission_texture)
                    || a.double_sided != b.double_sided,
            }
        };
        let all = Difference {
            passes: true,
            reflects: true,
            emits: true,
        };
        let differences = new
            .materials
            .iter()
            .enumerate()
            .map(|(i, b)| old.materials.get(i).map_or(all, |a| difference(a, b)));
        Self(differences.collect())
    }
}

/// Whether any material of an object differs in some way.
fn any(
    scene: &Scene,
    object: u32,
    materials: &Materials,
    how: impl Fn(&Difference) -> bool,
) -> bool {
    scene
        .mesh(object)
        .primitives
        .iter()
        .any(|p| !p.triangles.is_empty() && how(&materials.0[p.material as usize]))
}

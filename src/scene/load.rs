//! A glTF document to a scene: what hangs on its nodes.

use std::{collections::BTreeSet, sync::Arc};

use glam::{Affine3A, Vec3};
use serde_json::Value;

use super::{
    Aperture, Light, Mesh, Object, Scene,
    assets::Assets,
    document::Document,
    error::{SceneError, invalid},
    json::{extension, index, list, name, punctual},
    materials::load_materials,
    meshes::load_meshes,
    nodes::{Placed, rigid, walk},
};

/// The extensions whose presence in `extensionsRequired` is no obstacle: they are read, or say nothing about diffuse light.
const KNOWN: [&str; 14] = [
    "EXT_texture_exr",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "MOZ_lightmap",
];
/// No surface may be farther from the origin, metres: single precision would not hold a millimetre by far.
const WORLD_LIMIT: f32 = 1e7;
/// Triangles of all instances together.
const TRIANGLE_LIMIT: u64 = 1 << 28;

/// What becomes of a node that has a mesh and shows none of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unseen {
    /// There is no object for it.
    LeftOut,
    /// Its object is there, with an empty mesh: so an object's number is the number of nodes with meshes before its own,
    /// whatever is shown and whatever is appended.
    Kept,
}

impl Scene {
    /// Reads the scene that the file shows by default. Objects and lights are in the order of their nodes.
    ///
    /// It may lack light, since some can be added afterwards: see [`Scene::validate`].
    ///
    /// # Errors
    /// Whatever in the document contradicts the specification, is not finite, or is beyond the limits; each error names its place.
    pub fn from_document(document: &Document) -> Result<Self, SceneError> {
        Self::derive(document, &mut Assets::default(), Unseen::LeftOut)
    }

    /// As [`Self::from_document`], with what was read before. What had to be read is added to `assets`.
    pub(super) fn derive(
        document: &Document,
        assets: &mut Assets,
        unseen: Unseen,
    ) -> Result<Self, SceneError> {
        let json = &document.json;
        let unknown: Vec<String> = list(json, "extensionsRequired")
            .iter()
            .filter_map(Value::as_str)
            .filter(|required| !KNOWN.contains(required))
            .map(super::error::one_line)
            .collect();
        if !unknown.is_empty() {
            return Err(SceneError::Extensions { names: unknown });
        }
        let placed = walk(json, assets.quiet)?;
        let mesh_count = list(json, "meshes").len();
        let mut used = BTreeSet::new();
        for node in &placed {
            used.extend(index(node.element, "mesh", mesh_count, &node.place())?);
        }
        let sources: Vec<usize> = used.into_iter().collect();
        let (materials, meshes) = rayon::join(
            || load_materials(document, assets),
            || load_meshes(document, &sources, list(json, "materials").len(), assets),
        );
        let (materials, images) = materials?;
        let meshes = meshes?;
        let mut scene = Scene {
            meshes: meshes
                .iter()
                .map(|(_, loaded)| loaded.mesh.clone())
                .collect(),
            materials,
            textures: images.iter().map(|(_, i)| i.texture.clone()).collect(),
            ..Scene::default()
        };
        assets.images.extend(images.iter().cloned());
        assets.meshes.extend(meshes.iter().cloned());
        let shining: Vec<bool> = scene
            .materials
            .iter()
            .map(|material| {
                let bright = |t: &super::TextureRef| images[t.texture as usize].1.bright;
                material.emission != Vec3::ZERO
                    && material.emission_texture.as_ref().is_none_or(bright)
            })
            .collect();
        scene.place(json, &placed, assets, unseen, &shining)?;
        Ok(scene)
    }

    /// Puts onto the nodes what hangs there. `shining` tells for each material whether it emits.
    fn place(
        &mut self,
        json: &Value,
        placed: &[Placed],
        assets: &Assets,
        unseen: Unseen,
        shining: &[bool],
    ) -> Result<(), SceneError> {
        let nodes = list(json, "nodes");
        let slots: Vec<usize> = self.meshes.iter().map(|m| m.source as usize).collect();
        let cameras = list(json, "cameras");
        let punctual = punctual(json);
        let mut triangles = 0;
        let mut passed = 0;
        for node in placed {
            self.keep_unseen(nodes, passed..node.node, unseen);
            passed = node.node + 1;
            let place = node.place();
            if let Some(light) = extension(node.element, "KHR_lights_punctual") {
                match index(light, "light", punctual.len(), &place)? {
                    Some(i) => self.lights.push(node.light(&punctual[i], i)?),
                    None => return Err(invalid(place, "its KHR_lights_punctual names no light")),
                }
            }
            if let Some(i) = index(node.element, "camera", cameras.len(), &place)? {
                self.cameras.extend(node.camera(&cameras[i], i)?);
            }
            let Some(mesh) = index(node.element, "mesh", usize::MAX, &place)?
                .and_then(|source| slots.binary_search(&source).ok())
            else {
                continue;
            };
            let count = self.meshes[mesh].triangles.len() as u64;
            let determinant = node.world.matrix3.determinant();
            if count == 0 || !determinant.is_normal() {
                if !assets.quiet {
                    let why = match count {
                        0 => "its mesh has no triangles",
                        _ => "it is scaled to nothing",
                    };
                    tracing::warn!("{place}: {why}, left out");
                }
                self.keep_unseen(nodes, node.node..passed, unseen);
                continue;
            }
            triangles += count;
            if let Some(loaded) = assets.meshes.get(&slots[mesh]) {
                check_extent(&place, &node.world, loaded.corners)?;
            }
            let object = self.objects.len() as u32;
            let shines = self.meshes[mesh]
                .primitives
                .iter()
                .any(|p| !p.triangles.is_empty() && shining[p.material as usize]);
            self.objects.push(Object {
                name: node.name.clone(),
                node: node.node as u32,
                mesh: mesh as u32,
                transform: node.world,
            });
            if shines {
                self.lights.push(Light {
                    name: node.name.clone(),
                    node: node.node as u32,
                    aperture: Aperture::Surface { object },
                    intensity: Vec3::ONE,
                    transform: rigid(&node.world),
                });
            }
        }
        self.keep_unseen(nodes, passed..nodes.len(), unseen);
        if triangles > TRIANGLE_LIMIT {
            let why = format!("{triangles} triangles in all instances, more than {TRIANGLE_LIMIT}");
            return Err(SceneError::TooLarge {
                place: "the scene".into(),
                why,
            });
        }
        Ok(())
    }

    /// Objects without triangles for those of some nodes that have a mesh. Their mesh comes after all others.
    fn keep_unseen(&mut self, nodes: &[Value], range: std::ops::Range<usize>, unseen: Unseen) {
        if unseen == Unseen::LeftOut {
            return;
        }
        for i in range.filter(|i| nodes[*i].get("mesh").is_some()) {
            if self.meshes.last().is_none_or(|m| m.source != u32::MAX) {
                self.meshes.push(Arc::new(Mesh {
                    name: "nothing".into(),
                    source: u32::MAX,
                    ..Mesh::default()
                }));
            }
            self.objects.push(Object {
                name: name(&nodes[i], "node", i),
                node: i as u32,
                mesh: self.meshes.len() as u32 - 1,
                transform: Affine3A::IDENTITY,
            });
        }
    }

    /// Whether there is something to light and something that lights it.
    ///
    /// # Errors
    /// [`SceneError::Empty`], [`SceneError::NoLight`].
    pub fn validate(&self) -> Result<(), SceneError> {
        if (0..self.objects.len() as u32).all(|object| self.is_gone(object)) {
            return Err(SceneError::Empty);
        }
        if self
            .lights
            .iter()
            .all(|light| light.intensity == Vec3::ZERO)
        {
            return Err(SceneError::NoLight);
        }
        Ok(())
    }
}

fn check_extent(place: &str, world: &Affine3A, [min, max]: [Vec3; 2]) -> Result<(), SceneError> {
    let center = world.transform_point3((min * 0.5) + (max * 0.5));
    let half = (max * 0.5) - (min * 0.5);
    let matrix = &world.matrix3;
    let reach = center.abs()
        + Vec3::from(
            matrix.x_axis.abs() * half.x
                + matrix.y_axis.abs() * half.y
                + matrix.z_axis.abs() * half.z,
        );
    if reach.max_element() <= WORLD_LIMIT {
        return Ok(());
    }
    Err(invalid(
        place,
        format_args!(
            "it reaches {:e} m from the origin, the limit is {WORLD_LIMIT:e} m (glTF's unit is the metre)",
            reach.max_element()
        ),
    ))
}

//! A glTF document to a scene: the node hierarchy, and what hangs on its nodes.

use std::{collections::BTreeMap, f32::consts::FRAC_PI_2, sync::Arc};

use glam::{Affine3A, Mat3A, Mat4, Quat, Vec3, Vec3A};
use serde_json::Value;

use super::{
    Aperture, Camera, Light, Mesh, Object, Scene,
    document::Document,
    error::{SceneError, invalid},
    json::{extension, index, list, name, number, numbers},
    materials::load_materials,
    meshes::load_meshes,
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

/// What a node holds, found while the hierarchy is walked.
struct Placed<'a> {
    node: usize,
    name: String,
    element: &'a Value,
    world: Affine3A,
}

impl Scene {
    /// Reads the scene that the file shows by default. Objects and lights are in the order of the node hierarchy, depth first.
    ///
    /// It may lack light, since some can be added afterwards: see [`Scene::validate`].
    ///
    /// # Errors
    /// Whatever in the document contradicts the specification, is not finite, or is beyond the limits; each error names its place.
    pub fn from_document(document: &Document) -> Result<Self, SceneError> {
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
        let placed = walk(json)?;
        let mesh_count = list(json, "meshes").len();
        let mut used = BTreeMap::new();
        for node in &placed {
            if let Some(mesh) = index(node.element, "mesh", mesh_count, &node.place())? {
                used.insert(mesh, 0u32);
            }
        }
        for (at, slot) in used.values_mut().enumerate() {
            *slot = at as u32;
        }
        let sources: Vec<usize> = used.keys().copied().collect();
        let (materials, meshes) = rayon::join(
            || load_materials(document),
            || load_meshes(document, &sources, list(json, "materials").len()),
        );
        let (materials, textures) = materials?;
        let meshes = meshes?.into_iter().map(Arc::new).collect();
        let mut scene = Scene {
            meshes,
            materials,
            textures,
            ..Scene::default()
        };
        let boxes: Vec<[Vec3; 2]> = scene.meshes.iter().map(|mesh| bounding_box(mesh)).collect();
        let shines: Vec<bool> = scene.meshes.iter().map(|mesh| scene.shines(mesh)).collect();
        let punctual =
            extension(json, "KHR_lights_punctual").map_or(&[][..], |e| list(e, "lights"));
        let mut triangles = 0;
        for node in &placed {
            let place = node.place();
            if let Some(light) = extension(node.element, "KHR_lights_punctual") {
                match index(light, "light", punctual.len(), &place)? {
                    Some(i) => scene.lights.push(node.light(&punctual[i], i)?),
                    None => return Err(invalid(place, "its KHR_lights_punctual names no light")),
                }
            }
            if let Some(i) = index(node.element, "camera", list(json, "cameras").len(), &place)? {
                scene
                    .cameras
                    .extend(node.camera(&list(json, "cameras")[i], i)?);
            }
            let Some(mesh) =
                index(node.element, "mesh", mesh_count, &place)?.map(|source| used[&source])
            else {
                continue;
            };
            let count = scene.meshes[mesh as usize].triangles.len() as u64;
            let determinant = node.world.matrix3.determinant();
            if count == 0 {
                tracing::warn!("{place}: its mesh has no triangles, left out");
            } else if !determinant.is_normal() {
                tracing::warn!("{place}: it is scaled to nothing, left out");
            } else {
                triangles += count;
                check_extent(&place, &node.world, boxes[mesh as usize])?;
                let object = scene.objects.len() as u32;
                scene.objects.push(Object {
                    name: node.name.clone(),
                    node: node.node as u32,
                    mesh,
                    transform: node.world,
                });
                if shines[mesh as usize] {
                    scene.lights.push(Light {
                        name: node.name.clone(),
                        node: node.node as u32,
                        aperture: Aperture::Surface { object },
                        intensity: Vec3::ONE,
                        transform: rigid(&node.world),
                    });
                }
            }
        }
        if triangles > TRIANGLE_LIMIT {
            let why = format!("{triangles} triangles in all instances, more than {TRIANGLE_LIMIT}");
            return Err(SceneError::TooLarge {
                place: "the scene".into(),
                why,
            });
        }
        Ok(scene)
    }

    /// Whether there is something to light and something that lights it.
    ///
    /// # Errors
    /// [`SceneError::Empty`], [`SceneError::NoLight`].
    pub fn validate(&self) -> Result<(), SceneError> {
        if self.objects.is_empty() {
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

    /// Whether any triangle of a mesh emits.
    fn shines(&self, mesh: &Mesh) -> bool {
        mesh.primitives.iter().any(|primitive| {
            let material = &self.materials[primitive.material as usize];
            let bright = |reference: &super::TextureRef| {
                self.textures[reference.texture as usize]
                    .texels
                    .iter()
                    .any(|t| t[..3] != [0; 3])
            };
            !primitive.triangles.is_empty()
                && material.emission != Vec3::ZERO
                && material.emission_texture.as_ref().is_none_or(bright)
        })
    }
}

/// All nodes of the scene that is shown, depth first, with their transforms.
fn walk(json: &Value) -> Result<Vec<Placed<'_>>, SceneError> {
    let nodes = list(json, "nodes");
    let roots = roots(json, nodes.len())?;
    let mut reached = vec![false; nodes.len()];
    let mut placed = Vec::new();
    let mut stack: Vec<(usize, Affine3A)> = roots
        .into_iter()
        .rev()
        .map(|root| (root, Affine3A::IDENTITY))
        .collect();
    while let Some((node, parent)) = stack.pop() {
        let element = &nodes[node];
        let name = name(element, "node", node);
        let place = format!("node {node} ({name})");
        if std::mem::replace(&mut reached[node], true) {
            return Err(invalid(
                place,
                "it is reached twice; glTF's nodes form a tree, without cycles",
            ));
        }
        let world = parent * local(element, &place)?;
        if !world.is_finite() {
            return Err(invalid(place, "its transform in the world is not finite"));
        }
        for child in list(element, "children").iter().rev() {
            match child.as_u64().filter(|child| *child < nodes.len() as u64) {
                Some(child) => stack.push((child as usize, world)),
                None => {
                    return Err(invalid(
                        place,
                        format_args!("it has a child that is none of the {} nodes", nodes.len()),
                    ));
                }
            }
        }
        if element.get("skin").is_some() {
            tracing::warn!("{place}: skins are not followed, it is lit in its bind pose");
        }
        placed.push(Placed {
            node,
            name,
            element,
            world,
        });
    }
    // Not in the tree's order: a node that an edit appends must not move the others.
    placed.sort_unstable_by_key(|p| p.node);
    Ok(placed)
}

/// The root nodes of the scene that is shown: `scene`, else the first, else all nodes that are nobody's child.
fn roots(json: &Value, nodes: usize) -> Result<Vec<usize>, SceneError> {
    let scenes = list(json, "scenes");
    if let Some(scene) =
        index(json, "scene", scenes.len(), &"scene")?.or((!scenes.is_empty()).then_some(0))
    {
        let root = |root: &Value| match root.as_u64().filter(|root| *root < nodes as u64) {
            Some(root) => Ok(root as usize),
            None => Err(invalid(
                format_args!("scene {scene}"),
                format_args!("a root of it is none of the {nodes} nodes"),
            )),
        };
        return list(&scenes[scene], "nodes").iter().map(root).collect();
    }
    let mut is_root = vec![true; nodes];
    for child in list(json, "nodes")
        .iter()
        .flat_map(|node| list(node, "children"))
    {
        if let Some(child) = child
            .as_u64()
            .and_then(|child| is_root.get_mut(child as usize))
        {
            *child = false;
        }
    }
    Ok((0..nodes).filter(|node| is_root[*node]).collect())
}

/// A node's own transform.
fn local(element: &Value, place: &String) -> Result<Affine3A, SceneError> {
    if let Some(matrix) = numbers::<16>(element, "matrix", place)? {
        return Ok(Affine3A::from_mat4(Mat4::from_cols_array(&matrix)));
    }
    let translation = numbers::<3>(element, "translation", place)?.unwrap_or([0.0; 3]);
    let scale = numbers::<3>(element, "scale", place)?.unwrap_or([1.0; 3]);
    let rotation =
        Quat::from_array(numbers::<4>(element, "rotation", place)?.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    let length = rotation.length();
    if !length.is_normal() {
        return Err(invalid(place, "its rotation is no unit quaternion"));
    }
    Ok(Affine3A::from_scale_rotation_translation(
        scale.into(),
        rotation / length,
        translation.into(),
    ))
}

impl Placed<'_> {
    fn place(&self) -> String {
        format!("node {} ({})", self.node, self.name)
    }

    fn light(&self, light: &Value, i: usize) -> Result<Light, SceneError> {
        let place = format!("light {i} of {}", self.place());
        let color = numbers::<3>(light, "color", &place)?
            .map_or(Vec3::ONE, Vec3::from)
            .max(Vec3::ZERO);
        let intensity = color * number(light, "intensity", &place)?.unwrap_or(1.0).max(0.0);
        if !intensity.is_finite() {
            return Err(invalid(place, "its intensity is not finite"));
        }
        let aperture = match light.get("type").and_then(Value::as_str) {
            Some("point") => Aperture::Point,
            Some("directional") => Aperture::Directional,
            Some("spot") => {
                let spot = &light["spot"];
                let outer =
                    number(spot, "outerConeAngle", &place)?.unwrap_or(std::f32::consts::FRAC_PI_4);
                let inner = number(spot, "innerConeAngle", &place)?.unwrap_or(0.0);
                if !(0.0 <= inner && inner <= outer && 0.0 < outer && outer <= FRAC_PI_2 + 1e-6) {
                    return Err(invalid(
                        place,
                        "its cone angles are not 0 <= inner <= outer <= pi/2",
                    ));
                }
                Aperture::Spot {
                    inner,
                    outer: outer.min(FRAC_PI_2),
                }
            }
            _ => {
                return Err(invalid(
                    place,
                    "its type is none of point, spot, directional",
                ));
            }
        };
        Ok(Light {
            name: self.name.clone(),
            node: self.node as u32,
            aperture,
            intensity,
            transform: rigid(&self.world),
        })
    }

    fn camera(&self, camera: &Value, i: usize) -> Result<Option<Camera>, SceneError> {
        let place = format!("camera {i} of {}", self.place());
        let Some(perspective) = camera.get("perspective") else {
            return Ok(None);
        };
        match number(perspective, "yfov", &place)? {
            Some(fov_y) if 0.0 < fov_y && fov_y < std::f32::consts::PI => Ok(Some(Camera {
                name: self.name.clone(),
                transform: rigid(&self.world),
                fov_y,
            })),
            _ => Err(invalid(place, "its yfov is not between 0 and pi")),
        }
    }
}

/// A transform without its scale, shear and mirroring, that aims along the same -Z.
pub(super) fn rigid(transform: &Affine3A) -> Affine3A {
    let direction = |axis: Vec3A| {
        let largest = axis.abs().max_element();
        if largest > 0.0 {
            (axis / largest).try_normalize()
        } else {
            None
        }
    };
    let z = direction(transform.matrix3.z_axis).unwrap_or(Vec3A::Z);
    let up = direction(transform.matrix3.y_axis).unwrap_or(Vec3A::Y);
    let x = direction(up.cross(z)).unwrap_or_else(|| z.any_orthonormal_vector());
    Affine3A {
        matrix3: Mat3A::from_cols(x, z.cross(x), z),
        translation: transform.translation,
    }
}

fn bounding_box(mesh: &Mesh) -> [Vec3; 2] {
    let empty = [Vec3::splat(f32::INFINITY), Vec3::splat(f32::NEG_INFINITY)];
    mesh.positions
        .iter()
        .fold(empty, |[min, max], p| [min.min(*p), max.max(*p)])
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

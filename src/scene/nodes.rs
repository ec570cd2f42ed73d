//! The node hierarchy: which nodes are shown, where they stand in the world, and the lights and cameras on them.

use std::f32::consts::FRAC_PI_2;

use glam::{Affine3A, Mat3A, Mat4, Quat, Vec3, Vec3A};
use serde_json::Value;

use super::{
    Aperture, Camera, Light,
    error::{SceneError, invalid},
    json::{index, list, name, number, numbers},
};

/// What a node holds, found while the hierarchy is walked.
pub(super) struct Placed<'a> {
    /// Its index.
    pub node: usize,
    /// Its name, or `node N`.
    pub name: String,
    /// Its JSON.
    pub element: &'a Value,
    /// Its space to world space.
    pub world: Affine3A,
}

/// All nodes of the scene that is shown, in their order, with their transforms. `quiet` leaves warnings out.
pub(super) fn walk(json: &Value, quiet: bool) -> Result<Vec<Placed<'_>>, SceneError> {
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
        if element.get("skin").is_some() && !quiet {
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

/// The scene that is shown, if the file has any.
pub(super) fn shown_scene(json: &Value) -> Result<Option<usize>, SceneError> {
    let scenes = list(json, "scenes").len();
    Ok(index(json, "scene", scenes, &"scene")?.or((scenes > 0).then_some(0)))
}

/// The root nodes of the scene that is shown: `scene`, else the first, else all nodes that are nobody's child.
pub(super) fn roots(json: &Value, nodes: usize) -> Result<Vec<usize>, SceneError> {
    if let Some(scene) = shown_scene(json)? {
        let root = |root: &Value| match root.as_u64().filter(|root| *root < nodes as u64) {
            Some(root) => Ok(root as usize),
            None => Err(invalid(
                format_args!("scene {scene}"),
                format_args!("a root of it is none of the {nodes} nodes"),
            )),
        };
        return list(&list(json, "scenes")[scene], "nodes")
            .iter()
            .map(root)
            .collect();
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
pub(super) fn local(element: &Value, place: &String) -> Result<Affine3A, SceneError> {
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
    pub fn place(&self) -> String {
        format!("node {} ({})", self.node, self.name)
    }

    pub fn light(&self, light: &Value, i: usize) -> Result<Light, SceneError> {
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

    pub fn camera(&self, camera: &Value, i: usize) -> Result<Option<Camera>, SceneError> {
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

//! Edits: what can be changed in a scene while it is baked, in the form of one JSON object each.
//!
//! An edit changes the glTF document, and the scene is derived from the document again: what is written in the end is what was
//! edited, and a bake of the written file sees what the session saw. [`Editor`] applies edits and takes them back;
//! [`Change`] tells what became different, by comparing.
//!
//! ```text
//! {"do": "transform", "node": "small.box", "translation": [0, 1, 0], "rotation": [0, 0, 0, 1], "scale": [1, 2, 1]}
//! {"do": "light", "node": "lamp", "intensity": 30, "color": [1, 0.9, 0.8], "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5}}
//! {"do": "material", "material": "wall", "baseColorFactor": [1, 0, 0, 1], "emissiveFactor": [0, 0, 0], "emissiveStrength": 1}
//! {"do": "add", "file": "chair.glb", "name": "chair2", "parent": "room"}
//! {"do": "copy", "node": "chair", "name": "chair3"}
//! {"do": "remove", "node": "chair"}
//! ```

mod apply;
mod change;
mod editor;
mod error;
mod insert;
mod names;
mod patch;
mod script;

use serde::{Deserialize, Deserializer, Serialize};

pub use change::Change;
pub use editor::Editor;
pub use error::EditError;
pub use names::Name;
pub use script::{Command, Until};

/// A change of a scene. Nodes and materials are the glTF file's. What is left out stays as it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    tag = "do",
    rename_all = "lowercase",
    rename_all_fields = "camelCase",
    deny_unknown_fields
)]
pub enum Edit {
    /// Moves, turns or scales a node inside its parent; its children follow. A light is moved by its node, and the aperture of
    /// an emissive object is scaled with it: its radiance stays, so its flux grows with its area. Other lights have none.
    Transform {
        /// Which node.
        node: Name,
        /// Metres.
        #[serde(default, deserialize_with = "given", skip_serializing_if = "none")]
        translation: Option<[f64; 3]>,
        /// A quaternion (x, y, z, w); its length does not matter.
        #[serde(default, deserialize_with = "given", skip_serializing_if = "none")]
        rotation: Option<[f64; 4]>,
        /// Factors along the node's axes, none of them 0; an odd number of negative ones mirrors.
        #[serde(default, deserialize_with = "given", skip_serializing_if = "none")]
        scale: Option<[f64; 3]>,
    },
    /// Changes the punctual light on a node, and on no other node, though the file may let several share one definition.
    /// An emissive object is changed by its material.
    Light {
        /// Which node.
        node: Name,
        /// Candela for points and spots, lux for directional lights; 0 switches the light off.
        #[serde(default, deserialize_with = "given", skip_serializing_if = "none")]
        intensity: Option<f64>,
        /// Linear RGB, 0 to 1.
        #[serde(default, deserialize_with = "given", skip_serializing_if = "none")]
        color: Option<[f64; 3]>,
        /// The cone of a spot.
        #[serde(default, deserialize_with = "given", skip_serializing_if = "none")]
        spot: Option<Spot>,
    },
    /// Changes a material, and with it everything that is made of it.
    Material {
        /// Which material.
        material: Name,
        /// Linear RGB and alpha, 0 to 1.
        #[serde(default, deserialize_with = "given", skip_serializing_if = "none")]
        base_color_factor: Option<[f64; 4]>,
        /// Linear RGB, 0 to 1.
        #[serde(default, deserialize_with = "given", skip_serializing_if = "none")]
        emissive_factor: Option<[f64; 3]>,
        /// cd/m² that an emissive factor of 1 stands for; not negative.
        #[serde(default, deserialize_with = "given", skip_serializing_if = "none")]
        emissive_strength: Option<f64>,
    },
    /// Adds what another glTF file shows: its nodes with their meshes, materials and lights, under a new node.
    Add {
        /// Relative to the folder that the edit came from, and inside it.
        file: String,
        /// Of the new node, not in use yet; else the file's, with a number where that is taken.
        #[serde(default, deserialize_with = "given", skip_serializing_if = "none")]
        name: Option<String>,
        /// The node that the new one hangs on; else none.
        #[serde(default, deserialize_with = "given", skip_serializing_if = "none")]
        parent: Option<Name>,
    },
    /// Adds a copy of a node and all below it, beside it and in the same place. Meshes and materials are shared.
    Copy {
        /// Which node.
        node: Name,
        /// Of the new node, not in use yet; else the old one's with a number.
        #[serde(default, deserialize_with = "given", skip_serializing_if = "none")]
        name: Option<String>,
    },
    /// Removes a node and all below it. The last object cannot be removed; the last light can, and then the map is dark.
    Remove {
        /// Which node.
        node: Name,
    },
}

/// A spot light's cone: angles from its axis, radians, 0 <= inner <= outer <= pi/2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Spot {
    /// Full intensity inside.
    #[serde(default, deserialize_with = "given", skip_serializing_if = "none")]
    pub inner_cone_angle: Option<f64>,
    /// Dark outside.
    #[serde(default, deserialize_with = "given", skip_serializing_if = "none")]
    pub outer_cone_angle: Option<f64>,
}

/// What is there must be a value: `null` is more likely a number that was none than a wish to leave something as it is.
fn given<'de, D: Deserializer<'de>, T: Deserialize<'de>>(d: D) -> Result<Option<T>, D::Error> {
    T::deserialize(d).map(Some)
}

fn none<T>(value: &Option<T>) -> bool {
    value.is_none()
}

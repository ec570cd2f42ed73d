//! What can be wrong with a scene, said in one line that names the thing and the way out.

use std::{io, path::PathBuf};

/// Why a scene could not be read, built or written. Every message is a single line.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file system refused.
    #[error("cannot read {}: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        cause: io::Error,
    },
    /// The file system refused.
    #[error("cannot write {}: {cause}; check that the folder exists, its permissions and the free space", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        cause: io::Error,
    },
    /// Neither a GLB container nor glTF JSON.
    #[error("this is no glTF 2.0 scene: {why}; give a whole .gltf or .glb file")]
    NotGltf {
        /// What is wrong with it.
        why: String,
    },
    /// A reference leaves the folder of the scene.
    #[error(
        "{place} refers to \"{uri}\", outside the scene's folder; put the file beside the scene or embed it in a .glb"
    )]
    Outside {
        /// Which buffer or image.
        place: String,
        /// What it refers to.
        uri: String,
    },
    /// A referenced file is not there.
    #[error(
        "{place} refers to \"{uri}\", which cannot be read ({why}); put the file beside the scene or embed it in a .glb"
    )]
    Missing {
        /// Which buffer or image.
        place: String,
        /// What it refers to.
        uri: String,
        /// What the system said.
        why: String,
    },
    /// The content contradicts the specification, or is not a number.
    #[error(
        "{place}: {why}; export the scene again, or ask the Khronos glTF validator what is wrong with it"
    )]
    Invalid {
        /// Which mesh, primitive, accessor, node, ...
        place: String,
        /// What is wrong with it.
        why: String,
    },
    /// An image that cannot be decoded.
    #[error("{place} cannot be decoded ({why}); convert it to PNG or JPEG")]
    Image {
        /// Which image.
        place: String,
        /// What the decoder said.
        why: String,
    },
    /// Beyond what a bake can hold.
    #[error("{place}: {why}; split or simplify the scene")]
    TooLarge {
        /// Which accessor, image, ...
        place: String,
        /// Its size and the limit.
        why: String,
    },
    /// `extensionsRequired` holds what rebake cannot read.
    #[error("the scene requires extensions that rebake does not read: {}; export it without them", names.join(", "))]
    Extensions {
        /// All of them.
        names: Vec<String>,
    },
    /// No triangle at all.
    #[error(
        "the scene has no triangles, so there is nothing to light; add a mesh to the glTF scene that is shown by default"
    )]
    Empty,
    /// Nothing shines.
    #[error(
        "the scene has no light; add one with --sun, --point or --lights FILE.gltf, or give it an emissive material or a KHR_lights_punctual light"
    )]
    NoLight,
    /// A light given by hand makes no sense.
    #[error("{what}: {why}")]
    BadLight {
        /// The light.
        what: String,
        /// What is wrong and what would be right.
        why: String,
    },
    /// Another file than the scene itself is wrong.
    #[error("{}: {cause}", path.display())]
    In {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        cause: Box<SceneError>,
    },
    /// Not the name of a built-in scene.
    #[error("there is no built-in scene \"{name}\"; the names are {}", known.join(", "))]
    UnknownBuiltin {
        /// What was asked for.
        name: String,
        /// What there is.
        known: Vec<&'static str>,
    },
}

/// A shorthand for [`SceneError::Invalid`].
pub(super) fn invalid(place: impl std::fmt::Display, why: impl std::fmt::Display) -> SceneError {
    SceneError::Invalid {
        place: place.to_string(),
        why: why.to_string(),
    }
}

/// A name or URI from a file, fit for one line of text: no control characters, at most 80 characters.
pub(super) fn one_line(text: &str) -> String {
    let mut line: String = text
        .chars()
        .take(80)
        .map(|c| if c.is_control() { '?' } else { c })
        .collect();
    if text.chars().nth(80).is_some() {
        line.push('…');
    }
    line
}

//! The viewer: pictures of the scene in the light of its map, while the map is worked on.

pub mod camera;
mod display;
mod exposure;
mod geometry;
mod headless;
mod resolve;
pub mod script;
mod shaders;
mod textures;

use std::path::PathBuf;

pub use display::{Display, Look, Shot};
pub use exposure::{Exposure, meter};
pub use headless::{Headless, HeadlessOptions};
pub use resolve::{Pages, PagesView};

use crate::bake::BakeError;
use crate::gpu::GpuError;

/// Why the viewer stops.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// The device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The bake, or an edit of a script.
    #[error(transparent)]
    Bake(#[from] BakeError),
    /// A line of a script.
    #[error("line {line}")]
    Line {
        /// From 1.
        line: usize,
        /// Why.
        #[source]
        cause: Box<ViewError>,
    },
    /// A camera that a script names.
    #[error("there is no camera \"{name}\" in the file; {}", match there.as_slice() {
        [] => "it has none: give a \"position\" and a \"target\"".to_owned(),
        there => format!("it has {}", there.join(", ")),
    })]
    NoCamera {
        /// As asked for.
        name: String,
        /// Those that are there.
        there: Vec<String>,
    },
    /// A file.
    #[error("cannot write {}", path.display())]
    Write {
        /// Which.
        path: PathBuf,
        /// Why.
        #[source]
        cause: std::io::Error,
    },
}

//! The viewer: pictures of the scene in the light of its map, while the map is worked on.

mod app;
pub mod camera;
mod caption;
mod display;
mod exposure;
mod frames;
mod geometry;
mod gizmo;
mod headless;
pub mod input;
mod legend;
mod look;
mod marker;
mod metering;
mod overlays;
mod pace;
mod paging;
mod painter;
mod panels;
mod pick;
mod picture_file;
mod place;
pub mod reference;
mod resolve;
pub mod script;
mod session;
mod shaders;
mod shot;
mod shown;
mod state;
mod textures;
mod units;
mod worker;

use std::path::PathBuf;

pub use crate::scene::Source;
pub use app::{WindowOptions, run_window};
pub use display::Display;
pub use exposure::{Exposure, meter};
pub use headless::{Headless, HeadlessOptions, MemoryUse};
pub use look::{Look, Overlay};
pub use overlays::{Overlays, Sketch};
pub use place::{Handle, Place};
pub use reference::Reference;
pub use resolve::{Pages, PagesView};
pub use shot::{PageShot, Shot};
pub use shown::Shown;
pub use state::{Files, Outcome, Viewer};
pub use textures::Samplers;
pub use worker::{News, Request, Setup, Status, Worker};

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
    /// The window system.
    #[error(
        "no window can be opened: {0}; with --headless --script WALK.jsonl --frames-dir DIR the viewer needs none"
    )]
    Window(String),
    /// The scene's file.
    #[error(transparent)]
    Scene(#[from] crate::scene::SceneError),
    /// The bake's thread has ended.
    #[error("the bake has ended: {0}")]
    Ended(String),
    /// A line of a script.
    #[error("line {line}")]
    Line {
        /// From 1.
        line: usize,
        /// Why.
        #[source]
        cause: Box<ViewError>,
    },
    /// A reference that cannot be read.
    #[error(transparent)]
    Compare(#[from] crate::lightmap::compare::CompareError),
    /// A reference for other texels.
    #[error(
        "the reference {} has other pages ({is}) than this bake ({should}): open the scene.glb beside the reference's pages",
        path.display()
    )]
    Reference {
        /// The reference.
        path: PathBuf,
        /// Its pages.
        is: String,
        /// Those of the bake.
        should: String,
    },
    /// A reference's bake.json.
    #[error("{} is not a bake.json that this version wrote: {why}", path.display())]
    Recorded {
        /// The file.
        path: PathBuf,
        /// Why.
        why: String,
    },
    /// A page that there is none of.
    #[error("there is no page {page}: there are {pages}, counted from 0")]
    NoPage {
        /// As asked for.
        page: u32,
        /// How many there are.
        pages: u32,
    },
    /// A picture of the error without a reference.
    #[error("there is nothing to compare with: give --reference DIR")]
    NoReference,
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

/// A line for the person at the window.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// What to read.
    pub text: String,
    /// Something was refused or has gone wrong.
    pub failed: bool,
}

impl Note {
    /// News.
    pub fn said(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            failed: false,
        }
    }

    /// Bad news.
    pub fn failed(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            failed: true,
        }
    }
}

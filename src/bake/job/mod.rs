//! What is asked of a bake, and what it tells: the job and the settings that it comes to, how far it is, what it did, and why
//! it failed.

pub(super) mod progress;
pub(super) mod report;
pub(super) mod settings;

use std::time::Duration;

use crate::gpu::GpuError;
use crate::lightmap::{AtlasOptions, LightmapError};
use crate::scene::SceneError;
use crate::scene::edit::EditError;
use report::AtlasReport;
use settings::{Options, Settings};

/// What to bake and how.
#[derive(Clone, Debug)]
pub struct Job {
    /// How fine the lightmap is; ignored by [`Job::repeat`], which knows.
    pub atlas: AtlasOptions,
    /// What the settings are resolved from, unless `repeat` has them.
    pub options: Options,
    /// The settings and the atlas of an earlier bake, for the scene that it wrote.
    pub repeat: Option<(Settings, AtlasReport)>,
    /// Stop refining in time to end after this long.
    pub budget: Option<Duration>,
    /// Afterwards subtract every second light, add it again, and compare every bit.
    pub verify: bool,
    /// Bytes of the device's memory in which depth maps of lights are kept, so that edits need not draw them again; 0 keeps
    /// none. It takes as much as there are lights: 0.2 MiB each at the default quality, and 3 to 6 MiB for a direct
    /// one, which all of them take half of it for at most. No bit of the lightmap depends on it.
    pub kept_maps: u64,
}

impl Default for Job {
    fn default() -> Self {
        Self {
            atlas: AtlasOptions::default(),
            options: Options::default(),
            repeat: None,
            budget: None,
            verify: false,
            kept_maps: KEPT_MAPS,
        }
    }
}

/// What [`Job::kept_maps`] is if nobody says otherwise: 1 GiB.
pub const KEPT_MAPS: u64 = 1 << 30;

/// Why a bake failed.
#[derive(Debug, thiserror::Error)]
pub enum BakeError {
    /// The device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The atlas.
    #[error(transparent)]
    Lightmap(#[from] LightmapError),
    /// The scene and its document do not fit together.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// An edit.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// The invariant of exact updates is broken.
    #[error(
        "verify: {texels} of {all} texels differ; the worst is pixel {pixel} of object {object} (slot {worst}), by {units} fixed-point units: please report this with the device's name"
    )]
    Verify {
        /// Texels that differ.
        texels: usize,
        /// Texels in all.
        all: usize,
        /// The one with the largest difference, in the texel list.
        worst: usize,
        /// How large that is.
        units: u64,
        /// `page * page_size² + y * page_size + x`.
        pixel: u32,
        /// Index into the scene's objects.
        object: u32,
    },
}

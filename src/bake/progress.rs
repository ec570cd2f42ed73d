//! How a bake says where it is, without knowing who listens.

use std::time::Duration;

/// The stages of a bake, in order of their ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Charts and rectangles.
    Unwrap,
    /// The texels that surfaces fetch.
    Texels,
    /// The BVH.
    Bvh,
    /// Light paths.
    Paths,
    /// Octree, cut and virtual lights.
    Cluster,
    /// Pipelines, occluders and receivers.
    Upload,
    /// Virtual lights.
    Accumulate,
    /// Gutters and seams.
    Resolve,
}

impl Stage {
    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Unwrap => "unwrap",
            Stage::Texels => "texels",
            Stage::Bvh => "bvh",
            Stage::Paths => "paths",
            Stage::Cluster => "cluster",
            Stage::Upload => "upload",
            Stage::Accumulate => "accumulate",
            Stage::Resolve => "resolve",
        }
    }
}

/// Listens to a bake. Calls come from several threads.
pub trait Progress: Sync {
    /// `done` of `total` things of a stage are done.
    fn at(&self, stage: Stage, done: u64, total: u64);
    /// A stage has ended and took this long.
    fn ended(&self, stage: Stage, took: Duration);
}

/// Listens to nothing.
pub struct Silent;

impl Progress for Silent {
    fn at(&self, _: Stage, _: u64, _: u64) {}
    fn ended(&self, _: Stage, _: Duration) {}
}

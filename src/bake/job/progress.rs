//! How a bake says where it is, without knowing who listens.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::time::{Duration, Instant};

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
pub trait Listener: Sync {
    /// `done` of `total` things of a stage are done.
    fn at(&self, stage: Stage, done: u64, total: u64);
    /// A stage has ended and took this long.
    fn ended(&self, stage: Stage, took: Duration);
}

/// Listens to nothing.
pub struct Silent;

impl Listener for Silent {
    fn at(&self, _: Stage, _: u64, _: u64) {}
    fn ended(&self, _: Stage, _: Duration) {}
}

/// Seconds by stage, told to the listener as they end.
pub(in crate::bake) struct Stages<'a> {
    pub(super) listener: &'a dyn Listener,
    seconds: Mutex<BTreeMap<Stage, f64>>,
}

impl<'a> Stages<'a> {
    pub(in crate::bake) fn new(listener: &'a dyn Listener) -> Self {
        Self {
            listener,
            seconds: Mutex::default(),
        }
    }

    pub(in crate::bake) fn time<T>(&self, stage: Stage, work: impl FnOnce() -> T) -> T {
        self.listener.at(stage, 0, 1);
        let start = Instant::now();
        let result = tracing::info_span!("stage", name = stage.name()).in_scope(work);
        let took = start.elapsed();
        let mut seconds = self.seconds.lock().unwrap_or_else(|e| e.into_inner());
        *seconds.entry(stage).or_default() += took.as_secs_f64();
        drop(seconds);
        self.listener.ended(stage, took);
        result
    }

    /// By name.
    pub(in crate::bake) fn seconds(&self) -> BTreeMap<&'static str, f64> {
        let seconds = self.seconds.lock().unwrap_or_else(|e| e.into_inner());
        seconds.iter().map(|(s, t)| (s.name(), *t)).collect()
    }
}

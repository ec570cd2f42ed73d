//! The loop: what is accumulated when, and the passes that do it.
//!
//! The rooms stand in the order in which they rest on each other:
//!
//! ```text
//! device    what Rust and the shaders share: constants, records, compiled code
//! job       what is asked of a bake, and what it tells
//! world     the scene as the device has it, in versions: occluders, receivers, clearances
//! passes    texels are found, shadows drawn, light added up: each beside the shader of its stem
//! update    adds and subtracts lights, in batches that follow measured time
//! order     which lights next: the differences, what shows most of them first
//! baker     a scene whose lightmap follows its edits: edit, step, look
//! run       the bake from end to end, on one page; output writes its folder
//! measure   replays and measurements of all that
//! oracle    slow twins of the passes, for tests
//! ```

mod device;
mod job;
mod world;

mod passes;

mod update;

mod order;

mod baker;

pub mod output;
mod run;

mod measure;

#[cfg(test)]
mod oracle;

pub use baker::journal::Entry;
pub use baker::on_device::OnDevice;
pub use baker::step::{Limit, Progress};
pub use baker::{Baker, TURNS_AT};
pub use device::shared;
pub use job::progress::{Listener, Silent, Stage};
pub use job::report::{AtlasReport, Counts, Report, ShadowCounts};
pub use job::settings::{
    Clusters, MAX_BOUNCES, Options, Preset, Quality, Settings, SettingsError, fixed_point_bits,
};
pub use job::{BakeError, Job, KEPT_MAPS};
pub use measure::convergence::Moment;
pub use measure::limit_bench::{LimitCosts, UpdateCost};
pub use measure::replay::{Played, Replay, ReplayOptions, ScriptError, Step};
pub use measure::shadow_bench::{ShadowBench, ShadowCost};
pub use order::schedule::{Kind, Priority};
pub use passes::uv_raster;
pub use run::{Baked, bake};
pub use update::{Illumination, Sign};
pub use world::changes::{Changed, Place};
pub use world::occluders::Occluders;
pub use world::place::Receivers;
pub use world::versions::Version;

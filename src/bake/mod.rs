//! The loop: what is accumulated when, and the passes that do it, each beside the shader of the same stem.

mod accumulate;
mod baker;
mod brightness;
mod clearance;
mod convergence;
mod cutout;
mod edits;
mod enclosed;
mod estimate;
mod eye;
mod journal;
mod limit_bench;
mod list;
mod occluders;
mod on_device;
mod outcome;
pub mod output;
mod place;
mod plan;
mod pool;
mod progress;
mod records;
mod replay;
mod report;
mod residual;
mod run;
mod schedule;
mod session;
mod settings;
mod shaders;
mod shadow;
mod shadow_bench;
pub mod shared;
mod step;
mod towards;
mod update;
pub mod uv_raster;
mod versions;
mod viewport;

pub use baker::{Baker, TURNS_AT};
pub use convergence::Moment;
pub use journal::Entry;
pub use limit_bench::{LimitCosts, UpdateCost};
pub use occluders::Occluders;
pub use on_device::OnDevice;
pub use place::Receivers;
pub use progress::{Listener, Silent, Stage};
pub use replay::{Played, Replay, ReplayOptions, ScriptError, Step};
pub use report::{AtlasReport, Counts, Report, ShadowCounts};
pub use run::{BakeError, Baked, Job, bake};
pub use schedule::{Kind, Priority};
pub use settings::{
    Clusters, MAX_BOUNCES, Options, Preset, Quality, Settings, SettingsError, fixed_point_bits,
};
pub use shadow_bench::{ShadowBench, ShadowCost};
pub use step::{Limit, Progress};
pub use update::{Illumination, Sign};
pub use versions::{Boxes, Version};

#[cfg(test)]
mod oracle;

//! The bake on the device: one file per pass, with the shader's name.

mod accumulate;
mod list;
mod occluders;
mod place;
mod records;
mod settings;
mod shaders;
mod shadow;
pub mod shared;
mod update;
pub mod uv_raster;

pub use occluders::Occluders;
pub use place::Receivers;
pub use settings::{Clusters, MAX_BOUNCES, Preset, Quality, Settings, fixed_point_bits};
pub use update::{Illumination, Sign};

#[cfg(test)]
mod oracle;

//! What the device does, each pass beside the shader of the same stem: texels are found, lights' depth maps drawn, their light
//! added up, and maps compared.

pub(super) mod accumulate;
mod depth_begin;
mod depth_blocks;
pub(super) mod residual;
pub(super) mod shadow;
mod shadow_draw;
mod shadow_groups;
pub mod uv_raster;

//! What the device does, each pass beside the shader of the same stem: texels are found, lights' depth maps drawn, their light
//! added up, and maps compared.

pub(super) mod accumulate;
pub(super) mod residual;
pub(super) mod shadow;
pub mod uv_raster;

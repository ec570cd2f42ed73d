//! The compiled shaders of `glsl/`, by file stem.

use crate::gpu::Shader;

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

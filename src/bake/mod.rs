//! To come.

mod shaders;
pub mod shared;

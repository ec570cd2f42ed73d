//! What Rust and the shaders share: constants, records and the compiled code, and buffers and lists that live on the device.

pub(super) mod list;
pub(super) mod pool;
pub(super) mod records;
pub(super) mod shaders;
pub mod shared;

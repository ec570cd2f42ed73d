//! Bakes and edits, measured: how fast the map comes to its end, what limited updates and depth maps cost.

pub(super) mod convergence;
pub(super) mod limit_bench;
pub(super) mod replay;
pub(super) mod shadow_bench;
mod viewport;

//! The scene as the device has it: what stands where in which version of it, what casts shadows, and what receives light.

pub(super) mod changes;
pub(super) mod clearance;
mod coarse;
pub(super) mod cutout;
pub(super) mod enclosed;
pub(super) mod occluders;
pub(super) mod place;
pub(super) mod versions;

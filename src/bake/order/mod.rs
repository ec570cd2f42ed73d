//! What is done next: what differs between the map and what it should be, cut into updates, the most visible first.

pub(super) mod brightness;
mod estimate;
pub(super) mod eye;
pub(super) mod parts;
pub(super) mod places;
pub(super) mod plan;
pub(super) mod schedule;
mod shown;
pub(super) mod sight;
mod towards;
mod work;

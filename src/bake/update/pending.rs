//! Lights on their way to the device, and what they will take there.

use super::Sign;
use super::allowance;
use super::kept::Keeping;
use crate::bake::device::records::{Parts, Version};
use crate::cluster::VirtualLight;

/// A light on its way to the device.
#[derive(Clone, Debug)]
pub(super) struct Pending {
    pub light: VirtualLight,
    /// What becomes of it in its version, if it comes or goes as a whole.
    pub sign: Sign,
    pub version: Version,
    /// The version that a difference takes it away from; the same where the whole light comes or goes.
    pub other: Version,
    /// Of the map, which it is to reach.
    pub parts: Parts,
    /// The number of the update that it is part of.
    pub update: u64,
    pub keeping: Keeping,
}

impl Pending {
    /// Which passes evaluate it: those for indirect lights, or for direct ones.
    pub fn queue(&self) -> usize {
        usize::from(self.light.direct)
    }

    /// What it takes, as [`Costs`] counts.
    pub fn kind(&self) -> usize {
        let how = match (self.version != self.other, self.keeping.load) {
            (true, _) => allowance::DIFFERENCE,
            (false, Some(_)) => allowance::FETCHED,
            (false, None) => allowance::DRAWN,
        };
        let part = Parts::EACH.iter().position(|part| *part == self.parts);
        self.queue() + 2 * how + 6 * part.map_or(0, |part| part + 1)
    }
}

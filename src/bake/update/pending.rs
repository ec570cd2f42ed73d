//! Lights on their way to the device, and what they will take there.

use glam::Vec3;

use super::allowance;
use super::kept::Keeping;
use crate::bake::device::records::{Parts, Version};
use crate::cluster::VirtualLight;

/// Whether a light's contribution is added or taken away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Its light comes.
    Add,
    /// Its light goes, bit for bit as it came.
    Subtract,
}

/// A light on its way to the device.
#[derive(Clone, Debug)]
pub(super) struct Pending {
    pub light: VirtualLight,
    /// What becomes of it in its version, if it comes or goes as a whole.
    pub sign: Sign,
    pub version: Version,
    /// The version that a difference takes it away from; the same where the whole light comes or goes.
    pub other: Version,
    /// The version of a light that leaves and sees what this one sees, if that is another one: its map begins as that light's.
    pub begins: Option<Version>,
    /// Of direct light, the flux that it had, which goes where it comes.
    pub flux: Option<Vec3>,
    /// Of the map, which it is to reach.
    pub parts: Parts,
    /// The number of the update that it is part of.
    pub update: u64,
    pub keeping: Keeping,
}

impl Pending {
    /// The version whose map its own begins as; its own, where it begins with nothing.
    pub fn begins(&self) -> Version {
        match (self.other == self.version, self.keeping.load_other) {
            (true, Some(_)) => self.begins.unwrap_or(self.version),
            _ => self.other,
        }
    }

    /// Which passes evaluate it: those for indirect lights, or for direct ones.
    pub fn queue(&self) -> usize {
        usize::from(self.light.direct)
    }

    /// What it takes, as [`Costs`] counts.
    pub fn kind(&self) -> usize {
        let kept = self.keeping.load.or(self.keeping.load_other);
        let how = match (self.version != self.other, kept) {
            (true, _) => allowance::DIFFERENCE,
            (false, Some(_)) => allowance::KEPT,
            (false, None) => allowance::DRAWN,
        };
        let part = Parts::EACH.iter().position(|part| *part == self.parts);
        self.queue() + 2 * how + 6 * part.map_or(0, |part| part + 1)
    }
}

/// Lights that fill batches of their own, because other passes evaluate them.
#[derive(Default)]
pub(super) struct Queue {
    pub pending: Vec<Pending>,
    /// Batches of the other queue that were sent since.
    pub waited: u32,
}

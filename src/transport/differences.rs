//! What a step of validation changed in the paths of a scene.

use glam::Vec3;

use super::Vpl;
use super::paths::{Emission, Path};

/// What [`super::validate::Validator::step`] changed, in the order of keys. What came out as it was is not in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Differences {
    /// VPLs that are gone.
    pub removed: Vec<Vpl>,
    /// VPLs that are new; where a VPL lies elsewhere, it is removed and added.
    pub added: Vec<Vpl>,
    /// VPLs of which nothing but the flux or the scatter changed, before and after.
    pub revised: Vec<[Vpl; 2]>,
    /// Starts of paths that changed, their scatter included.
    pub emissions: Vec<EmissionChange>,
    /// Lights that changed in any way, appeared or vanished.
    pub lights: Vec<LightChange>,
    /// Paths that were traced, dropped or added, whatever came out.
    pub paths: usize,
}

/// The start of a path before and after.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionChange {
    /// [`crate::scene::Light::id`].
    pub light: u32,
    /// Index of the path in its light's sequence.
    pub path: u32,
    /// None for a path that is new.
    pub old: Option<Emission>,
    /// None for a path that is gone.
    pub new: Option<Emission>,
}

/// A light before and after.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightChange {
    /// [`crate::scene::Light::id`].
    pub light: u32,
    /// Radiant flux in lumens, linear RGB: before and after; zero where it was not or is not there.
    pub flux: [Vec3; 2],
    /// Paths leave it along other rays; else it was at most dimmed, or given another colour.
    pub moved: bool,
}

impl Differences {
    /// Nothing changed.
    pub fn is_empty(&self) -> bool {
        let vpls = self.removed.is_empty() && self.added.is_empty() && self.revised.is_empty();
        vpls && self.emissions.is_empty() && self.lights.is_empty()
    }

    /// Takes in a path that was traced again, is new or is gone.
    pub(super) fn path(&mut self, light: u32, path: u32, old: Option<&Path>, new: Option<&Path>) {
        let emission = [old, new].map(|p| p.map(|p| p.emission));
        if emission[0] != emission[1] {
            let [old, new] = emission;
            self.emissions.push(EmissionChange {
                light,
                path,
                old,
                new,
            });
        }
        let vpls = [old, new].map(|p| p.map_or(&[][..], |p| &p.vpls[..]));
        for bounce in 0..vpls[0].len().max(vpls[1].len()) {
            match vpls.map(|v| v.get(bounce)) {
                [Some(old), Some(new)] if old == new => {}
                [Some(old), Some(new)]
                    if *old
                        == (Vpl {
                            flux: old.flux,
                            scatter: old.scatter,
                            ..*new
                        }) =>
                {
                    self.revised.push([*old, *new]);
                }
                [old, new] => {
                    self.removed.extend(old);
                    self.added.extend(new);
                }
            }
        }
    }

    pub(super) fn sort(&mut self) {
        self.removed.sort_unstable_by_key(|v| v.key);
        self.added.sort_unstable_by_key(|v| v.key);
        self.revised.sort_unstable_by_key(|[v, _]| v.key);
        self.emissions.sort_unstable_by_key(|e| (e.light, e.path));
    }
}

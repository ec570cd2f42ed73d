//! What a session with a person needs of the baker besides edits and steps.

use crate::bake::baker::{Baker, resolve};
use crate::bake::job::Job;
use crate::bake::job::settings::Settings;
use crate::cluster::{CellId, VirtualLight};
use crate::scene::Scene;
use crate::transport::{SceneBvh, Vpl};

impl Job {
    /// What its options come to for a scene.
    pub fn settings(&self, scene: &Scene) -> Settings {
        resolve(scene, self)
    }
}

impl Baker {
    /// For rays into the scene as it is now. Clones are cheap.
    pub fn bvh(&self) -> &SceneBvh {
        &self.bvh
    }

    /// The virtual lights whose light is in the map, or is on its way there, with their cells; where what is seen goes ahead, its
    /// lights.
    pub fn virtual_lights(&self) -> impl Iterator<Item = (&CellId, &VirtualLight)> {
        let held = self.holdings.seen().iter();
        held.flat_map(|(cell, held)| held.selected.lights.iter().map(move |light| (cell, light)))
    }

    /// The virtual point lights that the scene's light paths have left so far.
    pub fn vpls(&self) -> impl Iterator<Item = &Vpl> {
        self.validator.paths().vpls()
    }

    /// Lumens in the map that are estimated to be wrong, by cell, as far as paths have been traced since the last edit.
    pub fn invalid_flux(&self) -> impl Iterator<Item = (CellId, f64)> {
        self.plan.invalid_cells()
    }
}

//! What a session with a person needs of the baker besides edits and steps.

use std::path::Path;

use super::baker::{Baker, resolve};
use super::run::{BakeError, Job};
use super::settings::Settings;
use crate::cluster::{CellId, VirtualLight};
use crate::scene::Scene;
use crate::scene::edit::{Change, Edit};
use crate::transport::{SceneBvh, Vpl};

impl Job {
    /// What its options come to for a scene.
    pub fn settings(&self, scene: &Scene) -> Settings {
        resolve(scene, self)
    }
}

impl Baker {
    /// Does another edit in place of the last one: while something is dragged, all of it is to be one edit to undo.
    ///
    /// # Errors
    /// As [`Baker::apply`]; the last edit then stays as it was. There is none.
    pub fn amend(&mut self, edit: &Edit, folder: &Path) -> Result<(), BakeError> {
        let old = self.scene().clone();
        self.editor.undo()?;
        if let Err(error) = self.editor.apply(edit, folder) {
            self.editor.redo()?;
            return Err(error.into());
        }
        if let Err(error) = self.lay_out() {
            // Rarely: only a copy or an addition needs room, and neither is dragged.
            self.editor.take_back()?;
            self.follow_from(&old)?;
            return Err(error);
        }
        self.follow_from(&old)
    }

    fn follow_from(&mut self, old: &crate::scene::Scene) -> Result<(), BakeError> {
        let change = Change::between(old, self.scene());
        self.follow(old, &change)
    }

    /// For rays into the scene as it is now. Clones are cheap.
    pub fn bvh(&self) -> &SceneBvh {
        &self.bvh
    }

    /// The virtual lights whose light is in the map, or is on its way there, with their cells.
    pub fn virtual_lights(&self) -> impl Iterator<Item = (&CellId, &VirtualLight)> {
        let held = self.held.iter();
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

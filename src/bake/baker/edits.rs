//! How a baker follows edits: room for what comes, what they make wrong, and what is given back.

use std::path::Path;
use std::sync::Arc;

use crate::bake::baker::Baker;
use crate::bake::job::BakeError;
use crate::bake::passes::uv_raster;
use crate::bake::world::changes::{Changed, Place};
use crate::bake::world::versions::Version;
use crate::gpu::GpuError;
use crate::lightmap::texels::{ClaimStatistics, Claims};
use crate::scene::Scene;
use crate::scene::edit::{Change, Edit};
use crate::transport::emission::{Emitter, mean};

impl Baker {
    /// Edits the scene. `folder` is where files that the edit adds are looked up. The map follows with [`Baker::step`];
    /// further edits need not wait for that.
    ///
    /// # Errors
    /// An edit that makes no sense, or whose objects find no room in the lightmap: nothing has changed then.
    pub fn apply(&mut self, edit: &Edit, folder: &Path) -> Result<(), BakeError> {
        let _span = tracing::debug_span!("edit").entered();
        let old = self.scene().clone();
        let change = self.editor.apply(edit, folder)?;
        if let Err(error) = self.lay_out() {
            self.editor.take_back()?;
            return Err(error);
        }
        self.follow(&old, &change)
    }

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

    /// Takes back the last edit that has not been taken back.
    ///
    /// # Errors
    /// There is none.
    pub fn undo(&mut self) -> Result<(), BakeError> {
        let old = self.scene().clone();
        let change = self.editor.undo()?;
        self.lay_out()?;
        self.follow(&old, &change)
    }

    /// Does again what was taken back last.
    ///
    /// # Errors
    /// There is nothing.
    pub fn redo(&mut self) -> Result<(), BakeError> {
        let old = self.scene().clone();
        let change = self.editor.redo()?;
        self.lay_out()?;
        self.follow(&old, &change)
    }

    /// Finds room in the lightmap for objects that came.
    pub(super) fn lay_out(&mut self) -> Result<(), BakeError> {
        let scene = self.editor.scene().clone();
        let mut new = self.atlas.update(&scene)?;
        new.extend(self.texels.lacking(&scene));
        new.sort_unstable();
        new.dedup();
        if !new.is_empty() {
            let claims = uv_raster::rasterize_objects(&self.gpu, &self.atlas, &new)?;
            let tiles = self.texels.extend(&scene, &self.atlas, &claims, &new);
            self.clearances.extend(&self.texels, &tiles);
            self.new_tiles.extend(tiles);
            self.count_claims(&claims, &new);
        }
        Ok(())
    }

    /// No light is held under a version of the scene before `oldest` any more: what was needed for these alone makes room.
    pub(super) fn forget_before(&mut self, oldest: Version) -> Result<(), GpuError> {
        self.illumination.forget(oldest)?;
        for (_, tiles) in self.retired.extract_if(.., |(since, _)| *since <= oldest) {
            self.texels.release(tiles);
        }
        Ok(())
    }

    pub(super) fn count_claims(&mut self, claims: &Claims, objects: &[u32]) {
        let all = self.claims.len().max(self.atlas.objects.len());
        self.claims.resize(all, ClaimStatistics::default());
        for &object in objects {
            self.claims[object as usize] = claims.of_object(&self.atlas, object);
        }
    }

    /// Takes a change of the scene in: everything that it makes wrong is known to be wrong from here on.
    pub(super) fn follow(&mut self, old: &Scene, change: &Change) -> Result<(), BakeError> {
        let scene = self.editor.scene().clone();
        if change.is_empty() {
            return Ok(());
        }
        let _span = tracing::debug_span!("follow").entered();
        if !change.objects.is_empty() {
            self.bvh = self.bvh.moved(&scene, &change.objects);
            let objects = &change.objects;
            let bounds =
                |scene: &Scene, object| scene.stands(object).then(|| scene.object_bounds(object));
            let place = |&object: &u32| Place {
                object,
                before: bounds(old, object),
                after: bounds(&scene, object),
            };
            let mut changed = Changed {
                places: objects.iter().map(place).collect(),
                near: Vec::new(),
                reach: self.clearances.reach(),
            };
            let boxes = changed.boxes();
            for tiles in &self.new_tiles {
                let (first, end) = (tiles.start as usize, tiles.end as usize);
                let known = self.seen.len();
                self.seen[first.min(known)..end.min(known)].fill(false);
            }
            if let Some(sight) = &mut self.sight {
                let came = !self.new_tiles.is_empty();
                sight.follow(&scene, &self.bvh, &self.atlas, &self.texels, &boxes, came);
            }
            let (replaced, near) = tracing::debug_span!("clearances").in_scope(|| {
                self.clearances
                    .update(&scene, &self.bvh, &mut self.texels, objects, &boxes)
            });
            changed.near = near;
            let version = self.illumination.change(
                &scene,
                &self.texels,
                &std::mem::take(&mut self.new_tiles),
                &replaced,
                changed,
            )?;
            for &object in objects.iter().filter(|o| !scene.stands(**o)) {
                let tiles = self.texels.retire(object);
                if !tiles.is_empty() {
                    self.retired.push((version, tiles));
                }
            }
        }
        self.refer(&scene, change);
        self.validator.invalidate(&scene, change);
        self.settled = false;
        self.edited = true;
        Ok(())
    }

    /// Lights that come are referred to as they are from here on ([`Settings::reference_flux`]).
    ///
    /// [`Settings::reference_flux`]: crate::bake::Settings::reference_flux
    fn refer(&mut self, scene: &Scene, change: &Change) {
        let known = &mut self.settings.reference_flux;
        let lights = (0..).zip(&scene.lights);
        let came: Vec<(u32, usize)> = lights
            .map(|(index, light)| (light.id(), index))
            .filter(|(id, _)| change.lights.contains(id) && !known.contains_key(id))
            .collect();
        if came.is_empty() {
            return;
        }
        let flux = |index| f64::from(mean(Emitter::new(scene, index).flux));
        known.extend(came.into_iter().map(|(id, index)| (id, flux(index))));
        self.validator.refer(Arc::new(known.clone()));
    }

    fn follow_from(&mut self, old: &Scene) -> Result<(), BakeError> {
        let change = Change::between(old, self.scene());
        self.follow(old, &change)
    }
}

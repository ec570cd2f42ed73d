//! Applies edits to a scene and its document, and takes them back.

use std::path::Path;
use std::sync::Arc;

use super::super::{Document, Scene, SceneError, assets::Assets, json::list, load::Unseen};
use super::names::place;
use super::patch::Patch;
use super::{Change, Edit, EditError};

/// A scene that is edited, with its document and what was done to it.
///
/// The scene is the document's, as [`Scene::from_document`] reads it, but for objects that are gone, which keep their
/// index with an empty mesh (see [`Scene::is_gone`]). Objects and lights are in the order of their nodes, and new nodes come after all
/// others, so nothing is ever renumbered. Indices of meshes and textures may change; what they point to is shared
/// between the versions where it is the same.
#[derive(Debug)]
pub struct Editor {
    scene: Arc<Scene>,
    document: Document,
    assets: Assets,
    done: Vec<Patch>,
    /// With what had been read for them, so that no image is decoded a second time.
    undone: Vec<(Patch, Assets)>,
}

impl Editor {
    /// Starts a session with a scene and the document that it was read from.
    ///
    /// # Errors
    /// What [`Scene::from_document`] finds wrong with the document.
    pub fn new(scene: Scene, document: Document) -> Result<Self, SceneError> {
        let mut assets = Assets::of(&scene, &document)?;
        let scene = Arc::new(Scene::derive(&document, &mut assets, Unseen::Kept)?);
        Ok(Self {
            scene,
            document,
            assets,
            done: Vec::new(),
            undone: Vec::new(),
        })
    }

    /// The scene as it is now.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// The document as it is now. Nodes that were removed are still listed, but not part of the scene.
    pub fn document(&self) -> &Document {
        &self.document
    }

    /// Applies an edit. `folder` is where the files that it adds are looked up. What had been undone cannot be done again
    /// afterwards.
    ///
    /// # Errors
    /// [`EditError`]; nothing has changed then.
    pub fn apply(&mut self, edit: &Edit, folder: &Path) -> Result<Change, EditError> {
        let mut document = self.document.clone();
        edit.write(&mut document, folder)?;
        let mut assets = self.assets.clone();
        let scene = Scene::derive(&document, &mut assets, Unseen::Kept)?;
        self.check(edit, &scene, &document)?;
        let patch = Patch::between(&self.document, &document);
        self.document = document;
        self.assets = assets;
        self.done.push(patch);
        self.undone.clear();
        Ok(self.show(scene))
    }

    /// Takes back the last edit that has not been taken back. Scene and document are then as they were before it: what it
    /// had appended is no longer there, not even as an object that is gone.
    ///
    /// # Errors
    /// [`EditError::Nothing`].
    pub fn undo(&mut self) -> Result<Change, EditError> {
        let nothing = EditError::Nothing { what: "undo" };
        let patch = self.done.last().ok_or(nothing)?;
        let mut document = self.document.clone();
        patch.revert(&mut document);
        let mut assets = self.assets.clone();
        assets.forget_beyond(&document);
        let scene = Scene::derive(&document, &mut assets, Unseen::Kept)?;
        self.document = document;
        let assets = std::mem::replace(&mut self.assets, assets);
        self.undone
            .extend(self.done.pop().map(|patch| (patch, assets)));
        Ok(self.show(scene))
    }

    /// Does again what was taken back last.
    ///
    /// # Errors
    /// [`EditError::Nothing`].
    pub fn redo(&mut self) -> Result<Change, EditError> {
        let nothing = EditError::Nothing { what: "redo" };
        let (patch, assets) = self.undone.last().ok_or(nothing)?;
        let mut document = self.document.clone();
        patch.apply(&mut document);
        let mut assets = assets.clone();
        let scene = Scene::derive(&document, &mut assets, Unseen::Kept)?;
        self.document = document;
        self.assets = assets;
        self.done.extend(self.undone.pop().map(|(patch, _)| patch));
        Ok(self.show(scene))
    }

    /// As [`Self::undo`], and forgets the edit: for one that is refused elsewhere, for want of room in the lightmap.
    ///
    /// # Errors
    /// [`EditError::Nothing`].
    pub fn take_back(&mut self) -> Result<Change, EditError> {
        let change = self.undo()?;
        self.undone.pop();
        Ok(change)
    }

    fn show(&mut self, scene: Scene) -> Change {
        let old = std::mem::replace(&mut self.scene, Arc::new(scene));
        Change::between(&old, &self.scene)
    }

    /// What the loader would let pass.
    fn check(&self, edit: &Edit, scene: &Scene, document: &Document) -> Result<(), EditError> {
        let objects = 0..self.scene.objects.len() as u32;
        let lost = |object: &u32| !self.scene.is_gone(*object) && scene.is_gone(*object);
        match edit {
            Edit::Transform { scale, .. } => match objects.clone().find(lost) {
                Some(object) => {
                    let node = scene.objects[object as usize].node as usize;
                    let place = place("node", list(&document.json, "nodes"), node);
                    let field = if scale.is_some() { "scale" } else { "rotation" };
                    let why = "it would be scaled to nothing; use \"remove\" to hide it";
                    Err(EditError::field(&place, field, why))
                }
                None => Ok(()),
            },
            Edit::Remove { .. }
                if (0..scene.objects.len() as u32).all(|object| scene.is_gone(object))
                    && !objects.clone().all(|object| self.scene.is_gone(object)) =>
            {
                Err(EditError::Scene {
                    place: "the edited scene".into(),
                    why: "no object would be left to light; add another one first".into(),
                })
            }
            _ => Ok(()),
        }
    }
}

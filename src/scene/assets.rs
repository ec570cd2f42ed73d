//! What was read from a document's buffers and images, kept for the next time that its scene is derived.

use std::{collections::BTreeMap, sync::Arc};

use glam::Vec3;

use super::{
    Mesh, Scene, Texture, document::Document, error::SceneError, json::list,
    materials::images_in_use,
};

/// Meshes and images by their glTF index. They hold as long as no edit changes a mesh, an accessor or an image that is
/// there already: edits only append them.
#[derive(Clone, Debug, Default)]
pub(super) struct Assets {
    /// By glTF mesh.
    pub meshes: BTreeMap<usize, LoadedMesh>,
    /// By glTF image.
    pub images: BTreeMap<usize, LoadedImage>,
    /// Whether what the file holds in vain has been warned of before.
    pub quiet: bool,
}

/// What was loaded, with its glTF index.
pub(super) type Indexed<T> = Vec<(usize, T)>;

#[derive(Clone, Debug)]
pub(super) struct LoadedMesh {
    pub mesh: Arc<Mesh>,
    /// The box around its vertices, object space; whether any vertex has no triangle does not matter.
    pub corners: [Vec3; 2],
}

#[derive(Clone, Debug)]
pub(super) struct LoadedImage {
    pub texture: Arc<Texture>,
    /// Whether any texel is not black.
    pub bright: bool,
}

impl LoadedMesh {
    pub fn new(mesh: Arc<Mesh>) -> Self {
        let empty = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        let corners = mesh
            .positions
            .iter()
            .fold(empty, |[min, max], p| [min.min(*p), max.max(*p)]);
        Self { mesh, corners }
    }
}

impl LoadedImage {
    pub fn new(texture: Arc<Texture>) -> Self {
        let bright = texture.texels.iter().any(|t| t[..3] != [0; 3]);
        Self { texture, bright }
    }
}

impl Assets {
    /// What `scene` holds already, which was read from `document`.
    ///
    /// # Errors
    /// Whatever is wrong with the document's materials, if it was not.
    pub fn of(scene: &Scene, document: &Document) -> Result<Self, SceneError> {
        let mut assets = Self::default();
        for mesh in &scene.meshes {
            if !mesh.triangles.is_empty() {
                let loaded = LoadedMesh::new(mesh.clone());
                assets.meshes.insert(mesh.source as usize, loaded);
            }
        }
        let images = images_in_use(document)?;
        if images.len() == scene.textures.len() {
            for (image, texture) in images.into_iter().zip(&scene.textures) {
                assets
                    .images
                    .insert(image, LoadedImage::new(texture.clone()));
            }
        }
        assets.quiet = true;
        Ok(assets)
    }

    /// Forgets what `document` has not.
    pub fn forget_beyond(&mut self, document: &Document) {
        self.meshes.split_off(&list(&document.json, "meshes").len());
        self.images.split_off(&document.images.len());
    }
}

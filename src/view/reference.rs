//! A lightmap to hold the bake against.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::ViewError;
use crate::bake::{AtlasReport, Job};
use crate::lightmap::compare::{DARK, load_pages};
use crate::lightmap::exr::Image;
use crate::scene::Scene;

/// The pages of a reference.
pub struct Reference {
    path: PathBuf,
    pages: Vec<Image>,
    /// Of red, green and blue, over texels that are lit, lux.
    mean: f64,
}

impl Reference {
    /// Reads a folder that a bake wrote, or an EXR file.
    ///
    /// # Errors
    /// Neither of these.
    pub fn load(path: &Path) -> Result<Self, ViewError> {
        let pages = load_pages(path)?;
        let texels = pages.iter().flat_map(|page| &page.texels);
        let mean = |texel: &[f32; 3]| texel.iter().map(|v| f64::from(*v)).sum::<f64>() / 3.0;
        let lit: Vec<f64> = texels.map(mean).filter(|e| *e > 0.0).collect();
        Ok(Self {
            path: path.into(),
            pages,
            mean: lit.iter().sum::<f64>() / lit.len().max(1) as f64,
        })
    }

    /// Lux, row by row.
    pub fn pages(&self) -> &[Image] {
        &self.pages
    }

    /// Errors are relative to no less than this, lux.
    pub fn least(&self) -> f64 {
        (self.mean * DARK).max(f64::MIN_POSITIVE)
    }

    /// Whether its texels are those of a lightmap of `pages` pages of `size` texels.
    ///
    /// # Errors
    /// They are not.
    pub fn check(&self, [size, pages]: [u32; 2]) -> Result<(), ViewError> {
        let side = size as usize;
        let same = self.pages.len() == pages as usize
            && self
                .pages
                .iter()
                .all(|p| p.width == side && p.height == side);
        if same {
            return Ok(());
        }
        let first = self.pages.first().map_or([0; 2], |p| [p.width, p.height]);
        Err(ViewError::Reference {
            path: self.path.clone(),
            is: format!("{} of {} x {}", self.pages.len(), first[0], first[1]),
            should: format!("{pages} of {size} x {size}"),
        })
    }
}

/// What is needed of a bake.json.
#[derive(Deserialize)]
struct Recorded {
    atlas: AtlasReport,
}

/// Gives `job` the atlas of the bake in `folder`, if `path` is the scene that this wrote: texel by texel they can be compared.
///
/// # Errors
/// A bake.json that is none.
pub fn adopt(job: &mut Job, folder: &Path, path: &Path, scene: &Scene) -> Result<(), ViewError> {
    let file = folder.join("bake.json");
    let same = |a: &Path, b: &Path| match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    };
    if !same(&folder.join("scene.glb"), path) || !file.exists() {
        return Ok(());
    }
    let read = || -> Result<Recorded, String> {
        let text = std::fs::read_to_string(&file).map_err(|e| e.to_string())?;
        serde_json::from_str(&text).map_err(|e| e.to_string())
    };
    let recorded = read().map_err(|why| ViewError::Recorded {
        path: file.clone(),
        why,
    })?;
    job.repeat = Some((job.settings(scene), recorded.atlas));
    Ok(())
}

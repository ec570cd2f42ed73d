//! A bake's folder: scene.glb, its pages, bake.json, preview.png.

use std::path::{Path, PathBuf};

use super::baker::Baker;
use super::job::report::Report;
use crate::lightmap::{Lightmap, export, preview};

/// Width and height of preview.png.
const PREVIEW: [u32; 2] = [960, 540];

/// Why a bake was not written. What was in the folder before is still there.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The folder or one of its files.
    #[error(transparent)]
    Export(#[from] export::ExportError),
    /// preview.png.
    #[error("encoding the preview")]
    Preview(#[from] image::ImageError),
    /// bake.json.
    #[error("writing the report")]
    Report(#[from] serde_json::Error),
}

/// Writes a bake's folder, `extra` files (name, content) included, all or none; returns the files.
///
/// # Errors
/// A folder that cannot be written to.
pub fn write(
    output: &Path,
    baker: &Baker,
    lightmap: &Lightmap,
    report: &Report,
    extra: Vec<(String, Vec<u8>)>,
) -> Result<Vec<PathBuf>, OutputError> {
    let (scene, document, atlas) = (baker.scene(), baker.document(), baker.atlas());
    let preview = preview::preview(scene, &atlas, lightmap, None, PREVIEW[0], PREVIEW[1])?;
    let mut files = vec![
        ("bake.json".to_owned(), serde_json::to_vec_pretty(report)?),
        ("preview.png".to_owned(), preview),
    ];
    files.extend(extra);
    let content = if report.settings.indirect_only {
        export::Content::IndirectOnly
    } else {
        export::Content::DirectAndIndirect
    };
    let written = export::write_outputs(output, document, scene, &atlas, lightmap, content, files)?;
    Ok(written)
}

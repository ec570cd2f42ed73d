//! Writes a bake's outputs into a folder: all of them or none, and what an earlier bake left is kept until then.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use super::{Atlas, Lightmap, exr, glb};
use crate::scene::{Document, Scene, SceneError};

/// Why nothing was written. What was in the folder before is still there.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The file system refused.
    #[error("cannot write {}: {cause}; nothing in the output folder has changed", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        cause: io::Error,
    },
    /// An image could not be encoded or stored.
    #[error("cannot write {}: {cause}; nothing in the output folder has changed", path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: ::exr::error::Error,
    },
    /// The output is something else.
    #[error("{} is not a folder: give another one with -o", path.display())]
    NotAFolder {
        /// The output.
        path: PathBuf,
    },
    /// The scene cannot be written.
    #[error(transparent)]
    Scene(#[from] SceneError),
}

/// What light is in the map, for the files' headers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// All light.
    DirectAndIndirect,
    /// What has bounced at least once.
    IndirectOnly,
}

impl Content {
    fn words(self) -> &'static str {
        match self {
            Self::DirectAndIndirect => "direct and indirect light",
            Self::IndirectOnly => "indirect light only",
        }
    }
}

/// Finds out early whether [`write_outputs`] has a chance: whether `out` is a folder or can become one, and can be written to.
/// Leaves nothing behind.
pub fn check_output(out: &Path) -> Result<(), ExportError> {
    Stage::new(out).map(drop)
}

/// Writes `scene.glb` and a `lightmap_K.exr` per page into the folder `out`, and `extra_files` (name, content) with them:
/// `bake.json`, `preview.png`. Returns their paths.
///
/// Everything is written beside first and flushed to the disk, then moved into place; on any error the folder is as
/// it was. Pages of an earlier bake that this one does not have are removed. `document` is the one that `scene` was read from.
pub fn write_outputs(
    out: &Path,
    document: &Document,
    scene: &Scene,
    atlas: &Atlas,
    lightmap: &Lightmap,
    content: Content,
    extra_files: Vec<(String, Vec<u8>)>,
) -> Result<Vec<PathBuf>, ExportError> {
    let stage = Stage::new(out)?;
    let mut names = Vec::new();
    for (k, page) in lightmap.pages.iter().enumerate() {
        let name = glb::page_file(k as u32);
        let path = stage.new.join(&name);
        let shown = || out.join(&name);
        let file = File::create_new(&path).map_err(|cause| ExportError::Write {
            path: shown(),
            cause,
        })?;
        exr::write(page, lightmap.page_size, content.words(), &file).map_err(|cause| {
            ExportError::Image {
                path: shown(),
                cause,
            }
        })?;
        file.sync_all().map_err(|cause| ExportError::Write {
            path: shown(),
            cause,
        })?;
        names.push(name);
    }
    let scene = glb::lit_document(document, scene, atlas).to_glb()?;
    for (name, bytes) in [("scene.glb".to_owned(), scene)]
        .into_iter()
        .chain(extra_files)
    {
        let write = || {
            let mut file = File::create_new(stage.new.join(&name))?;
            io::Write::write_all(&mut file, &bytes)?;
            file.sync_all()
        };
        write().map_err(|cause| ExportError::Write {
            path: out.join(&name),
            cause,
        })?;
        names.push(name);
    }
    stage.publish(out, &names)
}

/// A folder where the new files wait, and the old ones while they are being replaced. Removed when dropped.
struct Stage {
    root: PathBuf,
    new: PathBuf,
    old: PathBuf,
    /// The folders that were made for it, the outermost first: removed again if nothing comes of it.
    made: Vec<PathBuf>,
}

impl Stage {
    fn new(out: &Path) -> Result<Self, ExportError> {
        let fail = |path: &Path| {
            let path = path.to_owned();
            move |cause| ExportError::Write { path, cause }
        };
        if out.exists() && !out.is_dir() {
            return Err(ExportError::NotAFolder { path: out.into() });
        }
        // Inside the folder: then moving never crosses a file system.
        let made: Vec<PathBuf> = out
            .ancestors()
            .take_while(|p| !p.as_os_str().is_empty() && !p.exists())
            .map(Path::to_owned)
            .collect::<Vec<_>>()
            .into_iter()
            .rev()
            .collect();
        let root = out.join(format!(".rebake-{}", std::process::id()));
        let stage = Self {
            new: root.join("new"),
            old: root.join("old"),
            root,
            made,
        };
        fs::create_dir_all(&stage.new).map_err(fail(out))?;
        fs::create_dir_all(&stage.old).map_err(fail(out))?;
        Ok(stage)
    }

    /// Moves the new files into place, the old ones out of the way; back again if one cannot be moved.
    fn publish(mut self, out: &Path, names: &[String]) -> Result<Vec<PathBuf>, ExportError> {
        let replaced: Vec<String> = names
            .iter()
            .cloned()
            .chain(stale_pages(out, names))
            .collect();
        let mut moved: Vec<(PathBuf, PathBuf)> = Vec::new();
        let mut all = || -> Result<(), (PathBuf, io::Error)> {
            let mut step = |from: PathBuf, to: PathBuf, shown: PathBuf| {
                fs::rename(&from, &to).map_err(|cause| (shown, cause))?;
                moved.push((from, to));
                Ok(())
            };
            for name in &replaced {
                let path = out.join(name);
                if path.symlink_metadata().is_ok() {
                    step(path.clone(), self.old.join(name), path)?;
                }
            }
            for name in names {
                step(self.new.join(name), out.join(name), out.join(name))?;
            }
            Ok(())
        };
        let result = all();
        if let Err((path, cause)) = result {
            for (from, to) in moved.into_iter().rev() {
                // Each of these undoes a move that has just worked; should one fail all the same, the file stays in the stage,
                // which is then not removed.
                if let Err(error) = fs::rename(&to, &from) {
                    tracing::error!(
                        "{} could not be moved back to {}: {error}",
                        to.display(),
                        from.display()
                    );
                    self.root = PathBuf::new();
                }
            }
            return Err(ExportError::Write { path, cause });
        }
        self.made.clear();
        // The names are on the disk once the folder is; file systems that cannot sync a folder write them by themselves.
        if let Ok(folder) = File::open(out) {
            let _ = folder.sync_all();
        }
        Ok(names.iter().map(|name| out.join(name)).collect())
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        if !self.root.as_os_str().is_empty() {
            // What cannot be removed is only litter; the outputs are in place.
            let _ = fs::remove_dir_all(&self.root);
        }
        for folder in self.made.iter().rev() {
            let _ = fs::remove_dir(folder);
        }
    }
}

/// Pages in the folder that an earlier bake wrote and this one does not.
fn stale_pages(out: &Path, names: &[String]) -> Vec<String> {
    (0..)
        .map(glb::page_file)
        .skip_while(|name| names.contains(name))
        .take_while(|name| out.join(name).exists())
        .collect()
}

#[cfg(test)]
#[path = "export_tests.rs"]
mod tests;

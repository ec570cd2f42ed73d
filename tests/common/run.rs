//! Bakes with the real binary, as a user or a build farm would.

#[path = "call.rs"]
mod call;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use rebake::gpu::{Gpu, GpuError, GpuOptions};
use serde_json::Value;

pub use call::{rebake, said};

/// Writes a built-in scene into a folder.
pub fn builtin(name: &str, folder: &Path) -> PathBuf {
    let file = folder.join(format!("{name}.glb"));
    let output = rebake(&format!("scene {name} -o"), &[&file]);
    assert!(output.status.success(), "{name}: {}", said(&output));
    file
}

/// Bakes into a new folder of the scene's folder, under the validation layer where it is installed, and returns the
/// folder and its bake.json. Fails unless the bake succeeds in silence but for its stages.
pub fn bake(scene: &Path, out: &str, options: &str) -> (PathBuf, Value) {
    bake_that_says(None, scene, out, options)
}

/// As [`bake`], where warnings that hold `expected` are no surprise.
pub fn bake_that_says(
    expected: Option<&str>,
    scene: &Path,
    out: &str,
    options: &str,
) -> (PathBuf, Value) {
    let out = scene.with_file_name(out);
    let validate = if validation() { "--validate" } else { "" };
    let output = rebake(
        &format!("bake {validate} {options} --output"),
        &[&out, scene],
    );
    let name = scene.display();
    assert!(output.status.success(), "{name}: {}", said(&output));
    let silent = said(&output).lines().all(|line| {
        let warns = line.contains("WARN") || line.contains("ERROR");
        !warns || expected.is_some_and(|part| line.contains(part))
    });
    assert!(silent, "{name}: {}", said(&output));
    let report = std::fs::read(out.join("bake.json")).expect("bake.json");
    let report = serde_json::from_slice(&report).expect("bake.json is JSON");
    (out, report)
}

/// Whether the validation layer is installed.
fn validation() -> bool {
    static FOUND: OnceLock<bool> = OnceLock::new();
    *FOUND.get_or_init(|| {
        let options = GpuOptions {
            device: None,
            validate: true,
        };
        let found = !matches!(Gpu::new(&options), Err(GpuError::NoValidation));
        if !found {
            eprintln!("the validation layer is not installed: running without it");
        }
        found
    })
}

//! Bakes that must fail, and what they may leave behind.

use std::collections::BTreeMap;
use std::path::Path;

use super::run::{rebake, said};

/// The cheapest bake.
pub const TINY: &str = "--quality draft --texels 2k --paths 500 --clusters 8 --shadow-size 16";

/// Files below a folder, by path.
pub fn content(folder: &Path) -> BTreeMap<std::path::PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten() {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            found.extend(content(&path));
            found.insert(path, Vec::new());
        } else {
            found.insert(path.clone(), std::fs::read(&path).expect("a file"));
        }
    }
    found
}

/// Bakes and expects exit code 1 with one line on stderr that holds all of `words`, and nothing on stdout.
pub fn fails(options: &str, scene: &Path, out: &Path, words: &[&str]) {
    let output = rebake(&format!("bake -q {options} -o"), &[out, scene]);
    let line = said(&output);
    let what = format!("{options} {} {}: {line}", scene.display(), out.display());
    assert_eq!(output.status.code(), Some(1), "{what}");
    assert_eq!(line.trim_end().lines().count(), 1, "{what}");
    assert!(line.starts_with("error: "), "{what}");
    assert!(
        words.iter().all(|word| line.contains(word)),
        "{what}: without {words:?}"
    );
    assert!(output.stdout.is_empty(), "{what}");
}

//! Outputs stay whole, whatever fails while they are written: an earlier bake is replaced at once or not at all.

#[path = "common/failing.rs"]
mod failing;
#[path = "common/run.rs"]
mod run;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use failing::{TINY, content, fails};
use run::{bake, builtin, rebake, said};
use tempfile::{TempDir, tempdir};

/// A budget, device or disk may fail late; what an earlier bake wrote is then still there, whole, and nothing beside it.
#[test]
fn earlier_outputs_stay_whole_when_a_bake_fails() {
    let folder = tempdir().unwrap();
    let scene = builtin("furnace", folder.path());
    let (out, _) = bake(&scene, "out", TINY);
    let before = content(folder.path());
    assert!(before.keys().filter(|p| p.starts_with(&out)).count() >= 3);
    // bake.json is a folder that cannot be replaced by a file: the last steps fail.
    let blocked = folder.path().join("blocked");
    std::fs::create_dir_all(blocked.join("bake.json/kept")).unwrap();
    std::fs::write(blocked.join("scene.glb"), b"earlier").unwrap();
    let before_blocked = content(&blocked);
    let output = rebake(&format!("bake {TINY} -q -o"), &[&blocked, &scene]);
    if output.status.success() {
        assert!(blocked.join("bake.json").is_file());
    } else {
        assert!(content(&blocked) == before_blocked, "{}", said(&output));
    }
    fails("--device imaginary", &scene, &out, &["imaginary"]);
    let after = content(folder.path());
    assert!(
        after
            .iter()
            .filter(|(p, _)| p.starts_with(&out))
            .eq(before.iter().filter(|(p, _)| p.starts_with(&out)))
    );
    // The same bake again, over its own output.
    let (_, _) = bake(&scene, "out", TINY);
    let names = |files: &BTreeMap<std::path::PathBuf, Vec<u8>>| -> Vec<_> {
        files
            .keys()
            .filter(|p| p.starts_with(&out))
            .cloned()
            .collect()
    };
    assert_eq!(
        names(&before),
        names(&content(folder.path())),
        "litter beside the outputs"
    );
}

/// A file system of 64 KiB, if the system lets this process mount one.
struct SmallDisk(TempDir);

impl SmallDisk {
    fn mount() -> Option<Self> {
        let folder = tempdir().unwrap();
        let mount = Command::new("mount")
            .args(["-t", "tmpfs", "-o", "size=64k", "rebake-test"])
            .arg(folder.path())
            .output();
        mount
            .is_ok_and(|m| m.status.success())
            .then_some(Self(folder))
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let unmounted = Command::new("umount").arg(self.0.path()).status();
        assert!(unmounted.is_ok_and(|s| s.success()), "a mount is left");
    }
}

#[test]
fn a_full_disk_is_told_and_changes_nothing() {
    let Some(disk) = SmallDisk::mount() else {
        eprintln!("no file system can be mounted here: a full disk is not tested");
        return;
    };
    let folder = tempdir().unwrap();
    let scene = builtin("cornell", folder.path());
    let out = disk.0.path().join("out");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("lightmap_0.exr"), b"earlier").unwrap();
    let before = content(disk.0.path());
    fails(
        "--quality draft --texels 30k --paths 500 --clusters 8",
        &scene,
        &out,
        &["cannot write", "space"],
    );
    assert!(content(disk.0.path()) == before);
    // Nor is half a scene left where one is written.
    let big = disk.0.path().join("sphere.glb");
    let output = rebake("scene integrating-sphere -o", &[&big]);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(said(&output).contains("sphere.glb"), "{}", said(&output));
    assert!(content(disk.0.path()) == before);
}

/// Permissions stop everyone but root.
#[cfg(unix)]
#[test]
fn a_folder_that_cannot_be_written_is_told() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempdir().unwrap();
    let scene = builtin("furnace", folder.path());
    let locked = folder.path().join("locked");
    std::fs::create_dir(&locked).unwrap();
    std::fs::set_permissions(&locked, std::fs::Permissions::from_mode(0o555)).unwrap();
    if std::fs::write(locked.join("probe"), b"").is_ok() {
        eprintln!("permissions do not bind this user: /proc stands in");
        fails(
            TINY,
            &scene,
            Path::new("/proc/rebake-test"),
            &["cannot write", "/proc"],
        );
        return;
    }
    fails(
        TINY,
        &scene,
        &locked.join("out"),
        &["cannot write", "locked"],
    );
    std::fs::set_permissions(&locked, std::fs::Permissions::from_mode(0o755)).unwrap();
    assert_eq!(content(&locked).len(), 0);
}

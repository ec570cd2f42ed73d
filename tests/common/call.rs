//! Runs the real binary.

use std::path::Path;
use std::process::{Command, Output};

/// Runs `rebake` with arguments that are separated by blanks; paths come after them.
pub fn rebake(arguments: &str, paths: &[&Path]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_rebake"))
        .args(arguments.split_whitespace())
        .args(paths)
        .env_remove("RUST_LOG")
        .output()
        .expect("the binary starts")
}

/// What a run wrote to stderr.
pub fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

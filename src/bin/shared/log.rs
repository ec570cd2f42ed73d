//! What the library says: a log on stderr, and the trace that is asked for.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use rebake::scene::write_whole;
use rebake::trace;
use tracing_subscriber::prelude::*;

/// Sends the library's log to stderr, what `level` lets through unless RUST_LOG says otherwise, and spans to the trace that
/// is asked for.
pub fn start(level: &str, traced: Option<&Path>) -> anyhow::Result<Option<TraceFile>> {
    let filter =
        tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| level.into());
    let log = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .without_time()
        .with_target(false)
        .with_ansi(std::io::stderr().is_terminal())
        .with_filter(trace::without_device(filter));
    let registry = tracing_subscriber::registry().with(log);
    match traced {
        Some(path) => {
            let (recording, tracer) = trace::Recording::new();
            registry.with(tracer).init();
            TraceFile::new(path, recording).map(Some)
        }
        None => {
            registry.init();
            Ok(None)
        }
    }
}

/// The file that --trace names.
pub struct TraceFile {
    path: PathBuf,
    recording: trace::Recording,
}

impl TraceFile {
    /// Fails now rather than after hours if nothing can be written there.
    fn new(path: &Path, recording: trace::Recording) -> anyhow::Result<Self> {
        let folder = match path.parent() {
            Some(folder) if folder != Path::new("") => folder,
            _ => Path::new("."),
        };
        let place = || format!("--trace {}", path.display());
        tempfile::tempfile_in(folder).with_context(place)?;
        anyhow::ensure!(!path.is_dir(), "{} is a folder: name a file", place());
        Ok(Self {
            path: path.to_owned(),
            recording,
        })
    }

    /// Writes what was heard until now, whole or not at all.
    pub fn write(&self) -> anyhow::Result<()> {
        Ok(write_whole(&self.path, &self.recording.json())?)
    }
}

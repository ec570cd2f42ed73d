//! What the user sees: progress bars on a terminal, plain lines elsewhere, JSON lines with `--json`, one line an error.

use std::collections::BTreeMap;
use std::io::{IsTerminal as _, Write as _};
use std::process::ExitCode;
use std::sync::Mutex;
use std::time::Duration;

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use rebake::bake::{Listener, Stage};
use serde_json::json;

use super::args::Args;
use super::log::{self, TraceFile};

/// Sends the library's log to stderr, and spans to the trace that is asked for.
pub fn start_log(args: &Args) -> anyhow::Result<Option<TraceFile>> {
    let level = match (args.quiet, args.verbose) {
        (true, _) => "error",
        (_, 0) => "rebake=warn",
        (_, 1) => "rebake=info",
        _ => "rebake=trace",
    };
    log::start(level, args.device.trace.as_deref())
}

/// Prints a line of results.
pub fn print(line: impl std::fmt::Display) -> std::io::Result<()> {
    writeln!(std::io::stdout().lock(), "{line}")
}

/// Whether printing failed because nobody reads any more.
pub fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error
        .downcast_ref::<std::io::Error>()
        .is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
}

/// One line that names the thing, and a failing exit code.
pub fn fail(error: &anyhow::Error, json: bool) -> ExitCode {
    let text = format!("{error:#}").replace('\n', " ");
    if json {
        eprintln!("{}", json!({ "error": text }));
    } else {
        eprintln!("error: {text}");
    }
    ExitCode::FAILURE
}

/// Shows a bake's stages.
pub struct Console {
    mode: Mode,
    bars: Mutex<BTreeMap<Stage, ProgressBar>>,
    all: MultiProgress,
}

enum Mode {
    Quiet,
    Json,
    Plain,
    Bars,
}

impl Console {
    pub fn new(args: &Args) -> Self {
        let mode = match (args.json, args.quiet) {
            (true, _) => Mode::Json,
            (_, true) => Mode::Quiet,
            _ if std::io::stderr().is_terminal() => Mode::Bars,
            _ => Mode::Plain,
        };
        Self {
            mode,
            bars: Mutex::default(),
            all: MultiProgress::new(),
        }
    }

    /// A line on stdout for people; nothing with `--json` or `-q`.
    pub fn say(&self, text: &str) -> std::io::Result<()> {
        if matches!(self.mode, Mode::Plain | Mode::Bars) {
            print(text)
        } else {
            Ok(())
        }
    }
}

impl Console {
    /// A line on stderr of what is done next; nothing with `-q`.
    pub fn note(&self, text: &str) {
        match self.mode {
            Mode::Quiet => {}
            Mode::Json => eprintln!("{}", json!({ "now": text })),
            Mode::Plain | Mode::Bars => eprintln!("{text}"),
        }
    }
}

impl Listener for Console {
    fn at(&self, stage: Stage, done: u64, total: u64) {
        if !matches!(self.mode, Mode::Bars) {
            return;
        }
        let mut bars = self.bars.lock().unwrap_or_else(|e| e.into_inner());
        let bar = bars.entry(stage).or_insert_with(|| {
            let template = if stage == Stage::Accumulate {
                "{prefix:>10} {wide_bar} {pos}/{len} lights, {per_sec}, {eta} left"
            } else {
                "{prefix:>10} {spinner} {elapsed}"
            };
            let style = ProgressStyle::with_template(template)
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            let bar = self.all.add(
                ProgressBar::new(total)
                    .with_style(style)
                    .with_prefix(stage.name()),
            );
            bar.enable_steady_tick(Duration::from_millis(120));
            bar
        });
        bar.set_length(total);
        bar.set_position(done);
    }

    fn ended(&self, stage: Stage, took: Duration) {
        let seconds = took.as_secs_f64();
        match self.mode {
            Mode::Quiet => {}
            Mode::Json => eprintln!("{}", json!({ "stage": stage.name(), "seconds": seconds })),
            Mode::Plain => eprintln!("{:>10} {seconds:.2} s", stage.name()),
            Mode::Bars => {
                if let Some(bar) = self
                    .bars
                    .lock()
                    .unwrap_or_else(|e| e.into_inner())
                    .remove(&stage)
                {
                    bar.finish_and_clear();
                }
                let line = format!("{:>10} {seconds:.2} s", stage.name());
                if self.all.println(&line).is_err() {
                    eprintln!("{line}");
                }
            }
        }
    }
}

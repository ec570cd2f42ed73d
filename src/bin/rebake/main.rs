//! The command line: parse, resolve, run, one error exit.

mod args;
mod bake;
mod bench;
mod compare;
mod console;
mod devices;
#[path = "../shared/log.rs"]
mod log;
#[path = "../shared/options.rs"]
mod options;
mod plot;
mod replay;
mod scene;
#[path = "../shared/values.rs"]
mod values;

use std::process::ExitCode;

use clap::Parser as _;

use args::{Args, Command};

fn main() -> ExitCode {
    let start = std::time::Instant::now();
    let args = Args::parse();
    let trace = match console::start_log(&args) {
        Ok(trace) => trace,
        Err(error) => return console::fail(&error, args.json),
    };
    if let Some(threads) = args.threads {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.get())
            .build_global();
        if let Err(error) = pool {
            return console::fail(&anyhow::anyhow!("--threads {threads}: {error}"), args.json);
        }
    }
    let result = tracing::info_span!("rebake").in_scope(|| match &args.command {
        Command::Bake(command) => bake::run(&args, command, start),
        Command::Replay(command) => replay::run(&args, command, start),
        Command::Bench(command) => bench::run(&args, command),
        Command::Compare(command) => compare::run(&args, command),
        Command::Devices => devices::run(&args),
        Command::Scene(command) => scene::run(&args, command),
    });
    // A run that failed is one to look at, too.
    let traced = trace.map_or(Ok(()), |trace| trace.write());
    let result = result.and(traced);
    match result {
        // Whoever read our output has read enough.
        Err(error) if console::is_broken_pipe(&error) => ExitCode::SUCCESS,
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => console::fail(&error, args.json),
    }
}

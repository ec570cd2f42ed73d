//! The viewer: parse, resolve, run, one error exit.

mod args;
#[path = "../shared/log.rs"]
mod log;
#[path = "../shared/options.rs"]
mod options;
#[path = "../shared/values.rs"]
mod values;

use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context as _;
use clap::Parser as _;
use rebake::bake::{Baker, Job, Options, Silent};
use rebake::gpu::Gpu;
use rebake::lightmap::AtlasOptions;
use rebake::view::script::Line;
use rebake::view::{Headless, HeadlessOptions, Reference, WindowOptions, reference, run_window};

use args::Args;

fn main() -> ExitCode {
    let args = Args::parse();
    let trace = match log::start("rebake=warn", args.device.trace.as_deref()) {
        Ok(trace) => trace,
        Err(error) => return fail(&error),
    };
    let result = tracing::info_span!("viewer").in_scope(|| run(&args));
    // A run that failed is one to look at, too.
    let traced = trace.map_or(Ok(()), |trace| trace.write());
    match result.and(traced) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => fail(&error),
    }
}

fn fail(error: &anyhow::Error) -> ExitCode {
    eprintln!("error: {}", format!("{error:#}").replace('\n', " "));
    ExitCode::FAILURE
}

fn run(args: &Args) -> anyhow::Result<()> {
    let options = args.device.options();
    let (Some(script), Some(folder)) = (&args.script, &args.frames_dir) else {
        let folder = args.output.clone();
        return Ok(run_window(WindowOptions {
            scene: args.scene.source(),
            size: args.size.0,
            slice: args.frame(),
            job: job(args),
            gpu: options,
            folder: folder.unwrap_or_else(|| ".".into()),
            reference: args.reference.clone(),
            stats: args.stats.clone(),
        })?);
    };
    let text =
        std::fs::read_to_string(script).with_context(|| format!("reading {}", script.display()))?;
    let lines = Line::parse_all(&text).map_err(|(line, error)| {
        anyhow::Error::new(error).context(format!("{} line {line}", script.display()))
    })?;
    let (gpu, loaded) = rayon::join(|| Gpu::new(&options), || args.scene.source().load());
    let (scene, document) = loaded?;
    let gpu = gpu?;
    let mut job = job(args);
    let reference = match &args.reference {
        Some(path) => {
            reference::adopt(&mut job, path, &args.scene.path, &scene)?;
            Some(Arc::new(Reference::load(path)?))
        }
        None => None,
    };
    let mut baker = Baker::new(&gpu, scene, document, &job, &Silent)?;
    let options = HeadlessOptions {
        size: args.size.0,
        frame: args.frame().unwrap_or(Duration::from_millis(16)),
        folder: folder.clone(),
        reference,
        jpeg: args.jpeg,
    };
    let mut headless = Headless::new(&gpu, &mut baker, options)?;
    let base = script.parent().unwrap_or(std::path::Path::new("."));
    let time = args.seconds.map_or(Duration::ZERO, Duration::from_secs_f32);
    let rounds = headless
        .repeat(&lines, base, time)
        .with_context(|| script.display().to_string())?;
    let frames = headless.frames();
    if let Some(path) = &args.stats {
        let stats = headless.statistics();
        let written = std::fs::write(path, format!("{stats:#}\n"));
        written.with_context(|| format!("writing {}", path.display()))?;
    }
    drop(headless);
    gpu.check_validation()?;
    let times = if rounds > 1 {
        format!(", {rounds} times")
    } else {
        String::new()
    };
    println!("{}: {frames} frames{times}", folder.display());
    Ok(())
}

fn job(args: &Args) -> Job {
    Job {
        atlas: AtlasOptions::with_texels(args.scene.texels),
        options: Options {
            quality: args.scene.quality,
            ..Options::default()
        },
        kept_maps: args.edits.kept_maps(),
        ..Job::default()
    }
}

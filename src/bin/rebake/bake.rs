//! `rebake bake`: load, light, bake, write.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context as _;
use rebake::bake::{self, AtlasReport, Baked, Job, Options, Report, Settings, output};
use rebake::gpu::Gpu;
use rebake::lightmap::{AtlasOptions, export};
use rebake::scene::{Document, Scene};
use serde::Deserialize;
use serde_json::json;
use tracing::info_span;

use super::args::{self, Args, Clusters};
use super::console::{Console, print};

/// What `--settings` needs of a bake.json.
#[derive(Deserialize)]
struct Recorded {
    settings: Settings,
    atlas: AtlasReport,
}

pub fn run(args: &Args, command: &args::Bake, start: Instant) -> anyhow::Result<()> {
    let console = Console::new(args);
    let (gpu, scene, document) = prepare(args, command)?;
    // No edit follows.
    let job = Job {
        kept_maps: 0,
        ..job(command)?
    };
    let baked = bake::bake(&gpu, scene, document, &job, &console)?;
    gpu.check_validation()?;
    let (report, files) = write(&command.output, baked, Vec::new(), start)?;

    let seconds = start.elapsed().as_secs_f64();
    if args.json {
        print(format_args!(
            "{}",
            json!({ "output": command.output, "files": files, "seconds": seconds, "report": report })
        ))?;
        return Ok(());
    }
    console.say(&format!(
        "{}; {seconds:.2} s on {}{}",
        summary(&command.output, &report),
        report.device.name,
        if job.verify {
            "; verify: identical"
        } else {
            ""
        },
    ))?;
    if report.stopped_early {
        console.say(&format!(
            "stopped by --budget at an estimated error of {:.3} %",
            report.estimated_error * 100.0
        ))?;
    }
    Ok(())
}

/// The device, and the scene with the lights that the options add.
pub fn prepare(args: &Args, command: &args::Bake) -> anyhow::Result<(Gpu, Scene, Document)> {
    let options = args.device.options();
    // The driver starts while the file is read.
    let (gpu, loaded) = rayon::join(
        || info_span!("device").in_scope(|| Gpu::new(&options)),
        || info_span!("load").in_scope(|| command.scene.source().load()),
    );
    let (scene, document) = loaded?;
    let gpu = gpu?;
    export::check_output(&command.output)?;
    Ok((gpu, scene, document))
}

/// Writes a bake's folder, `extra` files included; returns what bake.json says and the files.
pub fn write(
    folder: &Path,
    baked: Baked,
    extra: Vec<(String, Vec<u8>)>,
    start: Instant,
) -> anyhow::Result<(Report, Vec<PathBuf>)> {
    let Baked {
        lightmap,
        baker,
        mut report,
    } = baked;
    report.total_seconds = start.elapsed().as_secs_f64();
    let written = info_span!("write")
        .in_scope(|| output::write(folder, &baker, &lightmap, &report, extra))?;
    Ok((report, written))
}

/// What a bake came to, in a line.
pub fn summary(output: &Path, report: &Report) -> String {
    let lights: u64 = report.counts.virtual_lights.values().sum();
    format!(
        "{}: {} texels on {} page{} of {}, {} cells, {lights} virtual lights, {} paths",
        output.display(),
        report.counts.texels,
        report.atlas.pages,
        if report.atlas.pages == 1 { "" } else { "s" },
        report.atlas.page_size,
        report.counts.clusters,
        report.counts.paths,
    )
}

pub fn job(command: &args::Bake) -> anyhow::Result<Job> {
    let repeat = command.settings.as_ref().map(|path| -> anyhow::Result<_> {
        let text =
            std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
        let recorded: Recorded = serde_json::from_str(&text).with_context(|| {
            format!(
                "{} is not a bake.json that this version wrote",
                path.display()
            )
        })?;
        recorded
            .settings
            .check()
            .with_context(|| path.display().to_string())?;
        Ok((recorded.settings, recorded.atlas))
    });
    Ok(Job {
        atlas: AtlasOptions {
            density: command.density,
            page_size: command.page_size,
            ..AtlasOptions::with_texels(command.scene.texels)
        },
        options: Options {
            quality: command.scene.quality,
            clusters: match command.clusters {
                Some(Clusters::Count(n)) => Some(n),
                Some(Clusters::Auto) | None => None,
            },
            paths: command.paths,
            bounces: command.bounces,
            seed: command.seed,
            shadow_size: command.shadow_size,
            indirect_only: command.indirect_only,
        },
        repeat: repeat.transpose()?,
        budget: command.budget,
        verify: command.verify,
        ..Job::default()
    })
}

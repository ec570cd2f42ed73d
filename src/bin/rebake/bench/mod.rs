//! `rebake bench`: measure, print tables, write figures, compare them with earlier ones.

mod args;
mod grid;
mod plots;
mod tables;

use std::cell::{Cell, RefCell};
use std::path::Path;

use anyhow::{Context as _, bail};
use rebake::bake::{Job, Options, Quality};
use rebake::bench::{
    self, Comparison, Figures, Part, Plan, Scenario, SceneFigures, Witness, compare, measure,
};
use rebake::gpu::Gpu;
use rebake::lightmap::AtlasOptions;
use rebake::scene::write_whole;

pub use args::Bench;

use super::args::Args;
use super::console::{Console, print};
use super::replay;

/// Scenes of the paper's evaluation, rebuilt.
const SCENES: [&str; 3] = ["museum", "town-square", "warehouse"];

pub fn run(args: &Args, command: &Bench) -> anyhow::Result<()> {
    let console = Console::new(args);
    // Before hours of work, not after.
    let old = command.compare.as_deref().map(read).transpose()?;
    if let Some(folder) = &command.plots {
        std::fs::create_dir_all(folder).with_context(|| format!("--plots {}", folder.display()))?;
    }
    let open = || Gpu::new(&args.device.options());
    let gpu = open()?;
    let plan = plan(command, gpu.info().kind == "CPU")?;
    let names: Vec<String> = if command.scenes.is_empty() {
        SCENES.map(str::to_owned).to_vec()
    } else {
        command.scenes.clone()
    };
    let figures = Figures {
        generator: concat!("rebake ", env!("CARGO_PKG_VERSION")).into(),
        device: gpu.info().name.clone(),
        driver: gpu.info().driver.clone(),
        cpu: processor(),
        threads: bench::threads(),
        seed: command.seed,
        settings: settings(command),
        repeats: plan.repeats,
        warm_up: plan.warm_up,
        scenes: Vec::new(),
    };
    console.say(&format!(
        "{}, {}; {}, {} threads; {}; seed {}; medians of {} runs (least to largest) after {} to warm up",
        figures.device,
        figures.driver,
        figures.cpu,
        figures.threads,
        figures.settings,
        figures.seed,
        figures.repeats,
        figures.warm_up,
    ))?;
    let record = Record {
        console: &console,
        path: command.output.as_deref(),
        figures: RefCell::new(figures),
        at: Cell::new(0),
    };
    for name in &names {
        // Anew for each scene: the most memory that was taken is then this scene's.
        let gpu = open()?;
        let scene = measure(&gpu, name, &plan, &record).with_context(|| name.clone())?;
        gpu.check_validation()?;
        for table in tables::of_scene(&scene) {
            console.say(&table)?;
        }
        record.keep(&scene);
        record.at.update(|at| at + 1);
    }
    let figures = record.figures.into_inner();
    let parts = &plan.parts;
    if parts.contains(&Part::Table) || parts.contains(&Part::Response) {
        console.say(&tables::overview(&figures.scenes))?;
    }
    let json = json(&figures)?;
    if let Some(path) = &command.output {
        write_whole(path, &json)?;
        console.say(&path.display().to_string())?;
    }
    if let Some(folder) = &command.plots {
        for file in plots::write(folder, &figures)? {
            console.say(&file.display().to_string())?;
        }
    }
    if args.json {
        print(String::from_utf8_lossy(&json))?;
    }
    match old {
        Some(old) => judge(&console, &compare(&old, &figures), command.threshold),
        None => Ok(()),
    }
}

/// What has come out so far: on disk as soon as it is known, since some runs take hours.
struct Record<'a> {
    console: &'a Console,
    path: Option<&'a Path>,
    figures: RefCell<Figures>,
    /// Scenes that are done.
    at: Cell<usize>,
}

impl Record<'_> {
    /// What is known of the scene that is measured.
    fn keep(&self, scene: &SceneFigures) {
        let mut figures = self.figures.borrow_mut();
        figures.scenes.truncate(self.at.get());
        figures.scenes.push(scene.clone());
        if let Some(path) = self.path
            && let Err(error) = json(&figures).and_then(|bytes| Ok(write_whole(path, &bytes)?))
        {
            // Measuring goes on: the end will say the same as an error.
            self.console.note(&format!("{error:#}"));
        }
    }
}

impl Witness for Record<'_> {
    fn told(&self, what: &str) {
        self.console.note(what);
    }

    fn known(&self, scene: &SceneFigures) {
        self.keep(scene);
    }
}

fn json(figures: &Figures) -> anyhow::Result<Vec<u8>> {
    serde_json::to_vec_pretty(figures).context("writing the figures")
}

/// Prints ratios; an error if any figure has got worse by more than `threshold`.
fn judge(console: &Console, rows: &[Comparison], threshold: f64) -> anyhow::Result<()> {
    if rows.is_empty() {
        bail!("--compare: the two runs have no figure in common; give the same scenes and parts");
    }
    console.say(&tables::comparison(rows))?;
    let worse: Vec<_> = rows.iter().filter(|r| r.gain * threshold < 1.0).collect();
    let worst = worse.iter().min_by(|a, b| a.gain.total_cmp(&b.gain));
    match worst {
        Some(worst) => bail!(
            "{} of {} figures are worse than before by more than {threshold}x; the worst is {}: {:.4} {} became {:.4}",
            worse.len(),
            rows.len(),
            worst.name,
            worst.old,
            worst.unit,
            worst.new,
        ),
        None => Ok(()),
    }
}

fn read(path: &Path) -> anyhow::Result<Figures> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
    serde_json::from_str(&text).with_context(|| {
        format!(
            "{} is not what `rebake bench` of this version writes",
            path.display()
        )
    })
}

fn plan(command: &Bench, on_cpu: bool) -> anyhow::Result<Plan> {
    let pick = |given: &[u64], on_gpu: &[u64], most: u64| -> Vec<u64> {
        if given.is_empty() {
            let all = on_gpu.iter().copied();
            all.filter(|n| !on_cpu || *n <= most).collect()
        } else {
            given.to_vec()
        }
    };
    let small = |numbers: Vec<u64>| numbers.into_iter().map(|n| n.min(1 << 30) as u32).collect();
    let scenarios = command
        .script
        .iter()
        .map(|path| {
            Ok(Scenario {
                name: path
                    .file_stem()
                    .unwrap_or_default()
                    .to_string_lossy()
                    .into(),
                script: replay::read(path, false)?,
                folder: Some(path.parent().unwrap_or(Path::new(".")).to_owned()),
            })
        })
        .collect::<anyhow::Result<_>>()?;
    Ok(Plan {
        job: Job {
            atlas: AtlasOptions::with_texels(command.texels),
            options: Options {
                quality: command.quality,
                clusters: command.clusters,
                paths: command.paths,
                shadow_size: command.shadow_size,
                seed: command.seed,
                ..Options::default()
            },
            // What is kept is measured where edits are.
            kept_maps: 0,
            ..Job::default()
        },
        parts: if command.only.is_empty() {
            Part::ALL.to_vec()
        } else {
            command.only.iter().map(|p| p.part()).collect()
        },
        repeats: command.repeats,
        warm_up: command.warm_up,
        paths: pick(
            &command.sweep_paths,
            &[1 << 14, 1 << 16, 1 << 18, 1 << 20],
            1 << 20,
        ),
        texels: pick(
            &command.sweep_texels,
            &[1 << 18, 1 << 20, 1 << 22, 1 << 24],
            1 << 22,
        ),
        triangles: pick(
            &command.sweep_triangles,
            &[10_000, 100_000, 1_000_000, 4_000_000],
            1_000_000,
        ),
        batches: small(pick(&command.sweep_batches, &[1, 2, 4, 8, 16, 32], 32)),
        cells: small(pick(
            &command.sweep_cells,
            &[300, 1000, 3000, 10_000, 30_000, 100_000],
            3000,
        )),
        scenarios,
    })
}

fn settings(command: &Bench) -> String {
    let quality = match command.quality.unwrap_or(Quality::Preview) {
        Quality::Draft => "draft",
        Quality::Preview => "preview",
        Quality::Production => "production",
    };
    let mut text = format!("quality {quality}");
    let mut add = |name: &str, value: Option<u64>| {
        if let Some(value) = value {
            text += &format!(", {name} {value}");
        }
    };
    add("texels", command.texels);
    add("clusters", command.clusters.map(u64::from));
    add("paths", command.paths);
    add("shadow size", command.shadow_size.map(u64::from));
    text
}

/// The processor's name, where Linux tells it.
fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find(|l| l.starts_with("model name"));
    line.and_then(|l| l.split(':').nth(1))
        .map_or_else(|| "unknown processor".into(), |name| name.trim().to_owned())
}

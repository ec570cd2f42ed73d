//! `rebake replay`: bake, play a script of edits, write the bake of the edited scene and how the map followed.

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use glam::Vec3;
use rebake::bake::{BakeError, Baked, Priority, Replay, ReplayOptions, ScriptError, Step};
use rebake::lightmap::{Lightmap, exr};
use rebake::scene::Camera;
use rebake::scene::edit::Command;
use serde_json::json;

use super::args::{self, Args};
use super::bake;
use super::console::{Console, print};

/// Milliseconds of updates between two looks at the map, where snapshots are wanted and nobody says how many.
const SNAPSHOT_FRAME_MS: f32 = 33.0;

pub fn run(args: &Args, command: &args::Replay, start: Instant) -> anyhow::Result<()> {
    let console = Console::new(args);
    let script = read(&command.script, command.keep_going)?;
    let (gpu, scene, document) = bake::prepare(args, &command.bake)?;
    let mut job = bake::job(&command.bake)?;
    job.kept_maps = command.edits.kept_maps();
    // It is the map after the edits that --verify is about.
    let verify = std::mem::take(&mut job.verify);
    let Baked {
        mut baker,
        report: first,
        ..
    } = rebake::bake::bake(&gpu, scene, document, &job, &console)?;
    baker.set_turns_at(command.turns_at);
    baker.set_priority(match command.priority {
        args::Priority::Bounds => Priority::Bounds,
        args::Priority::Paths => Priority::Paths,
    });
    let options = ReplayOptions {
        keep_going: command.keep_going,
        // Without a look now and then there is nothing to keep.
        frame: command
            .frame_ms
            .or((command.snapshots > 0).then_some(SNAPSHOT_FRAME_MS))
            .map(|ms| Duration::from_secs_f32(ms / 1e3)),
        camera: command.camera.map(|[x, y, z, to_x, to_y, to_z]| {
            Camera::looking(Vec3::new(x, y, z), Vec3::new(to_x, to_y, to_z))
        }),
    };
    let folder = command.script.parent().unwrap_or(Path::new("."));
    let mut snapshots = Snapshots::new(command.snapshots);
    let replay = baker
        .play(
            &script,
            folder,
            &options,
            &console,
            &mut |baker, seconds| snapshots.look(seconds, || baker.lightmap()),
        )
        .map_err(|ScriptError { line, cause }| {
            anyhow::Error::new(cause).context(format!("{} line {line}", command.script.display()))
        })?;
    let rebake = if command.rebake {
        // It compares every bit, too.
        Some(baker.rebake(options.camera.as_ref())?)
    } else {
        if verify {
            baker.verify()?;
        }
        None
    };
    gpu.check_validation()?;

    let lightmap = baker.lightmap()?;
    let report = baker.report();
    let mut extra = vec![
        (
            "replay.json".to_owned(),
            serde_json::to_vec_pretty(&json!({
                "bake": { "seconds": first.seconds, "total_seconds": first.total_seconds },
                "replay": replay,
                "rebake": rebake,
            }))
            .context("writing the replay's report")?,
        ),
        ("convergence.csv".to_owned(), csv(&replay).into_bytes()),
        (
            "convergence.png".to_owned(),
            super::plot::convergence(&replay, &script, rebake.as_deref())?,
        ),
    ];
    extra.extend(snapshots.files()?);
    let baked = Baked {
        lightmap,
        baker,
        report,
    };
    let (report, files) = bake::write(&command.bake.output, baked, extra, start)?;
    let seconds = start.elapsed().as_secs_f64();
    if args.json {
        print(format_args!(
            "{}",
            json!({ "output": command.bake.output, "files": files, "seconds": seconds, "report": report,
                "replay": replay, "verified": verify })
        ))?;
        return Ok(());
    }
    for played in &replay.script {
        if let Some(why) = &played.refused {
            console.say(&format!("line {}: refused: {why}", played.line))?;
        }
    }
    console.say(&format!(
        "{}; {} updates of {} lights in {:.2} s{}",
        bake::summary(&command.bake.output, &report),
        replay.updates,
        replay.lights,
        replay.seconds,
        if verify { "; verify: identical" } else { "" },
    ))?;
    Ok(())
}

/// The script's commands with their line numbers; empty lines are none. With `keep_going` lines that are no command are
/// left out, with a warning.
pub fn read(path: &Path, keep_going: bool) -> anyhow::Result<Vec<(usize, Command)>> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
    let mut script = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        if line.trim().is_empty() {
            continue;
        }
        match Command::parse(line) {
            Ok(command) => script.push((number, command)),
            Err(error) if keep_going => {
                tracing::warn!("{} line {number}: {error}, left out", path.display());
            }
            Err(error) => {
                return Err(error).with_context(|| format!("{} line {number}", path.display()));
            }
        }
    }
    Ok(script)
}

/// convergence.csv: a line an update.
fn csv(replay: &Replay) -> String {
    let mut out = String::from(
        "update,seconds,kind,cell,lights subtracted,lights added,lights limited,invalid flux [lm],RMS [lux],RMS share,viewport RMS [lux],viewport share,mean [lux],beyond both ends [lux]\n",
    );
    let share = |rms: f64, first: f64| if first > 0.0 { rms / first } else { 0.0 };
    let tail = |rms: f64, viewport: f64, mean: f64, beyond: f64| {
        format!(
            "{rms:.9},{:.9},{viewport:.9},{:.9},{mean:.9},{beyond:.9}\n",
            share(rms, replay.initial_rms),
            share(viewport, replay.initial_viewport)
        )
    };
    let first = tail(
        replay.initial_rms,
        replay.initial_viewport,
        replay.initial_mean,
        0.0,
    );
    out.push_str(&format!("0,0,,,0,0,0,,{first}"));
    for (number, step) in (1..).zip(&replay.steps) {
        let Step {
            seconds,
            cell,
            subtracted,
            added,
            limited,
            invalid_flux,
            rms,
            viewport,
            mean,
            beyond,
            ..
        } = step;
        let kind = step.kind.name();
        out.push_str(&format!(
            "{number},{seconds:.6},{kind},{cell},{subtracted},{added},{limited},{invalid_flux:.6},{}",
            tail(*rms, *viewport, *mean, *beyond)
        ));
    }
    out
}

/// Lightmaps along the way: the first look at or after each of evenly spaced times. How long it all takes is not known
/// before its end, so twice as many as wanted are kept, and thinned out whenever there are too many.
struct Snapshots {
    most: usize,
    /// Seconds between two.
    spacing: f64,
    taken: Vec<(f64, Lightmap)>,
}

impl Snapshots {
    fn new(most: u32) -> Self {
        Self {
            most: most as usize,
            spacing: 0.0,
            taken: Vec::new(),
        }
    }

    fn look<E: Into<BakeError>>(
        &mut self,
        seconds: f64,
        map: impl FnOnce() -> Result<Lightmap, E>,
    ) -> Result<(), BakeError> {
        let due = self
            .taken
            .last()
            .is_none_or(|(last, _)| seconds >= last + self.spacing);
        if self.most == 0 || !due {
            return Ok(());
        }
        self.taken.push((seconds, map().map_err(Into::into)?));
        if self.taken.len() > 2 * self.most {
            let mut keep = false;
            self.taken.retain(|_| {
                keep = !keep;
                keep
            });
            self.spacing = seconds / self.taken.len() as f64;
        }
        Ok(())
    }

    /// `snapshot_KK_page_P.exr`, in order of time.
    fn files(self) -> anyhow::Result<Vec<(String, Vec<u8>)>> {
        let step = self.taken.len() as f64 / self.most.max(1) as f64;
        let mut files = Vec::new();
        for k in 0..self.most.min(self.taken.len()) {
            let at = if step > 1.0 {
                (k as f64 * step) as usize
            } else {
                k
            };
            let (seconds, map) = &self.taken[at];
            for (page, texels) in map.pages.iter().enumerate() {
                let bytes = exr::encode(map.page_size, texels, &format!("{seconds:.3} s"))?;
                files.push((format!("snapshot_{k:03}_{page}.exr"), bytes));
            }
        }
        Ok(files)
    }
}

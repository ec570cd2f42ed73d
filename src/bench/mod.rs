//! What everything costs: bakes, sweeps and edits of whole scenes, measured over and over, as figures that later runs can be
//! compared with.

mod compare;
mod figure;
mod frames;
mod limits;
mod response;
mod sweeps;
mod table;

use serde::{Deserialize, Serialize};

use crate::bake::{BakeError, Job, ScriptError};
use crate::gpu::{Gpu, GpuError};
use crate::scene::{SceneError, builtin};
use crate::view::ViewError;

pub use compare::{Comparison, compare};
pub use figure::{Better, Figure, Line, Point, Series, number};
pub use response::Scenario;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Whole bakes: IBGI's table 1, VPL13's pre-processing, seconds by stage, milliseconds and rates by pass.
    Table,
    /// Creation of virtual lights over the number of VPLs (VPL13 fig. 12).
    Creation,
    /// Milliseconds per virtual light over texels (VPL13 fig. 13).
    Texels,
    /// Milliseconds per depth map over triangles.
    Triangles,
    /// Milliseconds per virtual light over the lights of a batch.
    Batches,
    /// Milliseconds per virtual light and updates per second over cells.
    Cells,
    /// How the map follows edits (IBGI fig. 11).
    Response,
    /// An edit's updates limited to the shadows of what it changed, beside whole ones.
    Limits,
}

impl Part {
    /// All of them.
    pub const ALL: [Part; 8] = [
        Part::Table,
        Part::Creation,
        Part::Texels,
        Part::Triangles,
        Part::Batches,
        Part::Cells,
        Part::Response,
        Part::Limits,
    ];
}

/// What to measure, how often, and where along each sweep.
#[derive(Clone, Debug)]
pub struct Plan {
    /// How scenes are baked.
    pub job: Job,
    /// Which parts.
    pub parts: Vec<Part>,
    /// Runs that count; at least 1.
    pub repeats: u32,
    /// Runs before them that do not: shaders are compiled, caches are filled.
    pub warm_up: u32,
    /// Light paths of [`Part::Creation`].
    pub paths: Vec<u64>,
    /// Texels of [`Part::Texels`].
    pub texels: Vec<u64>,
    /// Triangles of [`Part::Triangles`], reached by cutting the scene's until there are as many.
    pub triangles: Vec<u64>,
    /// Lights of a batch of [`Part::Batches`], 1 to 32.
    pub batches: Vec<u32>,
    /// Cells of [`Part::Cells`].
    pub cells: Vec<u32>,
    /// Edits of a scene, besides those of the built-in ones.
    pub scenarios: Vec<Scenario>,
}

/// A scene's figures.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SceneFigures {
    /// Its name, as it was asked for.
    pub scene: String,
    /// Single ones.
    pub figures: Vec<Figure>,
    /// Those along a sweep.
    pub series: Vec<Series>,
    /// What could not be measured, and why.
    pub missing: Vec<String>,
}

/// All that was measured: what `--json` writes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Figures {
    /// The program and its version.
    pub generator: String,
    /// The device.
    pub device: String,
    /// Its driver and version.
    pub driver: String,
    /// The host's processor; empty where the system does not tell.
    pub cpu: String,
    /// Threads on the host's side.
    pub threads: usize,
    /// Chooses the random sequences.
    pub seed: u32,
    /// The preset, and what departs from it.
    pub settings: String,
    /// Runs that count.
    pub repeats: u32,
    /// Runs before them.
    pub warm_up: u32,
    /// Scene by scene.
    pub scenes: Vec<SceneFigures>,
}

/// Why something could not be measured.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// The scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The bake.
    #[error(transparent)]
    Bake(#[from] BakeError),
    /// The device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// A script.
    #[error(transparent)]
    Script(#[from] ScriptError),
    /// A picture.
    #[error(transparent)]
    View(#[from] ViewError),
    /// Files that scripts of built-in scenes name.
    #[error("writing to the folder for temporary files: {0} (TMPDIR chooses another)")]
    Temporary(#[from] std::io::Error),
}

/// Who hears of a measurement while it goes on: what is cut off has said all that it knew.
pub trait Witness {
    /// What is measured next, or has just come out.
    fn told(&self, what: &str);
    /// All that is known of the scene so far.
    fn known(&self, figures: &SceneFigures);
}

/// Measures all that `plan` asks for on one scene: a built-in one by name, or a file.
///
/// # Errors
/// A scene that cannot be read or baked at all. Points of a sweep that do not fit the device's memory are listed in
/// [`SceneFigures::missing`] instead.
pub fn measure(
    gpu: &Gpu,
    scene: &str,
    plan: &Plan,
    witness: &dyn Witness,
) -> Result<SceneFigures, BenchError> {
    let (loaded, document) =
        tracing::info_span!("load", scene).in_scope(|| builtin::open(scene))?;
    loaded.validate()?;
    let mut bench = Bench {
        gpu,
        plan,
        name: scene,
        scene: loaded,
        document,
        witness,
        out: SceneFigures {
            scene: scene.to_owned(),
            figures: Vec::new(),
            series: Vec::new(),
            missing: Vec::new(),
        },
    };
    for part in &plan.parts {
        match part {
            Part::Table => bench.table()?,
            Part::Creation => bench.creation()?,
            Part::Texels => bench.texels()?,
            Part::Triangles => bench.triangles()?,
            Part::Batches => bench.batches()?,
            Part::Cells => bench.cells()?,
            Part::Response => bench.response()?,
            Part::Limits => bench.limits()?,
        }
        witness.known(&bench.out);
    }
    Ok(bench.out)
}

/// Threads that the host's side of a bake has.
pub fn threads() -> usize {
    rayon::current_num_threads()
}

/// A scene on the bench.
struct Bench<'a> {
    gpu: &'a Gpu,
    plan: &'a Plan,
    name: &'a str,
    scene: crate::scene::Scene,
    document: crate::scene::Document,
    witness: &'a dyn Witness,
    out: SceneFigures,
}

impl Bench<'_> {
    fn tell(&self, what: &str) {
        self.witness.told(&format!("{}: {what}", self.name));
    }

    /// A point of a sweep, the series' next.
    fn point(&mut self, series: &str, over: &str, point: Point) {
        let figures: Vec<String> = point.figures.iter().map(Figure::to_string).collect();
        self.tell(&format!(
            "{series} at {} {over}: {}",
            number(point.at),
            figures.join(", ")
        ));
        let all = &mut self.out.series;
        match all.iter_mut().find(|s| s.name == series) {
            Some(found) => found.points.push(point),
            None => all.push(Series {
                name: series.into(),
                over: over.into(),
                points: vec![point],
            }),
        }
        self.witness.known(&self.out);
    }

    /// Every run that counts, after those that do not.
    fn repeat<T>(
        &self,
        what: &str,
        mut run: impl FnMut() -> Result<T, BenchError>,
    ) -> Result<Vec<T>, BenchError> {
        let (warm_up, repeats) = (self.plan.warm_up, self.plan.repeats.max(1));
        let mut results = Vec::new();
        for i in 0..warm_up + repeats {
            self.tell(&if i < warm_up {
                format!("{what}, warm-up {} of {warm_up}", i + 1)
            } else {
                format!("{what}, run {} of {repeats}", i - warm_up + 1)
            });
            let result = run()?;
            if i >= warm_up {
                results.push(result);
            }
        }
        Ok(results)
    }
}

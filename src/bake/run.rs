//! The bake from end to end, on one page: what runs when, and what runs beside it.

use std::time::{Duration, Instant};

use super::baker::Baker;
use super::progress::{Listener, Stage, Stages};
use super::report::{AtlasReport, Report};
use super::settings::{Options, Settings};
use super::shared::TILE;
use super::step::Limit;
use super::update::Sign;
use crate::cluster::Budget;
use crate::gpu::{Gpu, GpuError};
use crate::lightmap::texels::Texels;
use crate::lightmap::{AtlasOptions, Lightmap, LightmapError};
use crate::scene::edit::EditError;
use crate::scene::{Document, Scene, SceneError};

/// What to bake and how.
#[derive(Clone, Debug, Default)]
pub struct Job {
    /// How fine the lightmap is; ignored by [`Job::repeat`], which knows.
    pub atlas: AtlasOptions,
    /// What the settings are resolved from, unless `repeat` has them.
    pub options: Options,
    /// The settings and the atlas of an earlier bake, for the scene that it wrote.
    pub repeat: Option<(Settings, AtlasReport)>,
    /// Stop refining in time to end after this long.
    pub budget: Option<Duration>,
    /// Afterwards subtract every second light, add it again, and compare every bit.
    pub verify: bool,
}

/// What a bake made.
pub struct Baked {
    /// The map.
    pub lightmap: Lightmap,
    /// Who made it, and can go on: has the scene, its document, and the atlas.
    pub baker: Baker,
    /// What was done.
    pub report: Report,
}

/// Why a bake failed.
#[derive(Debug, thiserror::Error)]
pub enum BakeError {
    /// The device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The atlas.
    #[error(transparent)]
    Lightmap(#[from] LightmapError),
    /// The scene and its document do not fit together.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// An edit.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// The invariant of exact updates is broken.
    #[error(
        "verify: {texels} of {all} texels differ; the worst is pixel {pixel} of object {object} (slot {worst}), by {units} fixed-point units: please report this with the device's name"
    )]
    Verify {
        /// Texels that differ.
        texels: usize,
        /// Texels in all.
        all: usize,
        /// The one with the largest difference, in the texel list.
        worst: usize,
        /// How large that is.
        units: u64,
        /// `page * page_size² + y * page_size + x`.
        pixel: u32,
        /// Index into the scene's objects.
        object: u32,
    },
}

/// Bakes `scene`, which `document` describes: a [`Baker`] that goes from the empty map to the last update, on one page.
///
/// # Errors
/// No room in the atlas, no memory, a lost device. Nothing is written.
pub fn bake(
    gpu: &Gpu,
    scene: Scene,
    document: Document,
    job: &Job,
    listener: &dyn Listener,
) -> Result<Baked, BakeError> {
    let start = Instant::now();
    let stages = Stages::new(listener);
    let mut baker = Baker::timed(gpu, scene, document, job, &stages)?;
    let deadline = job.budget.map(|budget| start + budget.mul_f64(0.9));
    let stopped_early = stages.time(Stage::Accumulate, || match deadline {
        Some(deadline) => fill_in_time(&mut baker, deadline, listener),
        None => fill(&mut baker, listener).map(|()| false),
    })?;
    if job.verify {
        verify_reversal(&mut baker)?;
    }
    let lightmap = stages.time(Stage::Resolve, || baker.lightmap())?;
    let mut report = baker.report();
    report.stopped_early = stopped_early;
    report.seconds = stages.seconds();
    report.total_seconds = start.elapsed().as_secs_f64();
    Ok(Baked {
        lightmap,
        baker,
        report,
    })
}

/// Does all updates, without looking at the clock.
fn fill(baker: &mut Baker, listener: &dyn Listener) -> Result<(), GpuError> {
    baker.step_with(Limit::Converged, &mut |done, total| {
        listener.at(Stage::Accumulate, done, total);
    })?;
    Ok(())
}

/// A coarse cut comes first and is refined, so that the map is complete whenever time runs out. Whether it did.
fn fill_in_time(
    baker: &mut Baker,
    deadline: Instant,
    listener: &dyn Listener,
) -> Result<bool, GpuError> {
    let last = baker.clusters().select(baker.target()).cells.len();
    let mut sizes: Vec<usize> = std::iter::successors(Some(last), |n| Some(n / 2))
        .skip(1)
        .take_while(|n| *n > 32)
        .collect();
    let (mut sent, mut spent) = (0, Duration::ZERO);
    loop {
        let size = sizes.pop();
        let started = Instant::now();
        baker.aim_at(size.map(Budget::Cells));
        let lights = baker.lights_left();
        if sent > 0 {
            let expected = spent.mul_f64(lights as f64 / sent as f64);
            if Instant::now() + expected > deadline {
                return Ok(true);
            }
        }
        fill(baker, listener)?;
        sent += lights;
        spent += started.elapsed();
        if size.is_none() {
            return Ok(false);
        }
    }
}

/// Subtracts every second light, adds it again, and compares the sums bit for bit.
fn verify_reversal(baker: &mut Baker) -> Result<(), BakeError> {
    let before = baker.illumination.sums()?;
    for sign in [Sign::Subtract, Sign::Add] {
        for held in baker.held.values() {
            for light in held.selected.lights.iter().step_by(2) {
                baker.illumination.push(light.clone(), sign, held.version)?;
            }
        }
    }
    let after = baker.illumination.sums()?;
    compare_sums(&baker.texels, &before, &after)
}

/// An error that names the first texel whose sums differ, the one with the largest difference.
pub(super) fn compare_sums(
    texels: &Texels,
    found: &[i64],
    expected: &[i64],
) -> Result<(), BakeError> {
    let tile = 3 * TILE as usize;
    let slot = |i: usize| i / tile * TILE as usize + i % TILE as usize;
    let mut differ: Vec<(usize, u64)> = found
        .iter()
        .zip(expected)
        .enumerate()
        .filter(|(_, (a, b))| a != b)
        .map(|(i, (a, b))| (slot(i), a.abs_diff(*b)))
        .collect();
    differ.sort_unstable_by_key(|d| (d.0, std::cmp::Reverse(d.1)));
    differ.dedup_by_key(|d| d.0);
    match differ.iter().max_by_key(|d| (d.1, std::cmp::Reverse(d.0))) {
        Some(&(worst, units)) => Err(BakeError::Verify {
            texels: differ.len(),
            all: found.len() / 3,
            worst,
            units,
            pixel: texels.list[worst].pixel,
            object: texels.list[worst].object,
        }),
        None => Ok(()),
    }
}

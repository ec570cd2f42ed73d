//! The bake from end to end, on one page: what runs when, and what runs beside it.

use std::time::{Duration, Instant};

use super::baker::Baker;
use super::baker::step::Limit;
use super::device::shared::TILE;
use super::job::progress::{Listener, Stage, Stages};
use super::job::report::Report;
use super::job::{BakeError, Job};
use super::update::Sign;
use crate::cluster::Budget;
use crate::gpu::{Gpu, GpuError};
use crate::lightmap::Lightmap;
use crate::lightmap::texels::Texels;
use crate::scene::{Document, Scene};

/// What a bake made.
pub struct Baked {
    /// The map.
    pub lightmap: Lightmap,
    /// Who made it, and can go on: has the scene, its document, and the atlas.
    pub baker: Baker,
    /// What was done.
    pub report: Report,
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
        let lights = baker.lights_left()?;
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
        for held in baker.holdings.seen().values() {
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

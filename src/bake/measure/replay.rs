//! A script of edits from end to end: bake, edit, let the map follow, and afterwards measure how fast it came.

use std::path::Path;
use std::time::{Duration, Instant};

use super::convergence::First;
use crate::bake::baker::Baker;
use crate::bake::baker::step::Limit;
use crate::bake::job::BakeError;
use crate::bake::job::progress::{Listener, Stage};
use crate::bake::order::schedule::Kind;
use crate::bake::run::compare_sums;
use crate::bake::update::Sign;
use crate::scene::Camera;
use crate::scene::edit::{Command, Until};

/// A line of a script, as it was played.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Played {
    /// Line of the script, from 1.
    pub line: usize,
    /// Seconds after the first line at which it began.
    pub seconds: f64,
    /// Seconds until it returned: of an edit, until it was taken in; of a wait, all of it.
    pub took: f64,
    /// Updates done before it.
    pub updates: u64,
    /// Why it was refused, if it was.
    pub refused: Option<String>,
}

/// An update, as it was measured.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Step {
    /// Seconds after the script's first line at which it had been sent.
    pub seconds: f64,
    /// Which process asked for it.
    pub kind: Kind,
    /// The first of its cells.
    pub cell: String,
    /// Virtual lights taken away.
    pub subtracted: u64,
    /// Virtual lights added.
    pub added: u64,
    /// Virtual lights updated in the shadows of what changed alone.
    pub limited: u64,
    /// Lumens that were still known or estimated to be wrong afterwards.
    pub invalid_flux: f64,
    /// Root mean square difference from the final map over all texels and channels, afterwards, lux.
    pub rms: f64,
    /// The same over a picture's pixels, what is seen from a camera: 0 if that sees nothing.
    pub viewport: f64,
    /// The mean of the map over all texels and channels afterwards, lux.
    pub mean: f64,
    /// How far a texel is at most outside of what lies between its first value and its final one, afterwards, lux: what an edit
    /// that only takes light away, or only adds some, should never show.
    pub beyond: f64,
}

/// What a script did.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Replay {
    /// Line by line.
    pub script: Vec<Played>,
    /// The difference of the first map from the last one, as [`Step::rms`].
    pub initial_rms: f64,
    /// As [`Step::viewport`].
    pub initial_viewport: f64,
    /// The mean of the first map, as [`Step::mean`].
    pub initial_mean: f64,
    /// The mean of the final map over all texels and channels, lux.
    pub mean: f64,
    /// The most of [`Step::beyond`].
    pub beyond: f64,
    /// Update by update.
    #[serde(skip)]
    pub steps: Vec<Step>,
    /// Updates done.
    pub updates: u64,
    /// Seconds from the first line to convergence.
    pub seconds: f64,
    /// Virtual lights evaluated, limited ones twice.
    pub lights: u64,
}

/// What to do besides.
#[derive(Clone, Debug, Default)]
pub struct ReplayOptions {
    /// Go on with the next line after one that was refused.
    pub keep_going: bool,
    /// Time for updates between two looks at the map; without it, as much as a line asks for.
    pub frame: Option<Duration>,
    /// Where the viewport's error is seen from, and what is seen from there put right first; else from the file's first camera, or from where much of the scene is seen.
    pub camera: Option<Camera>,
}

/// A script stopped.
#[derive(Debug, thiserror::Error)]
#[error("line {line}: {cause}")]
pub struct ScriptError {
    /// From 1.
    pub line: usize,
    /// Why.
    #[source]
    pub cause: Box<BakeError>,
}

impl Baker {
    /// Plays `script` (line numbers and commands) and goes on until the map has converged. `look` is called between frames
    /// with the seconds since the first line. The baker should have converged before.
    ///
    /// # Errors
    /// The first line that is refused, unless [`ReplayOptions::keep_going`]; a lost device.
    pub fn play(
        &mut self,
        script: &[(usize, Command)],
        folder: &Path,
        options: &ReplayOptions,
        listener: &dyn Listener,
        look: &mut dyn FnMut(&mut Self, f64) -> Result<(), BakeError>,
    ) -> Result<Replay, ScriptError> {
        self.look_from(options.camera.as_ref());
        // Whoever edits a scene has been looking at it.
        let first = self.look().and_then(|()| First::new(self));
        let first = first.map_err(|e| ScriptError {
            line: script.first().map_or(0, |(line, _)| *line),
            cause: Box::new(e.into()),
        })?;
        self.journal().begin();
        let start = Instant::now();
        let before = self.illumination.lights_sent();
        let mut played = Vec::new();
        let mut updates = 0;
        let last = script.last().map_or(0, |(line, _)| *line);
        let end = (last, Command::Wait(Until::Converged));
        for (line, command) in script.iter().chain(std::iter::once(&end)) {
            let (began, done) = (start.elapsed().as_secs_f64(), updates);
            let result = match command {
                Command::Edit(edit) => self.apply(edit, folder),
                Command::Undo => self.undo(),
                Command::Redo => self.redo(),
                Command::Wait(until) => self
                    .wait(*until, options, start, listener, look)
                    .map(|n| updates += n),
            };
            let refused = match result {
                Ok(()) => None,
                Err(BakeError::Edit(cause)) if options.keep_going => Some(cause.to_string()),
                Err(cause) => {
                    return Err(ScriptError {
                        line: *line,
                        cause: Box::new(cause),
                    });
                }
            };
            played.push(Played {
                line: *line,
                seconds: began,
                took: start.elapsed().as_secs_f64() - began,
                updates: done,
                refused,
            });
        }
        played.pop();
        let seconds = start.elapsed().as_secs_f64();
        let lights = self.illumination.lights_sent() - before;
        let entries = self.journal().end();
        let walked = self.convergence(entries, &first, options.camera.as_ref());
        let (initial, steps) = walked.map_err(|e| ScriptError {
            line: last,
            cause: Box::new(e.into()),
        })?;
        Ok(Replay {
            script: played,
            initial_rms: initial.rms,
            initial_viewport: initial.viewport,
            initial_mean: initial.mean,
            mean: steps.last().map_or(initial.mean, |step| step.mean),
            beyond: steps.iter().map(|s| s.beyond).fold(0.0, f64::max),
            updates: steps.len() as u64,
            steps,
            seconds,
            lights,
        })
    }

    /// Lets the map follow until then, or until nothing is left to do. Returns the updates done.
    fn wait(
        &mut self,
        until: Until,
        options: &ReplayOptions,
        start: Instant,
        listener: &dyn Listener,
        look: &mut dyn FnMut(&mut Self, f64) -> Result<(), BakeError>,
    ) -> Result<u64, BakeError> {
        let began = Instant::now();
        let mut updates = 0;
        loop {
            let left = match until {
                Until::Seconds(seconds) => Duration::from_secs_f64(seconds)
                    .checked_sub(began.elapsed())
                    .filter(|left| !left.is_zero()),
                _ => Some(Duration::MAX),
            };
            let done = match until {
                Until::Converged => false,
                Until::Updates(n) => updates >= n,
                Until::Seconds(_) => left.is_none(),
            };
            if done || self.is_converged() {
                break;
            }
            let limit = match (options.frame, until, left) {
                (Some(frame), _, left) => Limit::Time(frame.min(left.unwrap_or(frame))),
                (None, Until::Seconds(_), left) => Limit::Time(left.unwrap_or_default()),
                (None, Until::Updates(n), _) => Limit::Updates(n - updates),
                (None, Until::Converged, _) => Limit::Converged,
            };
            let progress = self.step_with(limit, &mut |done, total| {
                listener.at(Stage::Accumulate, done, total);
            })?;
            updates += progress.updates;
            look(self, start.elapsed().as_secs_f64())?;
        }
        Ok(updates)
    }

    /// Accumulates all lights that the map holds again, from nothing, in the scene as it is, and compares every bit.
    ///
    /// # Errors
    /// [`BakeError::Verify`], which names the worst texel. No memory, a lost device.
    pub fn verify(&mut self) -> Result<(), BakeError> {
        let scene = self.scene().clone();
        let mut fresh = self.fresh_map(&scene)?;
        for held in self.holdings.seen().values() {
            for light in &held.selected.lights {
                fresh.push(light.clone(), Sign::Add, 0)?;
            }
        }
        let expected = fresh.sums()?;
        let found = self.illumination.sums()?;
        compare_sums(&self.texels, &found, &expected)
    }
}

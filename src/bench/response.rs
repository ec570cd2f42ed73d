//! How the map follows edits: IBGI's figure 11, scenario by scenario.

use std::path::{Path, PathBuf};
use std::time::Instant;

use tempfile::TempDir;

use super::figure::{Better, Figure, Point, Series};
use super::{Bench, BenchError};
use crate::bake::{Baked, Baker, Job, KEPT_MAPS, Limit, Replay, ReplayOptions, Silent, bake};
use crate::scene::edit::Command;

/// A script of edits with a name.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// For people.
    pub name: String,
    /// Line numbers and commands.
    pub script: Vec<(usize, Command)>,
    /// Where files that it adds are looked up; none for the built-in one.
    pub folder: Option<PathBuf>,
}

/// The text of a built-in script and its scene and name.
macro_rules! scripts {
    ($($scene:literal: $($name:literal)*;)*) => {
        [$($(($scene, $name, include_str!(concat!("../../assets/replay/", $scene, "-", $name, ".jsonl")))),*),*]
    };
}

/// Every built-in scenario: an object moved, a lamp moved, a lamp dimmed, a wall added.
const SCRIPTS: [(&str, &str, &str); 16] = scripts! {
    "cornell": "move" "lamp" "dim" "wall";
    "museum": "move" "lamp" "dim" "wall";
    "town-square": "move" "lamp" "dim" "wall";
    "warehouse": "move" "lamp" "dim" "wall";
};

/// What the walls are made from.
const WALL: &str = include_str!("../../assets/replay/wall.gltf");

/// Points of a curve.
const CURVE_POINTS: usize = 64;

/// The scenarios of a built-in scene; none for other scenes.
pub(super) fn builtin(scene: &str) -> Vec<Scenario> {
    let of = SCRIPTS.iter().filter(|(of, ..)| *of == scene);
    of.map(|(_, name, text)| Scenario {
        name: (*name).to_owned(),
        script: (1..)
            .zip(text.lines())
            .map(|(number, line)| {
                let command = Command::parse(line).expect("a built-in script is right");
                (number, command)
            })
            .collect(),
        folder: None,
    })
    .collect()
}

/// Those of a scene and those that were asked for.
pub(super) fn all(bench: &Bench) -> Vec<Scenario> {
    let mut scenarios = builtin(bench.name);
    scenarios.extend(bench.plan.scenarios.iter().cloned());
    scenarios
}

/// A folder with what the built-in walls are made from.
pub(super) fn walls() -> std::io::Result<TempDir> {
    let folder = tempfile::tempdir()?;
    std::fs::write(folder.path().join("wall.gltf"), WALL)?;
    Ok(folder)
}

impl Bench<'_> {
    pub(super) fn response(&mut self) -> Result<(), BenchError> {
        let scenarios = all(self);
        if scenarios.is_empty() {
            let why = "response: the scene has no scenario; --script FILE gives it one";
            self.out.missing.push(why.into());
            return Ok(());
        }
        let walls = walls()?;
        self.tell("response: baking the scene once");
        let (scene, document) = (self.scene.clone(), self.document.clone());
        let job = Job {
            kept_maps: KEPT_MAPS,
            ..self.plan.job.clone()
        };
        let Baked {
            mut baker, report, ..
        } = bake(self.gpu, scene, document, &job, &Silent)?;
        // What a rebake of the edited scene would have to do again.
        let unwrap = report.seconds.get("unwrap").copied().unwrap_or_default();
        let full = report.total_seconds - unwrap;
        for scenario in &scenarios {
            let folder = scenario.folder.as_deref().unwrap_or(walls.path());
            let mut runs = self.repeat(&format!("response: {}", scenario.name), || {
                play(&mut baker, scenario, folder)
            })?;
            self.figures_of(&scenario.name, &runs, full);
            runs.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
            let middle = &runs[runs.len() / 2];
            self.out.series.push(curve(&scenario.name, middle));
        }
        Ok(())
    }

    fn figures_of(&mut self, name: &str, runs: &[Replay], full: f64) {
        let mut of = |what: &str, unit: &str, better, value: &dyn Fn(&Replay) -> f64| {
            let figure = Figure::new(
                format!("{name}: {what}"),
                unit,
                better,
                runs.iter().map(value),
            );
            self.out.figures.push(figure);
        };
        let left = |replay: &Replay, share: f64| {
            let bound = share * replay.initial_rms;
            let last = replay.steps.iter().rposition(|s| s.rms > bound);
            match last {
                Some(i) => replay
                    .steps
                    .get(i + 1)
                    .map_or(replay.seconds, |s| s.seconds),
                None => replay.steps.first().map_or(0.0, |s| s.seconds),
            }
        };
        of("95 % gone after", "s", Better::Lower, &|r| left(r, 0.05));
        of("95 % gone after, of a rebake", "%", Better::Lower, &|r| {
            100.0 * left(r, 0.05) / full
        });
        of("99 % gone after", "s", Better::Lower, &|r| left(r, 0.01));
        of("converged after", "s", Better::Lower, &|r| r.seconds);
        for n in [10, 30, 100, 300] {
            of(
                &format!("left after {n} updates"),
                "%",
                Better::Lower,
                &|r| {
                    let at = r.steps.get(n - 1).or(r.steps.last());
                    100.0 * at.map_or(0.0, |s| s.rms) / r.initial_rms.max(f64::MIN_POSITIVE)
                },
            );
        }
        of("updates", "1/s", Better::Higher, &|r| {
            r.updates as f64 / r.seconds
        });
        of("update size", "lights", Better::Neither, &|r| {
            r.lights as f64 / r.updates.max(1) as f64
        });
    }
}

/// Plays the scenario on a converged map and takes it back afterwards.
pub(super) fn play(
    baker: &mut Baker,
    scenario: &Scenario,
    folder: &Path,
) -> Result<Replay, BenchError> {
    let options = ReplayOptions::default();
    let replay = baker.play(&scenario.script, folder, &options, &Silent, &mut |_, _| {
        Ok(())
    })?;
    take_back(baker, &scenario.script)?;
    Ok(replay)
}

/// How a map followed edits, seen from outside.
pub(super) struct Followed {
    pub updates: u64,
    /// Lights evaluated, limited ones once.
    pub lights: u64,
    /// Until the first update was sent, seconds: paths of direct light, what is wanted, the plan.
    pub first: f64,
    /// Until convergence.
    pub seconds: f64,
}

/// Plays the edits of a scenario on a converged map, waiting for none, and takes them back afterwards. Of the way to the end nothing is
/// measured: that would take every update once more.
pub(super) fn follow(
    baker: &mut Baker,
    scenario: &Scenario,
    folder: &Path,
) -> Result<Followed, BenchError> {
    let start = Instant::now();
    let before = baker.lights_sent();
    for (_, command) in &scenario.script {
        match command {
            Command::Edit(edit) => baker.apply(edit, folder)?,
            Command::Undo => baker.undo()?,
            Command::Redo => baker.redo()?,
            Command::Wait(_) => {}
        }
    }
    let mut first = None;
    let progress = baker.step_with(Limit::Converged, &mut |_, _| {
        first.get_or_insert_with(|| start.elapsed());
    })?;
    let seconds = start.elapsed().as_secs_f64();
    let followed = Followed {
        updates: progress.updates,
        lights: baker.lights_sent() - before,
        first: first.map_or(seconds, |t| t.as_secs_f64()),
        seconds,
    };
    take_back(baker, &scenario.script)?;
    Ok(followed)
}

fn take_back(baker: &mut Baker, script: &[(usize, Command)]) -> Result<(), BenchError> {
    let mut applied = 0i64;
    for (_, command) in script {
        applied += match command {
            Command::Edit(_) | Command::Redo => 1,
            Command::Undo => -1,
            Command::Wait(_) => 0,
        };
    }
    for _ in 0..applied {
        baker.undo()?;
    }
    baker.step(Limit::Converged)?;
    Ok(())
}

/// The share of the error that is left over time, thinned out.
fn curve(name: &str, replay: &Replay) -> Series {
    let every = replay.steps.len().div_ceil(CURVE_POINTS).max(1);
    let share = |rms: f64| 100.0 * rms / replay.initial_rms.max(f64::MIN_POSITIVE);
    let point = |seconds: f64, rms: f64| Point {
        at: seconds,
        figures: vec![Figure::new(
            "error left",
            "%",
            Better::Neither,
            [share(rms)],
        )],
    };
    let first = std::iter::once(point(0.0, replay.initial_rms));
    let steps = replay.steps.iter().step_by(every);
    Series {
        name: format!("response: {name}"),
        over: "s".into(),
        points: first
            .chain(steps.map(|s| point(s.seconds, s.rms)))
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_scene_of_the_evaluation_has_four_scenarios() {
        for scene in ["cornell", "museum", "town-square", "warehouse"] {
            let scenarios = builtin(scene);
            let names: Vec<_> = scenarios.iter().map(|s| s.name.as_str()).collect();
            assert_eq!(names, ["move", "lamp", "dim", "wall"], "{scene}");
            assert!(scenarios.iter().all(|s| !s.script.is_empty()));
        }
        assert!(builtin("furnace").is_empty());
    }
}

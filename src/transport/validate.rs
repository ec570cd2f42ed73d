//! Which paths an edit can have changed, and tracing these again (IBGI section 4.2): at the end the paths are those that a
//! fresh trace of the edited scene finds, bit for bit.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;

use super::Scatter;
use super::bvh::SceneBvh;
use super::differences::{Differences, LightChange};
use super::emission::Emitter;
use super::paths::{Emitters, LightPaths, Path, PathSet, PathSettings, References, Shares};
use super::sampling::Sequence;
use super::touched::Touched;
use super::tracer::{Tracer, trace};
use crate::scene::Scene;
use crate::scene::edit::Change;

/// Keeps the paths of a scene that is being edited.
///
/// [`Self::invalidate`] takes in an edit at once and marks the paths that it can have changed; [`Self::step`] traces some
/// of them again. Several edits may come before all is valid again.
#[derive(Clone, Debug)]
pub struct Validator {
    settings: PathSettings,
    paths: PathSet,
    emitters: Emitters,
    marks: BTreeMap<u32, Marks>,
    /// Lights that have changed since the last step: their flux before that, and whether they moved.
    relit: BTreeMap<u32, (Vec3, bool)>,
}

/// What is to be done about the paths of a light.
#[derive(Clone, Debug, Default)]
struct Marks {
    /// Per path, the first of its rays that can have changed; [`DIMMED`] if none can, but what it carries has; [`VALID`] if nothing.
    first: Vec<u8>,
    /// How many paths the light is to have; those beyond go, those that lack come.
    target: usize,
    /// Paths to trace or to dim, to drop and to add.
    invalid: usize,
}

const VALID: u8 = u8::MAX;
const DIMMED: u8 = VALID - 1;

impl Marks {
    fn count(&mut self) {
        let kept = &self.first[..self.first.len().min(self.target)];
        let marked = kept.par_iter().filter(|&&f| f != VALID).count();
        self.invalid = marked + self.first.len().abs_diff(self.target);
    }
}

impl Validator {
    /// Traces all paths.
    pub fn new(scene: &Scene, bvh: &SceneBvh, settings: &PathSettings) -> Self {
        let mut validator = Self::start(scene, settings);
        validator.paths = trace(scene, bvh, settings);
        for (light, paths) in &validator.paths.lights {
            if let Some(marks) = validator.marks.get_mut(light) {
                marks.first = vec![VALID; paths.paths.len()];
                marks.count();
            }
        }
        validator.relit.clear();
        validator
    }

    /// Has no path yet: all are to be traced, by [`Self::step`].
    pub fn start(scene: &Scene, settings: &PathSettings) -> Self {
        let mut validator = Self {
            settings: settings.clone(),
            paths: PathSet::default(),
            emitters: Emitters::new(),
            marks: BTreeMap::new(),
            relit: BTreeMap::new(),
        };
        let lights: Vec<u32> = scene.lights.iter().map(|l| l.id()).collect();
        validator.relight(scene, &lights);
        validator
    }

    /// The paths, those that wait to be traced again as they were.
    pub fn paths(&self) -> &PathSet {
        &self.paths
    }

    /// How paths are sent.
    pub fn settings(&self) -> &PathSettings {
        &self.settings
    }

    /// Whether the paths are those of a fresh trace.
    pub fn is_valid(&self) -> bool {
        self.relit.is_empty() && self.marks.values().all(|m| m.invalid == 0)
    }

    /// Paths that wait for [`Self::step`].
    pub fn invalid_paths(&self) -> usize {
        self.marks.values().map(|m| m.invalid).sum()
    }

    /// About the energy of these paths in lumens (mean over RGB), as if their lights were as bright as they are referred to.
    pub fn invalid_flux(&self) -> f64 {
        self.invalid_paths() as f64 * self.settings.flux_per_path
    }

    /// [`Self::invalid_flux`] of one light, by its [`crate::scene::Light::id`].
    pub fn invalid_flux_of(&self, light: u32) -> f64 {
        let invalid = self.marks.get(&light).map_or(0, |m| m.invalid);
        invalid as f64 * self.settings.flux_per_path
    }

    /// Takes in an edit: marks the paths that can differ in `new`.
    ///
    /// A ray can have changed if it hit an object that did, or crosses the box of one where it is now. (Where such an object
    /// was, nothing new can be hit but by rays that hit the object.) The start of a path can have changed if its light did: it
    /// is drawn again and compared, so that the paths of a light which is only dimmed go where they went.
    pub fn invalidate(&mut self, new: &Scene, change: &Change) {
        self.relight(new, &change.lights);
        let touched = Touched::new(new, &change.objects, &change.surfaces);
        if touched.is_empty() {
            return;
        }
        for (light, paths) in &self.paths.lights {
            let Some(marks) = self.marks.get_mut(light) else {
                continue;
            };
            paths
                .paths
                .par_iter()
                .zip(&mut marks.first)
                .with_min_len(1024)
                .for_each(|(path, first)| {
                    // Behind the first changed ray, nothing counts.
                    let rays = path.rays().take(usize::from(*first));
                    for (ray, (origin, scatter)) in rays.enumerate() {
                        if touched.can_change(origin, scatter) {
                            *first = ray as u8;
                            break;
                        }
                    }
                });
            marks.count();
        }
    }

    /// Takes in lights that changed, appeared or vanished.
    fn relight(&mut self, scene: &Scene, lights: &[u32]) {
        if lights.is_empty() {
            return;
        }
        let indices: BTreeMap<u32, usize> = scene
            .lights
            .iter()
            .enumerate()
            .map(|(i, l)| (l.id(), i))
            .collect();
        for &light in lights {
            let paths = self.paths.lights.entry(light).or_default();
            let marks = self.marks.entry(light).or_default();
            let relit = self.relit.entry(light).or_insert((paths.flux, false));
            match indices.get(&light) {
                Some(&index) => {
                    let emitter = Arc::new(Emitter::new(scene, index));
                    paths.flux = emitter.flux;
                    let shares = self.settings.share_out(light, &emitter);
                    marks.target = shares.paths as usize;
                    let sequence = Sequence::new(self.settings.seed, light);
                    relit.1 |= mark_changed(&sequence, &emitter, &shares, paths, marks);
                    paths.weight = shares.weight;
                    self.emitters.insert(light, emitter);
                }
                None => {
                    paths.flux = Vec3::ZERO;
                    marks.target = 0;
                    self.emitters.remove(&light);
                }
            }
            marks.count();
        }
    }

    /// How paths are sent from here on: lights that came are referred to as they are, the others as before.
    pub fn refer(&mut self, references: References) {
        self.settings.references = references;
    }

    /// Traces, dims, drops or adds up to `max_paths` paths: those of the lights with the most invalid flux, and of these in the order
    /// of their sequence. `scene` is the one of the last edit, `bvh` its tree. The result does not depend on threads.
    pub fn step(&mut self, scene: &Scene, bvh: &SceneBvh, max_paths: usize) -> Differences {
        let mut differences = Differences {
            lights: std::mem::take(&mut self.relit)
                .into_iter()
                .map(|(light, (old, moved))| LightChange {
                    light,
                    flux: [old, self.paths.lights[&light].flux],
                    moved,
                })
                .collect(),
            ..Default::default()
        };
        let mut order: Vec<(u32, usize)> = self
            .marks
            .iter()
            .filter(|(_, m)| m.invalid > 0)
            .map(|(&light, m)| (light, m.invalid))
            .collect();
        order.sort_by_key(|&(light, invalid)| (std::cmp::Reverse(invalid), light));
        let mut jobs: Vec<(u32, u32)> = Vec::new();
        for (light, _) in order {
            let Some(left) = max_paths.checked_sub(differences.paths).filter(|&l| l > 0) else {
                break;
            };
            let (marks, paths) = (&self.marks[&light], &self.paths.lights[&light].paths);
            let kept = &marks.first[..paths.len().min(marks.target)];
            let marked = (0..kept.len()).filter(|&i| kept[i] != VALID);
            let before = jobs.len();
            jobs.extend(
                marked
                    .chain(paths.len()..marks.target)
                    .take(left)
                    .map(|i| (light, i as u32)),
            );
            let traced = jobs.len() - before;
            let dropped = paths.len().saturating_sub(marks.target).min(left - traced);
            differences.paths += traced + dropped;
            self.drop_last(light, dropped, &mut differences);
        }
        let tracer = Tracer::with_emitters(scene, bvh, &self.settings, self.emitters.clone());
        let span = tracing::debug_span!("trace paths", paths = jobs.len()).entered();
        let traced: Vec<Path> = jobs
            .par_iter()
            .with_min_len(16)
            .map(|&(light, index)| {
                let old = self.paths.lights[&light].paths.get(index as usize);
                match old {
                    Some(old) => {
                        let first = self.marks[&light].first[index as usize];
                        tracer.path_from(light, index, old, usize::from(first))
                    }
                    None => tracer.path(light, index),
                }
            })
            .collect();
        drop(span);
        for ((light, index), path) in jobs.into_iter().zip(traced) {
            self.replace(light, index, path, &mut differences);
        }
        self.marks.retain(|light, marks| {
            let there = self.emitters.contains_key(light) || !marks.first.is_empty();
            if !there {
                self.paths.lights.remove(light);
            }
            there
        });
        differences.sort();
        differences
    }

    fn drop_last(&mut self, light: u32, count: usize, differences: &mut Differences) {
        let (Some(marks), Some(paths)) = (
            self.marks.get_mut(&light),
            self.paths.lights.get_mut(&light),
        ) else {
            return;
        };
        let left = paths.paths.len() - count;
        for (path, index) in paths.paths.drain(left..).zip(left as u32..) {
            differences.path(light, index, Some(&path), None);
        }
        marks.first.truncate(left);
        marks.invalid -= count;
    }

    fn replace(&mut self, light: u32, index: u32, new: Path, differences: &mut Differences) {
        let (Some(marks), Some(paths)) = (
            self.marks.get_mut(&light),
            self.paths.lights.get_mut(&light),
        ) else {
            return;
        };
        match paths.paths.get_mut(index as usize) {
            Some(path) => {
                differences.path(light, index, Some(path), Some(&new));
                *path = new;
                marks.first[index as usize] = VALID;
            }
            None => {
                differences.path(light, index, None, Some(&new));
                paths.paths.push(new);
                marks.first.push(VALID);
            }
        }
        marks.invalid -= 1;
    }
}

/// Marks the paths that no longer leave their light as they did, or carry something else; whether there are any that leave otherwise.
fn mark_changed(
    sequence: &Sequence,
    emitter: &Emitter,
    shares: &Shares,
    paths: &LightPaths,
    marks: &mut Marks,
) -> bool {
    if !emitter.emits() {
        return false;
    }
    let reweighed = shares.weight != paths.weight;
    paths
        .paths
        .par_iter()
        .zip(&mut marks.first)
        .enumerate()
        .with_min_len(256)
        .map(|(i, (path, first))| {
            let ray = emitter.emit(sequence, i as u32);
            let scatter = Scatter {
                direction: ray.direction,
                ..path.emission.scatter
            };
            let moved = ray.emission(scatter) != path.emission;
            if moved {
                *first = 0;
            } else if reweighed || ray.color * shares.energy != path.energy {
                *first = DIMMED.min(*first);
            }
            moved
        })
        .reduce(|| false, |a, b| a | b)
}

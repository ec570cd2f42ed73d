//! The baker: a scene whose lightmap follows its edits. It holds lights, knows which it should hold, and goes from the one
//! to the other by updates that each leave the map whole.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::accumulate::Evaluation;
use super::enclosed::enclosed;
use super::journal::{Entry, Journal};
use super::progress::{Stage, Stages};
use super::records::ShadowSizes;
use super::run::{BakeError, Job};
use super::schedule::{self, Held, Plan, Priority, What};
use super::settings::{Clusters as Cells, Settings};
use super::update::{Illumination, Sign};
use super::uv_raster;
use crate::cluster::{Budget, CellId, Clusters, Forest as _, Ledger, SimilaritySettings, Wanted};
use crate::gpu::{Gpu, GpuError};
use crate::lightmap::detail::{Point, Probe};
use crate::lightmap::texels::{ClaimStatistics, Texels};
use crate::lightmap::{Atlas, Lightmap, Texel};
use crate::scene::edit::{Change, Edit, Editor};
use crate::scene::{Document, Scene};
use crate::transport::SceneBvh;
use crate::transport::direct::DirectLight;
use crate::transport::paths::{self, PathSettings};
use crate::transport::validate::Validator;

/// Paths traced again at a time, between two looks at the clock.
const PATHS_AT_ONCE: usize = 4096;
/// The share of a step's time that tracing may take before the map is updated with what is known.
const TRACING_SHARE: f64 = 0.3;
/// A cell with a larger share of invalid flux is exchanged, not brought to the current scene before that.
const LEAVES: f64 = 0.3;
/// The share of invalid flux at which validation and balancing take turns (eq. 2).
pub const TURNS_AT: f64 = 0.1;

/// Bakes a scene and follows its edits.
///
/// A bake is the first edit: from an empty map, through the same updates. Once [`Baker::is_converged`], the map, the lights
/// and the paths are those of a fresh bake of the edited scene with the same settings, bit for bit.
///
/// ```no_run
/// use std::{path::Path, time::Duration};
/// use rebake::bake::{Baker, Job, Limit, Silent};
/// use rebake::gpu::{Gpu, GpuOptions};
/// use rebake::scene::{Scene, edit::Command};
///
/// fn main() -> Result<(), Box<dyn std::error::Error>> {
///     let gpu = Gpu::new(&GpuOptions::default())?;
///     let (scene, document) = Scene::load(Path::new("assets/cornell.gltf"))?;
///     let mut baker = Baker::new(&gpu, scene, document, &Job::default(), &Silent)?;
///     while !baker.is_converged() {
///         let progress = baker.step(Limit::Time(Duration::from_millis(16)))?;
///         println!("{} updates left", progress.left);
///     }
///     let line = r#"{"do": "transform", "node": "small.box", "translation": [0.2, 0.0, 0.1]}"#;
///     if let Command::Edit(edit) = Command::parse(line)? {
///         baker.apply(&edit, Path::new("."))?;
///     }
///     baker.step(Limit::Converged)?;
///     println!("{} pages", baker.lightmap()?.pages.len());
///     Ok(())
/// }
/// ```
pub struct Baker {
    gpu: Gpu,
    editor: Editor,
    settings: Settings,
    pub(super) atlas: Atlas,
    pub(super) texels: Texels,
    pub(super) claims: ClaimStatistics,
    bvh: SceneBvh,
    pub(super) validator: Validator,
    clusters: Clusters,
    target: Budget,
    wanted: Wanted,
    /// The wanted cells are those of the clusters and the target.
    settled: bool,
    /// An edit came, and direct light has not followed it yet.
    edited: bool,
    pub(super) held: BTreeMap<CellId, Held>,
    plan: Plan,
    turns_at: f64,
    pub(super) illumination: Illumination,
    journal: Journal,
    ledger: Ledger,
    priority: Priority,
}

/// How far [`Baker::step`] goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// Until nothing is left to do.
    Converged,
    /// For about so long; at least one update, if there is one.
    Time(Duration),
    /// For so many updates.
    Updates(u64),
}

/// Where a baker stands.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Progress {
    /// Updates done by this step.
    pub updates: u64,
    /// Updates known to be left; more can come while paths are being validated.
    pub left: u64,
    /// Paths that wait to be validated.
    pub invalid_paths: u64,
    /// Lumens (mean over RGB) that are known or estimated to be wrong in the map.
    pub invalid_flux: f64,
    /// Nothing is left to do.
    pub converged: bool,
}

impl Baker {
    /// Lays out the scene, traces its paths, and stands before an empty map: [`Baker::step`] fills it.
    ///
    /// # Errors
    /// No room in the atlas, no memory, a lost device, a document that its own scene contradicts.
    pub fn new(
        gpu: &Gpu,
        scene: Scene,
        document: Document,
        job: &Job,
        listener: &dyn super::Listener,
    ) -> Result<Self, BakeError> {
        Self::timed(gpu, scene, document, job, &Stages::new(listener))
    }

    /// As [`Baker::new`]; the atlas and its texels (first on the host, then on the device) and the light paths with their
    /// octree are made side by side.
    pub(super) fn timed(
        gpu: &Gpu,
        scene: Scene,
        document: Document,
        job: &Job,
        stages: &Stages,
    ) -> Result<Self, BakeError> {
        let editor = Editor::new(scene, document)?;
        let scene = editor.scene().clone();
        let bvh = stages.time(Stage::Bvh, || SceneBvh::build(&scene));
        let light = || {
            let settings = job
                .repeat
                .as_ref()
                .map_or_else(|| resolve(&scene, job), |(settings, _)| settings.clone());
            let path_settings = PathSettings {
                flux_per_path: settings.flux_per_path,
                max_bounces: settings.bounces,
                seed: settings.seed,
            };
            let validator = stages.time(Stage::Paths, || {
                Validator::new(&scene, &bvh, &path_settings)
            });
            let clusters = stages.time(Stage::Cluster, || {
                let similarity = SimilaritySettings::default();
                Clusters::new(&scene, validator.paths(), &path_settings, similarity)
            });
            (settings, validator, clusters)
        };
        let probe = DirectLight::new(&scene, &bvh);
        let surface = || -> Result<_, BakeError> {
            let atlas = stages.time(Stage::Unwrap, || match &job.repeat {
                Some((_, a)) => {
                    Atlas::from_settings(&scene, a.density, a.page_size, a.pages, &a.objects)
                }
                None => Atlas::build_lit(&scene, &job.atlas, Some(&probe)),
            })?;
            let (claims, texels) = stages.time(Stage::Texels, || -> Result<_, BakeError> {
                let claims = uv_raster::rasterize(gpu, &atlas)?;
                let texels = Texels::build(&scene, &atlas, &claims);
                Ok((claims, texels))
            })?;
            Ok((atlas, claims, texels))
        };
        let ((settings, validator, clusters), surface) = rayon::join(light, surface);
        let (atlas, claims, texels) = surface?;
        drop(probe);
        let illumination = stages.time(Stage::Upload, || {
            empty_map(gpu, &scene, &texels, &settings, atlas.density)
        })?;
        let ledger = Ledger::new(&clusters);
        Ok(Self {
            gpu: gpu.clone(),
            target: budget(&settings),
            editor,
            settings,
            atlas,
            texels,
            claims: claims.statistics,
            bvh,
            validator,
            clusters,
            wanted: Wanted::new(),
            settled: false,
            edited: false,
            held: BTreeMap::new(),
            plan: Plan::default(),
            turns_at: TURNS_AT,
            illumination,
            journal: Journal::default(),
            ledger,
            priority: Priority::default(),
        })
    }

    /// The scene as it is now, objects that are gone included.
    pub fn scene(&self) -> &Arc<Scene> {
        self.editor.scene()
    }

    /// The glTF document as it is now.
    pub fn document(&self) -> &Document {
        self.editor.document()
    }

    /// Where the map lies on the objects that are there.
    pub fn atlas(&self) -> Atlas {
        self.atlas.shown(self.scene())
    }

    /// What the bake was resolved to: the same for every version of the scene.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The share of invalid flux at which validation and balancing take turns (eq. 2's t), above 0 and below 1; 0.1 at first.
    pub fn set_turns_at(&mut self, t: f64) {
        self.turns_at = t;
    }

    /// What tells which lights an edit made wrong: the order of updates, never their result.
    pub fn set_priority(&mut self, priority: Priority) {
        self.priority = priority;
    }

    /// Edits the scene. `folder` is where files that the edit adds are looked up. The map follows with [`Baker::step`];
    /// further edits need not wait for that.
    ///
    /// # Errors
    /// An edit that makes no sense, or whose objects find no room in the lightmap: nothing has changed then.
    pub fn apply(&mut self, edit: &Edit, folder: &Path) -> Result<(), BakeError> {
        let old = self.scene().clone();
        let change = self.editor.apply(edit, folder)?;
        if let Err(error) = self.lay_out() {
            self.editor.take_back()?;
            return Err(error);
        }
        self.follow(&old, &change)
    }

    /// Takes back the last edit that has not been taken back.
    ///
    /// # Errors
    /// There is none.
    pub fn undo(&mut self) -> Result<(), BakeError> {
        let old = self.scene().clone();
        let change = self.editor.undo()?;
        self.lay_out()?;
        self.follow(&old, &change)
    }

    /// Does again what was taken back last.
    ///
    /// # Errors
    /// There is nothing.
    pub fn redo(&mut self) -> Result<(), BakeError> {
        let old = self.scene().clone();
        let change = self.editor.redo()?;
        self.lay_out()?;
        self.follow(&old, &change)
    }

    /// Finds room in the lightmap for objects that came.
    fn lay_out(&mut self) -> Result<(), BakeError> {
        let scene = self.editor.scene().clone();
        let new = self.atlas.update(&scene)?;
        if !new.is_empty() {
            let claims = uv_raster::rasterize_objects(&self.gpu, &self.atlas, &new)?;
            self.texels.extend(&scene, &self.atlas, &claims, &new);
        }
        Ok(())
    }

    /// Takes a change of the scene in: everything that it makes wrong is known to be wrong from here on.
    fn follow(&mut self, old: &Scene, change: &Change) -> Result<(), BakeError> {
        let scene = self.editor.scene().clone();
        if change.is_empty() {
            return Ok(());
        }
        if !change.objects.is_empty() {
            let boxes = change.boxes(old, &scene);
            self.bvh = self.bvh.moved(&scene, &change.objects);
            self.illumination
                .change(&scene, &self.texels, &change.objects, boxes)?;
        }
        self.validator.invalidate(&scene, change);
        self.settled = false;
        self.edited = true;
        Ok(())
    }

    /// Refines no further than this until told otherwise: for bakes that must end in time. [`Baker::is_converged`] then
    /// speaks of this target.
    pub(super) fn aim(&mut self, target: Option<Budget>) {
        self.target = target.unwrap_or_else(|| budget(&self.settings));
        self.settled = false;
    }

    pub(super) fn target(&self) -> Budget {
        self.target
    }

    pub(super) fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    pub(super) fn clusters(&self) -> &Clusters {
        &self.clusters
    }

    pub(super) fn journal(&mut self) -> &mut Journal {
        &mut self.journal
    }

    /// The largest metric of a cell that could be refined, relative to all light.
    pub(super) fn error(&self) -> f64 {
        self.wanted.error()
    }

    /// Evaluations of lights that the plan still needs.
    pub(super) fn lights_left(&mut self) -> u64 {
        self.settle(None);
        self.plan.lights()
    }

    /// Whether the map is that of a fresh bake.
    pub fn is_converged(&self) -> bool {
        self.settled && self.validator.is_valid() && self.plan.len() == 0
    }

    /// Works on the map.
    ///
    /// # Errors
    /// No memory, a lost device.
    pub fn step(&mut self, limit: Limit) -> Result<Progress, GpuError> {
        self.step_with(limit, &mut |_, _| {})
    }

    /// As [`Baker::step`]; `told` hears how many lights have been sent of how many.
    pub(super) fn step_with(
        &mut self,
        limit: Limit,
        told: &mut dyn FnMut(u64, u64),
    ) -> Result<Progress, GpuError> {
        let start = Instant::now();
        let mut updates = 0;
        let before = self.illumination.lights_sent();
        if std::mem::take(&mut self.edited) {
            updates += self.follow_with_direct_light(limit, start)?;
        }
        loop {
            let tracing = match limit {
                Limit::Time(time) => Some(start + time.mul_f64(TRACING_SHARE)),
                _ => None,
            };
            self.settle(tracing);
            let total = self.plan.lights();
            if limit == Limit::Updates(updates) {
                self.illumination.send()?;
                return Ok(self.standing(updates));
            }
            while let Some(update) = self.plan.next(self.turns_at) {
                self.perform(&update)?;
                updates += 1;
                self.illumination.poll()?;
                self.journal.reach(self.illumination.taken_and_done().1);
                let sent = self.illumination.lights_sent() - before;
                told(sent, sent + total);
                let enough = match limit {
                    Limit::Converged => false,
                    Limit::Time(time) => start.elapsed() >= time,
                    Limit::Updates(n) => updates >= n,
                };
                if enough {
                    self.illumination.send()?;
                    return Ok(self.standing(updates));
                }
            }
            self.forget()?;
            if self.is_converged() {
                self.illumination.flush()?;
                self.journal.reach(self.illumination.taken_and_done().1);
                self.ledger = Ledger::new(&self.clusters);
                return Ok(self.standing(updates));
            }
            if let Limit::Time(time) = limit
                && start.elapsed() >= time
            {
                self.illumination.send()?;
                return Ok(self.standing(updates));
            }
        }
    }

    fn standing(&self, updates: u64) -> Progress {
        Progress {
            updates,
            left: self.plan.len() as u64,
            invalid_paths: self.validator.invalid_paths() as u64,
            invalid_flux: self.plan.invalid_flux() + self.validator.invalid_flux(),
            converged: self.is_converged(),
        }
    }

    /// After an edit: what needs no path to be known, so that the device has work while the host traces.
    fn follow_with_direct_light(&mut self, limit: Limit, start: Instant) -> Result<u64, GpuError> {
        let scene = self.editor.scene().clone();
        let differences = self.validator.step(&scene, &self.bvh, 0);
        self.clusters
            .apply(&scene, self.validator.paths(), &differences);
        self.ledger.note(&self.clusters, &self.held, &differences);
        self.wanted.update(&self.clusters, self.target);
        self.replan();
        let mut updates = 0;
        while let Some(update) = self.plan.next_direct() {
            self.perform(&update)?;
            updates += 1;
            self.illumination.poll()?;
            self.journal.reach(self.illumination.taken_and_done().1);
            let enough = match limit {
                Limit::Converged => false,
                Limit::Time(time) => start.elapsed() >= time,
                Limit::Updates(n) => updates >= n,
            };
            if enough {
                break;
            }
        }
        Ok(updates)
    }

    /// Validates paths, until `until` or to the end, and plans what follows from them.
    fn settle(&mut self, until: Option<Instant>) {
        if self.settled && self.validator.is_valid() {
            return;
        }
        let scene = self.editor.scene().clone();
        while !self.validator.is_valid() {
            let paths = until.map_or(usize::MAX, |_| PATHS_AT_ONCE);
            let differences = self.validator.step(&scene, &self.bvh, paths);
            self.clusters
                .apply(&scene, self.validator.paths(), &differences);
            self.ledger.note(&self.clusters, &self.held, &differences);
            if until.is_some_and(|until| Instant::now() >= until) {
                break;
            }
        }
        self.wanted.update(&self.clusters, self.target);
        self.settled = true;
        self.replan();
    }

    /// Scenes that no light is held under any more make room.
    fn forget(&mut self) -> Result<(), GpuError> {
        if self.journal.is_on() {
            return Ok(());
        }
        let current = self.illumination.version();
        let oldest = self.held.values().map(|h| h.version).min();
        self.illumination.forget(oldest.unwrap_or(current))
    }

    fn replan(&mut self) {
        let wanted = self.wanted.cells();
        let scale = self.clusters.scale().max(f64::MIN_POSITIVE);
        let key = |cell: &CellId| self.clusters.key(cell) as f64 / scale;
        let groups = schedule::exchanges(&self.held, wanted, |c| self.clusters.parent(c));
        let mut updates: Vec<_> = groups
            .into_iter()
            .filter(|(subtract, add)| {
                !(self.settings.indirect_only && schedule::all_direct(subtract, add))
            })
            .map(|group| {
                let ledger = |cell: &CellId| self.ledger.flux(cell);
                schedule::exchange(group, &self.held, wanted, key, ledger)
            })
            .collect();
        let current = self.illumination.version();
        // What is about to leave anyhow need not follow the scene first.
        let leaving: BTreeSet<CellId> = updates
            .iter()
            .filter(|u| u.invalid > LEAVES)
            .flat_map(|u| u.leaving())
            .copied()
            .collect();
        let mut regions = BTreeMap::new();
        for (&cell, held) in &self.held {
            if held.version == current || leaving.contains(&cell) {
                continue;
            }
            let regions = regions
                .entry(held.version)
                .or_insert_with(|| self.illumination.between(held.version));
            let invalid = self.ledger.flux(&cell);
            updates.push(schedule::advance(
                cell,
                held,
                regions,
                invalid,
                self.priority,
            ));
        }
        self.plan = Plan::new(updates, self.plan.owed());
    }

    /// Does an update: all of it is sent before anything else is.
    fn perform(&mut self, update: &schedule::Update) -> Result<(), GpuError> {
        let current = self.illumination.version();
        match &update.what {
            What::Advance(cell) => {
                // It may have been exchanged since it was planned.
                if let Some(held) = self.held.get_mut(cell)
                    && held.version != current
                {
                    for light in &held.selected.lights {
                        self.illumination
                            .push_difference(light, held.version, current)?;
                    }
                    let mut entry = Entry::new(update.kind, current);
                    entry.advanced = Some(held.clone());
                    held.version = current;
                    self.ledger.take(cell);
                    let (taken, _) = self.illumination.taken_and_done();
                    self.journal.note(entry, self.plan.invalid_flux(), taken);
                }
            }
            What::Exchange { subtract, add } => {
                let mut entry = Entry::new(update.kind, current);
                for cell in subtract {
                    if let Some(held) = self.held.remove(cell) {
                        for light in &held.selected.lights {
                            self.illumination
                                .push(light.clone(), Sign::Subtract, held.version)?;
                        }
                        entry.subtracted.push(held);
                    }
                }
                for cell in add {
                    if let Some(selected) = self.wanted.cells().get(cell).cloned() {
                        for light in &selected.lights {
                            self.illumination.push(light.clone(), Sign::Add, current)?;
                        }
                        let held = Held {
                            selected,
                            version: current,
                        };
                        entry.added.push(held.clone());
                        self.held.insert(*cell, held);
                    }
                }
                for cell in subtract.iter().chain(add) {
                    self.ledger.take(cell);
                }
                let (taken, _) = self.illumination.taken_and_done();
                self.journal.note(entry, self.plan.invalid_flux(), taken);
            }
        }
        Ok(())
    }

    /// An empty map of the scene, apart from the one that is worked on.
    pub(super) fn fresh_map(&self, scene: &Scene) -> Result<Illumination, GpuError> {
        empty_map(
            &self.gpu,
            scene,
            &self.texels,
            &self.settings,
            self.atlas.density,
        )
    }

    /// Waits, then resolves what the map holds at this moment.
    ///
    /// # Errors
    /// No memory, a lost device.
    pub fn lightmap(&mut self) -> Result<Lightmap, GpuError> {
        let scene = self.editor.scene().clone();
        let irradiance = self.illumination.irradiance()?;
        // In the objects' order, without what is gone: as a fresh bake lists them.
        let mut shown = Texels::default();
        let mut values = Vec::new();
        for (object, tiles) in (0..).zip(&self.texels.tiles) {
            if (object as usize) < scene.objects.len() && !scene.is_gone(object) {
                let range = tiles.start as usize * Texel::TILE..tiles.end as usize * Texel::TILE;
                shown.list.extend(&self.texels.list[range.clone()]);
                values.extend(&irradiance[range]);
            }
        }
        let enclosed = enclosed(&scene, &self.bvh, &shown.list);
        for (value, enclosed) in values.iter_mut().zip(enclosed) {
            if enclosed {
                *value = [0.0; 3];
            }
        }
        Ok(crate::lightmap::resolve::resolve(
            &scene,
            &self.atlas(),
            &shown,
            &values,
        ))
    }
}

fn empty_map(
    gpu: &Gpu,
    scene: &Scene,
    texels: &Texels,
    settings: &Settings,
    density: f32,
) -> Result<Illumination, GpuError> {
    let sizes = ShadowSizes {
        indirect: settings.shadow_size,
        direct: settings.direct_shadow_size,
        sun: settings.sun_shadow_size,
    };
    let evaluation = Evaluation {
        scale: (settings.fixed_point_bits as f32).exp2(),
        epsilon: 0.5 / density,
        disk_area: settings.disk_area,
    };
    Illumination::new(gpu, scene, texels, sizes, evaluation)
}

impl Probe for DirectLight<'_> {
    fn direct(&self, at: &Point) -> f32 {
        self.irradiance(at.position, at.normal, at.face)
    }

    fn bounced(&self, at: &Point, u: [f32; 2]) -> f32 {
        DirectLight::bounced(self, at.position, at.normal, at.face, u)
    }
}

fn resolve(scene: &Scene, job: &Job) -> Settings {
    let flux: f64 = paths::emitters(scene)
        .iter()
        .map(|e| f64::from(e.flux.element_sum()) / 3.0)
        .sum();
    job.options.resolve(flux, scene.surface_area())
}

fn budget(settings: &Settings) -> Budget {
    match settings.clusters {
        Cells::Count(n) => Budget::Cells(n as usize),
        Cells::Error(error) => Budget::Auto {
            error: f64::from(error),
        },
    }
}

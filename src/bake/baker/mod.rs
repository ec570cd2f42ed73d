//! The baker: a scene whose lightmap follows its edits. It holds lights, knows which it should hold, and goes from the one
//! to the other by updates that each leave the map whole.

mod edits;
mod holdings;
pub(super) mod journal;
pub(super) mod on_device;
mod outcome;
mod planning;
mod session;
pub(super) mod step;

use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use crate::bake::device::records::ShadowSizes;
use crate::bake::job::progress::{Listener, Stage, Stages};
use crate::bake::job::settings::{Clusters as Cells, Settings};
use crate::bake::job::{BakeError, Job};
use crate::bake::order::brightness::Brightness;
use crate::bake::order::plan::Plan;
use crate::bake::order::schedule::Priority;
use crate::bake::order::sight::Sight;
use crate::bake::passes::accumulate::Evaluation;
use crate::bake::passes::uv_raster;
use crate::bake::update::Illumination;
use crate::bake::world::clearance::Clearances;
use crate::bake::world::versions::Version;
use crate::cluster::{Budget, Clusters, SimilaritySettings, Wanted};
use crate::gpu::{Gpu, GpuError};
use crate::lightmap::Atlas;
use crate::lightmap::detail::{Point, Probe};
use crate::lightmap::texels::{ClaimStatistics, Texels};
use crate::scene::edit::Editor;
use crate::scene::{Camera, Document, Scene};
use crate::transport::SceneBvh;
use crate::transport::direct::DirectLight;
use crate::transport::paths::{self, PathSettings};
use crate::transport::validate::Validator;
use holdings::Holdings;
use journal::Journal;

/// The share of invalid flux at which balancing may have half of the work (eq. 2).
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
    pub(super) gpu: Gpu,
    pub(super) editor: Editor,
    pub(super) settings: Settings,
    pub(super) atlas: Atlas,
    pub(super) texels: Texels,
    /// Tiles of texels that came and that the map does not know yet.
    pub(super) new_tiles: Vec<Range<u32>>,
    /// Tiles of texels that are nobody's since a version: lights that are held under an earlier one need them still.
    pub(super) retired: Vec<(Version, Range<u32>)>,
    pub(super) clearances: Clearances,
    /// Who owns texels, by object.
    pub(super) claims: Vec<ClaimStatistics>,
    pub(super) bvh: SceneBvh,
    pub(super) validator: Validator,
    pub(super) clusters: Clusters,
    pub(super) target: Budget,
    pub(super) wanted: Wanted,
    /// The wanted cells are those of the clusters and the target.
    pub(super) settled: bool,
    /// How long paths were traced since the last plan was made, and how long that took.
    pub(super) traced: Duration,
    pub(super) planning: Duration,
    /// An edit came, and direct light has not followed it yet.
    pub(super) edited: bool,
    pub(super) holdings: Holdings,
    /// Who looks, and what of the map is seen: that part follows edits first.
    pub(super) camera: Option<Camera>,
    pub(super) sight: Option<Sight>,
    /// By tile of texels, the part of the map that was seen when it was divided.
    pub(super) seen: Vec<bool>,
    pub(super) plan: Plan,
    pub(super) turns_at: f64,
    pub(super) illumination: Illumination,
    pub(super) journal: Journal,
    pub(super) brightness: Brightness,
    pub(super) priority: Priority,
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
        listener: &dyn Listener,
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
                references: Arc::new(settings.reference_flux.clone()),
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
            let (claims, texels, clearances) =
                stages.time(Stage::Texels, || -> Result<_, BakeError> {
                    let claims = uv_raster::rasterize(gpu, &atlas)?;
                    let mut texels = Texels::build(&scene, &atlas, &claims);
                    let clearances = Clearances::new(&scene, &bvh, &mut texels, atlas.density);
                    Ok((claims, texels, clearances))
                })?;
            Ok((atlas, claims, texels, clearances))
        };
        let ((settings, validator, clusters), surface) = rayon::join(light, surface);
        let (atlas, claims, texels, clearances) = surface?;
        drop(probe);
        let mut illumination = stages.time(Stage::Upload, || {
            empty_map(gpu, &scene, &texels, &settings, atlas.density)
        })?;
        illumination.keep_maps(job.kept_maps);
        let holdings = Holdings::new(&clusters);
        let objects: Vec<u32> = (0..atlas.objects.len() as u32).collect();
        let mut baker = Self {
            gpu: gpu.clone(),
            target: budget(&settings),
            editor,
            settings,
            atlas,
            texels,
            new_tiles: Vec::new(),
            retired: Vec::new(),
            clearances,
            claims: Vec::new(),
            bvh,
            validator,
            clusters,
            wanted: Wanted::new(),
            settled: false,
            traced: Duration::ZERO,
            planning: Duration::ZERO,
            edited: false,
            holdings,
            camera: None,
            sight: None,
            seen: Vec::new(),
            plan: Plan::default(),
            turns_at: TURNS_AT,
            illumination,
            journal: Journal::default(),
            brightness: Brightness::default(),
            priority: Priority::default(),
        };
        baker.count_claims(&claims, &objects);
        Ok(baker)
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

    /// What the bake was resolved to: the same for every version of the scene, but that lights which come are noted in it.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The share of invalid flux at which balancing may have half of the work (eq. 2's t), above 0 and below 1; 0.1 at first.
    pub fn set_turns_at(&mut self, t: f64) {
        self.turns_at = t;
    }

    /// What `camera` sees is put right first, by the pixels that it takes: the map is divided into what is seen and the rest, and
    /// updates of what shows most are done there before they are done elsewhere. Without one, all surfaces count the same. The map that
    /// it comes to is the same.
    pub fn look_from(&mut self, camera: Option<&Camera>) {
        self.brightness.look_from(camera);
        self.camera = camera.cloned();
    }

    /// What tells which lights an edit made wrong: the order of updates, never their result.
    pub fn set_priority(&mut self, priority: Priority) {
        self.priority = priority;
    }

    /// Refines no further than this until told otherwise: for bakes that must end in time. [`Baker::is_converged`] then
    /// speaks of this target.
    pub(super) fn aim_at(&mut self, target: Option<Budget>) {
        self.target = target.unwrap_or_else(|| budget(&self.settings));
        self.settled = false;
    }

    /// How far to refine from now on, whatever the settings said: [`Baker::is_converged`] speaks of this, and so does what
    /// [`Baker::settings`] records.
    pub fn aim(&mut self, clusters: Cells) {
        self.settings.clusters = clusters;
        self.aim_at(None);
    }

    /// Begins from an empty map of the scene as it is, as a fresh bake would; paths and clusters stay, since they would come
    /// out the same.
    ///
    /// # Errors
    /// No memory, a lost device.
    pub fn start_over(&mut self) -> Result<(), GpuError> {
        self.illumination.clear()?;
        self.holdings = Holdings::new(&self.clusters);
        self.plan = Plan::default();
        self.settled = false;
        self.edited = false;
        Ok(())
    }

    /// The most lights that are sent to the device at once, 1 to 32; none: as many as are fast. The map's bits do not depend
    /// on it.
    pub fn set_batch(&mut self, lights: Option<u32>) {
        self.illumination.limit_batch(lights);
    }

    /// Waits until all that was sent is in the map.
    ///
    /// # Errors
    /// A lost device.
    pub fn finish(&mut self) -> Result<(), GpuError> {
        self.illumination.flush()
    }

    /// Virtual lights sent to the device so far, subtractions included; differences count once.
    pub fn lights_sent(&self) -> u64 {
        self.illumination.lights_sent()
    }

    pub(super) fn target(&self) -> Budget {
        self.target
    }

    /// The device it works on.
    pub fn gpu(&self) -> &Gpu {
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

pub(super) fn resolve(scene: &Scene, job: &Job) -> Settings {
    job.options
        .resolve(paths::references(scene), scene.surface_area())
}

fn budget(settings: &Settings) -> Budget {
    match settings.clusters {
        Cells::Count(n) => Budget::Cells(n as usize),
        Cells::Error(error) => Budget::Auto {
            error: f64::from(error),
        },
    }
}

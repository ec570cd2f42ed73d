//! The bake from end to end, on one page: what runs when, and what runs beside it.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use super::accumulate::Evaluation;
use super::enclosed::enclosed;
use super::progress::{Progress, Stage};
use super::records::ShadowSizes;
use super::report::{AtlasReport, Counts, DeviceReport, FluxReport, Memory, Report, host_peak};
use super::settings::{Clusters as Cells, Options, Settings};
use super::update::{Illumination, Sign};
use super::uv_raster;
use crate::cluster::{Budget, CellId, Clusters, Selected, Shape, SimilaritySettings};
use crate::gpu::{Gpu, GpuError};
use crate::lightmap::detail::{Point, Probe};
use crate::lightmap::texels::Texels;
use crate::lightmap::{Atlas, AtlasOptions, Lightmap, LightmapError};
use crate::scene::Scene;
use crate::transport::SceneBvh;
use crate::transport::direct::DirectLight;
use crate::transport::paths::{self, PathSet, PathSettings};

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
    /// Where it lies on the objects.
    pub atlas: Atlas,
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
    /// The invariant of exact updates is broken.
    #[error(
        "verify: {texels} of {all} texels differ after subtracting and adding lights; the first is texel slot {first}: please report this with the device's name"
    )]
    Verify {
        /// Texels that differ.
        texels: usize,
        /// Texels in all.
        all: usize,
        /// The first that differs.
        first: usize,
    },
}

/// Seconds by stage, told to the listener as they end.
struct Stages<'a> {
    progress: &'a dyn Progress,
    seconds: Mutex<BTreeMap<Stage, f64>>,
}

impl Stages<'_> {
    fn time<T>(&self, stage: Stage, work: impl FnOnce() -> T) -> T {
        self.progress.at(stage, 0, 1);
        let start = Instant::now();
        let result = work();
        let took = start.elapsed();
        self.seconds
            .lock()
            .unwrap_or_else(|e| e.into_inner())
            .insert(stage, took.as_secs_f64());
        self.progress.ended(stage, took);
        result
    }
}

impl Probe for DirectLight<'_> {
    fn direct(&self, at: &Point) -> f32 {
        self.irradiance(at.position, at.normal, at.face)
    }

    fn bounced(&self, at: &Point, u: [f32; 2]) -> f32 {
        DirectLight::bounced(self, at.position, at.normal, at.face, u)
    }
}

/// Bakes `scene`.
///
/// The atlas and its texels (first on the host, then on the device) and the light paths with their octree are made side
/// by side; then the device accumulates direct lights while the host makes the indirect ones.
///
/// # Errors
/// No room in the atlas, no memory, a lost device. Nothing is written.
pub fn bake(
    gpu: &Gpu,
    scene: &Scene,
    job: &Job,
    progress: &dyn Progress,
) -> Result<Baked, BakeError> {
    let start = Instant::now();
    let stages = Stages {
        progress,
        seconds: Mutex::default(),
    };

    let bvh = stages.time(Stage::Bvh, || SceneBvh::build(scene));
    let light = || {
        let settings = job
            .repeat
            .as_ref()
            .map_or_else(|| resolve(scene, job), |(settings, _)| settings.clone());
        let path_settings = PathSettings {
            flux_per_path: settings.flux_per_path,
            max_bounces: settings.bounces,
            seed: settings.seed,
        };
        let paths = stages.time(Stage::Paths, || paths::trace(scene, &bvh, &path_settings));
        let clusters = stages.time(Stage::Cluster, || {
            Clusters::new(scene, &paths, &path_settings, SimilaritySettings::default())
        });
        (settings, paths, clusters)
    };
    let probe = DirectLight::new(scene, &bvh);
    let surface = || -> Result<_, BakeError> {
        let atlas = stages.time(Stage::Unwrap, || match &job.repeat {
            Some((_, a)) => {
                Atlas::from_settings(scene, a.density, a.page_size, a.pages, &a.objects)
            }
            None => Atlas::build_lit(scene, &job.atlas, Some(&probe)),
        })?;
        let (claims, texels) = stages.time(Stage::Texels, || -> Result<_, BakeError> {
            let claims = uv_raster::rasterize(gpu, &atlas)?;
            let texels = Texels::build(scene, &atlas, &claims);
            Ok((claims, texels))
        })?;
        Ok((atlas, claims, texels))
    };
    let ((settings, paths, clusters), surface) = rayon::join(light, surface);
    let (atlas, claims, texels) = surface?;

    let mut illumination = stages.time(Stage::Upload, || -> Result<_, GpuError> {
        Illumination::new(
            gpu,
            scene,
            &texels,
            ShadowSizes {
                indirect: settings.shadow_size,
                direct: settings.direct_shadow_size,
                sun: settings.sun_shadow_size,
            },
            Evaluation {
                scale: (settings.fixed_point_bits as f32).exp2(),
                epsilon: 0.5 / atlas.density,
                disk_area: settings.disk_area,
            },
        )
    })?;

    let deadline = job.budget.map(|budget| start + budget.mul_f64(0.9));
    let state = stages.time(Stage::Accumulate, || {
        accumulate(&mut illumination, &clusters, &settings, deadline, progress)
    })?;
    if job.verify {
        verify(&mut illumination, &state.held)?;
    }
    let lightmap = stages.time(Stage::Resolve, || -> Result<_, GpuError> {
        let mut irradiance = illumination.irradiance()?;
        for (value, enclosed) in irradiance
            .iter_mut()
            .zip(enclosed(scene, &bvh, &texels.list))
        {
            if enclosed {
                *value = [0.0; 3];
            }
        }
        Ok(crate::lightmap::resolve::resolve(
            scene,
            &atlas,
            &texels,
            &irradiance,
        ))
    })?;

    let mut counts = Counts {
        triangles: scene
            .objects
            .iter()
            .map(|o| scene.meshes[o.mesh as usize].triangles.len() as u64)
            .sum(),
        objects: scene.objects.len() as u64,
        lights: scene.lights.len() as u64,
        texels: claims.statistics.texels.into(),
        t_uv: claims.statistics.t_uv.into(),
        p_uv: claims.statistics.p_uv.into(),
        paths: paths.paths() as u64,
        vpls: paths.vpls().count() as u64,
        clusters: state.held.len() as u64,
        accumulated: illumination.lights_sent(),
        ..Counts::default()
    };
    for light in state.held.values().flat_map(|s| &s.lights) {
        *counts.virtual_lights.entry(light.shape.name()).or_default() += 1;
    }
    let report = Report {
        generator: concat!("rebake ", env!("CARGO_PKG_VERSION")).into(),
        semantics: if settings.indirect_only {
            "irradiance in lux, linear Rec. 709, front side, indirect light alone"
        } else {
            "irradiance in lux, linear Rec. 709, front side, direct and indirect light"
        },
        atlas: AtlasReport {
            density: atlas.density,
            page_size: atlas.page_size,
            pages: atlas.pages,
            objects: atlas.placements(scene),
        },
        device: DeviceReport {
            name: gpu.info().name.clone(),
            driver: gpu.info().driver.clone(),
            threads: rayon::current_num_threads(),
        },
        flux: flux(&paths, &state.held),
        counts,
        settings,
        estimated_error: state.error,
        stopped_early: state.stopped_early,
        memory: Memory {
            host_peak: host_peak(),
            device_peak: gpu.peak_bytes(),
        },
        seconds: stages
            .seconds
            .into_inner()
            .unwrap_or_else(|e| e.into_inner())
            .into_iter()
            .map(|(stage, seconds)| (stage.name(), seconds))
            .collect(),
        total_seconds: start.elapsed().as_secs_f64(),
        gpu: gpu.timings(),
    };
    Ok(Baked {
        lightmap,
        atlas,
        report,
    })
}

fn resolve(scene: &Scene, job: &Job) -> Settings {
    let flux: f64 = paths::emitters(scene)
        .iter()
        .map(|e| f64::from(e.flux.element_sum()) / 3.0)
        .sum();
    job.options.resolve(flux, scene.surface_area())
}

/// What the map holds.
struct State {
    /// By cell.
    held: BTreeMap<CellId, Selected>,
    error: f64,
    stopped_early: bool,
}

/// Adds all virtual lights. With a deadline, a coarse cut comes first and is refined, so that the map is complete
/// whenever time runs out.
fn accumulate(
    illumination: &mut Illumination,
    clusters: &Clusters,
    settings: &Settings,
    deadline: Option<Instant>,
    progress: &dyn Progress,
) -> Result<State, GpuError> {
    let last = clusters.select(match settings.clusters {
        Cells::Count(n) => Budget::Cells(n as usize),
        Cells::Error(error) => Budget::Auto {
            error: f64::from(error),
        },
    });
    let mut ladder = vec![last];
    while deadline.is_some() && ladder[0].cells.len() > 64 {
        let coarser = clusters.select(Budget::Cells(ladder[0].cells.len() / 2));
        if coarser.cells.len() >= ladder[0].cells.len() {
            break;
        }
        ladder.insert(0, coarser);
    }

    let mut state = State {
        held: BTreeMap::new(),
        error: f64::INFINITY,
        stopped_early: false,
    };
    let (mut sent, mut spent) = (0u64, Duration::ZERO);
    for cut in ladder {
        let started = Instant::now();
        let (direct, indirect): (Vec<CellId>, Vec<CellId>) = cut
            .cells
            .iter()
            .partition(|c| matches!(c, CellId::Aperture { .. }));
        let part = |cells| crate::cluster::Cut {
            cells,
            error: cut.error,
        };
        let mut next = if settings.indirect_only {
            Vec::new()
        } else {
            clusters.virtual_lights(&part(direct))
        };
        let early = state.held.is_empty() && deadline.is_none();
        if early {
            // The device gets the direct lights while the host makes the others.
            for light in next.iter().flat_map(|s| &s.lights) {
                illumination.push(light.clone(), Sign::Add, 0)?;
            }
        }
        let direct_cells = next.len();
        next.extend(clusters.virtual_lights(&part(indirect)));

        let next: BTreeMap<CellId, (usize, Selected)> = next
            .into_iter()
            .enumerate()
            .map(|(i, s)| (s.cell, (i, s)))
            .collect();
        let leaves = state
            .held
            .values()
            .filter(|old| next.get(&old.cell).is_none_or(|(_, new)| new != *old));
        let comes = next.values().filter(|(i, new)| {
            state.held.get(&new.cell) != Some(new) && !(early && *i < direct_cells)
        });
        let update: Vec<_> = leaves
            .flat_map(|s| s.lights.iter().map(|l| (l, Sign::Subtract)))
            .chain(comes.flat_map(|(_, s)| s.lights.iter().map(|l| (l, Sign::Add))))
            .collect();
        if let Some(deadline) = deadline
            && sent > 0
        {
            let expected = spent.mul_f64(update.len() as f64 / sent as f64);
            if Instant::now() + expected > deadline {
                state.stopped_early = true;
                break;
            }
        }
        let total = update.len() as u64;
        for (done, (light, sign)) in update.into_iter().enumerate() {
            illumination.push(light.clone(), sign, 0)?;
            progress.at(Stage::Accumulate, done as u64, total);
        }
        illumination.flush()?;
        sent += total;
        spent += started.elapsed();
        state.held = next.into_values().map(|(_, s)| (s.cell, s)).collect();
        state.error = cut.error;
    }
    Ok(state)
}

/// Subtracts every second light, adds it again, and compares the sums bit for bit.
fn verify(
    illumination: &mut Illumination,
    held: &BTreeMap<CellId, Selected>,
) -> Result<(), BakeError> {
    let before = illumination.sums()?;
    for sign in [Sign::Subtract, Sign::Add] {
        for light in held.values().flat_map(|s| &s.lights).step_by(2) {
            illumination.push(light.clone(), sign, 0)?;
        }
    }
    let after = illumination.sums()?;
    let tile = 3 * super::shared::TILE as usize;
    let slot =
        |i: usize| i / tile * super::shared::TILE as usize + i % super::shared::TILE as usize;
    let mut differ: Vec<usize> = before
        .iter()
        .zip(&after)
        .enumerate()
        .filter(|(_, (a, b))| a != b)
        .map(|(i, _)| slot(i))
        .collect();
    differ.sort_unstable();
    differ.dedup();
    match differ.first() {
        Some(&first) => Err(BakeError::Verify {
            texels: differ.len(),
            all: before.len() / 3,
            first,
        }),
        None => Ok(()),
    }
}

fn flux(paths: &PathSet, held: &BTreeMap<CellId, Selected>) -> FluxReport {
    let balance = paths.balance();
    let mean = |v: glam::Vec3| f64::from(v.x) / 3.0 + f64::from(v.y) / 3.0 + f64::from(v.z) / 3.0;
    let vpls: f64 = paths.vpls().map(|v| mean(v.flux)).sum();
    let lights = held.values().flat_map(|s| &s.lights);
    let virtual_lights: f64 = lights.filter(|l| !l.direct).map(|l| mean(l.flux)).sum();
    FluxReport {
        balance_error: balance.error(),
        lost_at_cap_share: balance.lost_at_cap / balance.sent.max(f64::MIN_POSITIVE),
        clustering_error: (vpls - virtual_lights).abs() / vpls.max(f64::MIN_POSITIVE),
        vpls,
        virtual_lights,
        paths: balance,
    }
}

impl Shape {
    fn name(&self) -> &'static str {
        match self {
            Shape::Polygon { .. } => "polygon",
            Shape::Disk { .. } => "disk",
            Shape::Point => "point",
            Shape::Spot { .. } => "spot",
            Shape::Directional { .. } => "directional",
        }
    }
}

//! How cost grows with the work: VPLs, texels, triangles, batches, cells.

use std::time::Instant;

use glam::Vec3;

use super::figure::{Better, Figure, Point};
use super::response::Followed;
use super::table::since;
use super::{Bench, BenchError, response};
use crate::bake::{Baker, Clusters as Cells, Job, Limit, Options, Quality, ShadowBench, Silent};
use crate::cluster::{Budget, Clusters, SimilaritySettings};
use crate::gpu::GpuError;
use crate::lightmap::AtlasOptions;
use crate::scene::Scene;
use crate::transport::SceneBvh;
use crate::transport::{PathSettings, trace};

/// Cells of a bake of which only the time per virtual light matters.
const FEW_CELLS: u32 = 64;
/// Paths of such a bake.
const FEW_PATHS: u64 = 1 << 14;
/// Depth maps drawn at every point of the triangles' sweep.
const MAPS: u32 = 64;
/// Their size, pixels: the default preset's for indirect lights.
const MAP_SIZE: u32 = 128;

impl Bench<'_> {
    /// VPL13 fig. 12: from light sources to virtual lights, on the host.
    pub(super) fn creation(&mut self) -> Result<(), BenchError> {
        let plan = self.plan;
        let bvh = SceneBvh::build(&self.scene);
        let error = self
            .plan
            .job
            .options
            .quality
            .unwrap_or(Quality::Preview)
            .preset();
        for &paths in &plan.paths {
            let settings = PathSettings::for_paths(&self.scene, paths.min(1 << 30) as u32);
            let runs = self.repeat(&format!("virtual lights of {paths} paths"), || {
                let start = Instant::now();
                let set = trace(&self.scene, &bvh, &settings);
                let traced = start.elapsed();
                let similarity = SimilaritySettings::default();
                let clusters = Clusters::new(&self.scene, &set, &settings, similarity);
                let kept = start.elapsed();
                let cut = clusters.select(Budget::Auto {
                    error: f64::from(error.error),
                });
                let lights: usize = clusters
                    .virtual_lights(&cut)
                    .iter()
                    .map(|s| s.lights.len())
                    .sum();
                let made = start.elapsed();
                let times = [traced, kept - traced, made - kept].map(|t| t.as_secs_f64() * 1e3);
                Ok((set.vpls().count(), cut.cells.len(), lights, times))
            })?;
            let (vpls, cells, lights, _) = runs[0];
            let time = |name: &str, i: usize| {
                Figure::new(name, "ms", Better::Lower, runs.iter().map(|r| r.3[i]))
            };
            self.point(
                "virtual light creation",
                "VPLs",
                Point {
                    at: vpls as f64,
                    figures: vec![
                        time("paths", 0),
                        time("octree", 1),
                        time("lights", 2),
                        Figure::count("clusters", cells as f64),
                        Figure::count("virtual lights", lights as f64),
                    ],
                },
            );
        }
        Ok(())
    }

    /// VPL13 fig. 13: the same lights onto more and more texels.
    pub(super) fn texels(&mut self) -> Result<(), BenchError> {
        let plan = self.plan;
        for &texels in &plan.texels {
            let job = self.few(texels);
            self.tell(&format!("{texels} texels"));
            let (scene, document) = (self.scene.clone(), self.document.clone());
            let made = Baker::new(self.gpu, scene, document, &job, &Silent);
            let result = made.map_err(BenchError::from).and_then(|mut baker| {
                let lit = baker.report().counts.texels;
                let runs = self.repeat(&format!("{texels} texels"), || fill(&mut baker))?;
                Ok((lit, runs))
            });
            match self.unless_too_large(&format!("{texels} texels"), result)? {
                Some((lit, runs)) => self.point(
                    "accumulation",
                    "texels",
                    Point {
                        at: lit as f64,
                        figures: runs_per_light(&runs),
                    },
                ),
                None => break,
            }
        }
        Ok(())
    }

    /// Depth maps of the scene's triangles, cut into smaller ones or thinned out.
    pub(super) fn triangles(&mut self) -> Result<(), BenchError> {
        let plan = self.plan;
        for &target in &plan.triangles {
            self.tell(&format!("{target} triangles"));
            let scene = with_triangles(&self.scene, target as usize);
            let made = ShadowBench::new(self.gpu, &scene).map_err(BenchError::from);
            let result = made.and_then(|bench| {
                let runs = self.repeat(&format!("{target} triangles"), || {
                    Ok(bench.run(MAP_SIZE, MAPS)?)
                })?;
                Ok((bench.triangles(), runs))
            });
            match self.unless_too_large(&format!("{target} triangles"), result)? {
                Some((triangles, runs)) => {
                    let each = |s: f64| 1e3 * s / f64::from(MAPS);
                    let device = |r: &crate::bake::ShadowCost| r.passes.iter().map(|p| p.1).sum();
                    let counts = runs[0].counts;
                    let count = |name, all: u64| Figure::count(name, all as f64 / f64::from(MAPS));
                    let wall = runs.iter().map(|r| each(r.wall));
                    let passes = runs.iter().map(|r| each(device(r)));
                    self.point(
                        "depth maps",
                        "triangles",
                        Point {
                            at: triangles as f64,
                            figures: vec![
                                Figure::new("depth map", "ms", Better::Lower, wall),
                                Figure::new("depth map, device", "ms", Better::Lower, passes),
                                count("chunks", counts.chunks),
                                count("triangles drawn", counts.triangles),
                                count("of these in parts", counts.large),
                            ],
                        },
                    );
                }
                None => break,
            }
        }
        Ok(())
    }

    /// The same lights in batches of different sizes: one read-modify-write of the map a batch.
    pub(super) fn batches(&mut self) -> Result<(), BenchError> {
        let plan = self.plan;
        let mut baker = self.baker(&self.few(plan.job.atlas.texels))?;
        for &lights in &plan.batches {
            baker.set_batch(Some(lights));
            let runs = self.repeat(&format!("batches of {lights}"), || fill(&mut baker))?;
            self.point(
                "batches",
                "lights",
                Point {
                    at: f64::from(lights),
                    figures: runs_per_light(&runs),
                },
            );
        }
        Ok(())
    }

    /// The same scene by more and more cells: the time of a light, and what an edit costs.
    pub(super) fn cells(&mut self) -> Result<(), BenchError> {
        let plan = self.plan;
        let mut baker = self.baker(&plan.job)?;
        let scenario = response::builtin(self.name).into_iter().next();
        let scenario = scenario.or(self.plan.scenarios.first().cloned());
        if scenario.is_none() {
            let why = "cells: no updates per second, since the scene has no scenario; --script FILE gives it one";
            self.out.missing.push(why.into());
        }
        for &cells in &plan.cells {
            baker.aim(Cells::Count(cells));
            let runs = self.repeat(&format!("{cells} cells"), || fill(&mut baker))?;
            let mut figures = runs_per_light(&runs);
            let held = baker.report().counts;
            let lights: u64 = held.virtual_lights.values().sum();
            figures.push(Figure::count("virtual lights", lights as f64));
            if let Some(scenario) = &scenario {
                let folder = scenario.folder.clone().unwrap_or_default();
                let runs = self.repeat(&format!("{cells} cells, an edit"), || {
                    response::follow(&mut baker, scenario, &folder)
                })?;
                let mut of = |name: &str, unit: &str, better, value: fn(&Followed) -> f64| {
                    figures.push(Figure::new(name, unit, better, runs.iter().map(value)));
                };
                of("updates", "1/s", Better::Higher, |r| {
                    r.updates as f64 / r.seconds
                });
                of("update size", "lights", Better::Neither, |r| {
                    r.lights as f64 / r.updates.max(1) as f64
                });
                of("first update", "s", Better::Lower, |r| r.first);
                of("converged", "s", Better::Lower, |r| r.seconds);
            }
            self.point(
                "cells",
                "cells",
                Point {
                    at: held.clusters as f64,
                    figures,
                },
            );
        }
        Ok(())
    }

    fn baker(&self, job: &Job) -> Result<Baker, BenchError> {
        self.tell("laying out");
        let (scene, document) = (self.scene.clone(), self.document.clone());
        Ok(Baker::new(self.gpu, scene, document, job, &Silent)?)
    }

    /// A bake of few lights onto about so many texels.
    pub(super) fn few(&self, texels: u64) -> Job {
        Job {
            atlas: AtlasOptions {
                texels,
                max_density: f32::MAX,
                ..self.plan.job.atlas
            },
            options: Options {
                clusters: Some(FEW_CELLS),
                paths: Some(FEW_PATHS),
                ..self.plan.job.options.clone()
            },
            ..Job::default()
        }
    }

    /// Notes what the device has no memory for, and goes on.
    fn unless_too_large<T>(
        &mut self,
        what: &str,
        result: Result<T, BenchError>,
    ) -> Result<Option<T>, BenchError> {
        match result {
            Err(BenchError::Gpu(error @ GpuError::OutOfMemory { .. }))
            | Err(BenchError::Bake(crate::bake::BakeError::Gpu(
                error @ GpuError::OutOfMemory { .. },
            ))) => {
                self.out.missing.push(format!("{what} and more: {error}"));
                Ok(None)
            }
            result => result.map(Some),
        }
    }
}

/// What a bake from an empty map took: lights, wall milliseconds, device milliseconds.
struct Fill {
    lights: f64,
    wall: f64,
    device: f64,
}

/// Fills the map anew.
fn fill(baker: &mut Baker) -> Result<Fill, BenchError> {
    baker.start_over()?;
    // Tracing and clustering are not what is measured.
    let lights = baker.lights_left()? as f64;
    let gpu = baker.gpu().clone();
    let before = gpu.timings();
    let start = Instant::now();
    baker.step(Limit::Converged)?;
    baker.finish()?;
    Ok(Fill {
        lights: lights.max(1.0),
        wall: start.elapsed().as_secs_f64() * 1e3,
        device: since(&gpu, &before).values().sum(),
    })
}

fn runs_per_light(runs: &[Fill]) -> Vec<Figure> {
    let figure = |name: &str, of: fn(&Fill) -> f64| {
        let values = runs.iter().map(|r| of(r) / r.lights);
        Figure::new(name, "ms", Better::Lower, values)
    };
    vec![
        figure("virtual light", |r| r.wall),
        figure("virtual light, device", |r| r.device),
    ]
}

/// One opaque object of `target` triangles where the scene's are: each cut into four until there are enough, then thinned out
/// evenly.
fn with_triangles(scene: &Scene, target: usize) -> Scene {
    let mut triangles: Vec<[Vec3; 3]> = (0..scene.objects.len() as u32)
        .flat_map(|o| {
            let count = scene.mesh(o).triangles.len() as u32;
            (0..count).map(move |t| scene.world_triangle(o, t))
        })
        .collect();
    while triangles.len() < target && !triangles.is_empty() {
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| 0.5 * (p + q));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let all = triangles.len();
    let kept: Vec<[Vec3; 3]> = (0..target.min(all))
        .map(|i| triangles[(i as u64 * all as u64 / target.max(1) as u64) as usize])
        .collect();
    Scene::of_triangles(&kept)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::testing::cornell;

    #[test]
    fn scenes_get_as_many_triangles_as_asked_for_and_stay_where_they_are() {
        let scene = cornell();
        let bounds = scene.bounds();
        for target in [5, 100, 1000] {
            let made = with_triangles(&scene, target);
            assert_eq!(made.mesh(0).triangles.len(), target);
            let b = made.bounds();
            assert!(b.min.cmpge(bounds.min - 1e-5).all() && b.max.cmple(bounds.max + 1e-5).all());
        }
        assert!(
            with_triangles(&Scene::default(), 10).meshes[0]
                .triangles
                .is_empty()
        );
    }
}

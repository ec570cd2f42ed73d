//! Draws depth maps from random points of a scene and measures it, for `rebake bench` and `benches/passes.rs`.

use std::collections::HashMap;
use std::time::Instant;

use glam::Vec3;

use crate::bake::device::records::View;
use crate::bake::device::records::asked::ALL;
use crate::bake::device::records::{coarse, hemicube_bytes};
use crate::bake::device::shared::{BATCH, FACES, VIEW_HEMICUBE};
use crate::bake::job::report::ShadowCounts;
use crate::bake::passes::shadow::{Maps, ShadowPass};
use crate::bake::world::occluders::Occluders;
use crate::bake::world::versions::Versions;
use crate::gpu::{Address, Gpu, Result, Stage};
use crate::scene::{Bounds, Scene};

/// A scene on the device, ready for its depth maps to be measured.
pub struct ShadowBench {
    gpu: Gpu,
    occluders: Occluders,
    objects: usize,
    bounds: Bounds,
    /// Points on surfaces and the sides they face.
    points: Vec<(Vec3, Vec3)>,
}

/// What some depth maps cost, in seconds for all of them.
pub struct ShadowCost {
    /// From submission to end.
    pub wall: f64,
    /// Of all threads of this process; 0 where the system does not tell.
    pub cpu: f64,
    /// Device time by pass.
    pub passes: Vec<(&'static str, f64)>,
    /// What was drawn.
    pub counts: ShadowCounts,
    /// Of the last batch's maps: equal maps have equal sums.
    pub checksum: u64,
}

impl ShadowBench {
    /// Uploads `scene`.
    ///
    /// # Errors
    /// No memory.
    pub fn new(gpu: &Gpu, scene: &Scene) -> Result<Self> {
        let triangles: Vec<(u32, u32)> = (0..scene.objects.len() as u32)
            .flat_map(|o| (0..scene.mesh(o).triangles.len() as u32).map(move |t| (o, t)))
            .collect();
        let mut state = 1u64;
        let mut next = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 33) as usize % triangles.len().max(1)
        };
        // As many points as a few batches have; triangles without area have no side.
        let points = (0..64 * BATCH)
            .filter_map(|_| {
                let (object, triangle) = *triangles.get(next())?;
                let [a, b, c] = scene.world_triangle(object, triangle);
                let normal = (b - a).cross(c - a).try_normalize()?;
                Some(((a + b + c) / 3.0 + normal * 1e-3, normal))
            })
            .collect();
        Ok(Self {
            gpu: gpu.clone(),
            occluders: Occluders::new(gpu, scene)?,
            objects: scene.objects.len(),
            bounds: scene.bounds(),
            points,
        })
    }

    /// Triangles that cast shadows.
    pub fn triangles(&self) -> u64 {
        self.occluders.triangles()
    }

    /// Draws `count` hemicubes of `size` pixels in full batches, after one batch that is not measured.
    ///
    /// # Errors
    /// No memory, a lost device.
    pub fn run(&self, size: u32, count: u32) -> Result<ShadowCost> {
        let bytes = hemicube_bytes(size);
        let batch = (256 << 20) / bytes;
        let batch = batch.clamp(1, u64::from(BATCH)) as usize;
        let mut pass = ShadowPass::new(&self.gpu, bytes * batch as u64)?;
        let versions = Versions::new(&self.gpu, &vec![true; self.objects], self.bounds)?;
        let views: Vec<View> = self
            .points
            .iter()
            .cycle()
            .zip(0..count)
            .map(|((origin, normal), _)| {
                let (x, y) = normal.any_orthonormal_pair();
                View {
                    origin: origin.to_array(),
                    x: x.to_array(),
                    y: y.to_array(),
                    z: normal.to_array(),
                    depth: Address::default(),
                    size,
                    kind: VIEW_HEMICUBE,
                    cos_cone: 0.0,
                    coarse: coarse(size),
                    version: 0,
                    other: 0,
                    base: 0,
                    kept: 0,
                    asked: [ALL; FACES as usize],
                }
            })
            .collect();
        let draw = |pass: &mut ShadowPass, views: &[View]| -> Result<()> {
            let mut cmd = self.gpu.commands()?;
            cmd.barrier(Stage::All, Stage::All);
            pass.record(
                &self.gpu,
                &mut cmd,
                &self.occluders,
                versions.address(),
                &Maps {
                    views,
                    kept: &HashMap::new(),
                    blocks: true,
                },
            )?;
            cmd.submit()?.wait()
        };
        draw(&mut pass, &views[..views.len().min(batch)])?;
        let drawn = pass.counts()?;
        let before = self.gpu.timings();
        let (start, cpu) = (Instant::now(), cpu_seconds());
        for part in views.chunks(batch) {
            draw(&mut pass, part)?;
        }
        let (wall, cpu) = (start.elapsed().as_secs_f64(), cpu_seconds() - cpu);
        let earlier = |name| before.iter().find(|t| t.name == name).map_or(0.0, |t| t.ms);
        let passes = self
            .gpu
            .timings()
            .iter()
            .map(|t| (t.name, (t.ms - earlier(t.name)) / 1e3))
            .collect();
        let last = views.chunks(batch).next_back().map_or(0, <[View]>::len);
        let checksum = pass
            .read_depth(last * bytes as usize / 4)?
            .iter()
            .fold(0u64, |sum, d| {
                sum.rotate_left(5).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ u64::from(d.to_bits())
            });
        Ok(ShadowCost {
            wall,
            cpu,
            passes,
            counts: pass.counts()?.since(&drawn),
            checksum,
        })
    }
}

/// User and system time of this process, from Linux's /proc in its ticks of 10 ms.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The name in parentheses may hold spaces; utime and stime are the 12th and 13th field after it.
    let fields = stat.rsplit(')').next().unwrap_or_default();
    fields
        .split_whitespace()
        .skip(11)
        .take(2)
        .filter_map(|ticks| ticks.parse::<f64>().ok())
        .sum::<f64>()
        / 100.0
}

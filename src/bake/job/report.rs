//! What a bake did: the content of bake.json, from which `--settings` repeats it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::settings::Settings;
use crate::gpu::Timing;
use crate::lightmap::Placement;
use crate::transport::FluxBalance;

/// bake.json.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The program and its version.
    pub generator: String,
    /// What the lightmaps hold.
    pub semantics: &'static str,
    /// Enough to repeat the bake of the written scene.
    pub settings: Settings,
    /// Where every object's light lies.
    pub atlas: AtlasReport,
    /// What it ran on.
    pub device: DeviceReport,
    /// How much there was.
    pub counts: Counts,
    /// Where the light went, lumens.
    pub flux: FluxReport,
    /// The metric's estimate of the relative error of the cut.
    pub estimated_error: f64,
    /// Whether `--budget` stopped it before the cut that the settings ask for.
    pub stopped_early: bool,
    /// Bytes.
    pub memory: Memory,
    /// Wall-clock seconds of each stage; stages overlap.
    pub seconds: BTreeMap<&'static str, f64>,
    /// Wall-clock seconds from the process's start until this report.
    pub total_seconds: f64,
    /// Device time by pass.
    pub gpu: Vec<Timing>,
}

/// The atlas in bake.json.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct AtlasReport {
    /// Texels per metre.
    pub density: f32,
    /// Width and height of a page, texels.
    pub page_size: u32,
    /// Pages.
    pub pages: u32,
    /// Node by node.
    pub objects: Vec<Placement>,
}

/// The device in bake.json.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceReport {
    /// Its name.
    pub name: String,
    /// Its driver and version.
    pub driver: String,
    /// Threads on the host's side.
    pub threads: usize,
}

/// Counts in bake.json.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Counts {
    /// Triangles of all instances.
    pub triangles: u64,
    /// Objects.
    pub objects: u64,
    /// Light sources.
    pub lights: u64,
    /// Lit texels.
    pub texels: u64,
    /// Triangles that own a texel (VPL13 section 7.3).
    pub t_uv: u64,
    /// Texels that no triangle's interior covers (VPL13 section 7.3).
    pub p_uv: u64,
    /// Light paths.
    pub paths: u64,
    /// Virtual point lights.
    pub vpls: u64,
    /// Selected cells.
    pub clusters: u64,
    /// Virtual lights that make up the map, by shape.
    pub virtual_lights: BTreeMap<&'static str, u64>,
    /// Virtual lights sent to the device, subtractions included.
    pub accumulated: u64,
    /// Pairs of a texel and a light that culling left in and the device evaluated, by its pass: over the pass's time in
    /// `gpu`, the rate.
    pub pairs: BTreeMap<&'static str, u64>,
    /// Pairs of a texel and a light in all tiles that were looked at for a batch; those that no pass evaluated were culled.
    pub offered_pairs: u64,
    /// Lookups in depth maps that evaluating `pairs` takes at most.
    pub taps: BTreeMap<&'static str, u64>,
    /// Depth maps.
    pub shadows: ShadowCounts,
}

/// What was drawn into depth maps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ShadowCounts {
    /// Maps; lights that shine all around have two.
    pub maps: u64,
    /// Faces of these: five of a hemicube, one of parallel light.
    pub faces: u64,
    /// Triangles in all faces if nothing were culled.
    pub offered: u64,
    /// Chunks of triangles that were drawn, each time for a face.
    pub chunks: u64,
    /// Triangles in these.
    pub triangles: u64,
    /// Of these, triangles that cover too many pixels for one invocation.
    pub large: u64,
}

impl ShadowCounts {
    /// What came to these since `earlier` ones.
    pub(in crate::bake) fn since(&self, earlier: &Self) -> Self {
        Self {
            maps: self.maps - earlier.maps,
            faces: self.faces - earlier.faces,
            offered: self.offered - earlier.offered,
            chunks: self.chunks - earlier.chunks,
            triangles: self.triangles - earlier.triangles,
            large: self.large - earlier.large,
        }
    }
}

/// Flux in bake.json, lumens (mean over RGB).
#[derive(Clone, Debug, Serialize)]
pub struct FluxReport {
    /// Where the paths' energy went.
    #[serde(flatten)]
    pub paths: FluxBalance,
    /// What of it is unaccounted for, relative to what was sent.
    pub balance_error: f64,
    /// The share of the sent light that the cap on bounces cut off.
    pub lost_at_cap_share: f64,
    /// Sent on by all VPLs.
    pub vpls: f64,
    /// Sent by all indirect virtual lights.
    pub virtual_lights: f64,
    /// How far the two are apart, relative.
    pub clustering_error: f64,
}

/// Memory in bake.json, bytes.
#[derive(Clone, Debug, Serialize)]
pub struct Memory {
    /// The most the process had resident; none where the system does not tell.
    pub host_peak: Option<u64>,
    /// The most that buffers held on the device.
    pub device_peak: u64,
    /// The most that resources of a name held there at once, by name.
    pub device: BTreeMap<String, u64>,
}

/// The process's peak resident size.
pub(in crate::bake) fn host_peak() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024)
}

//! What a baker has made by now: the map, and the report on it.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::bake::baker::Baker;
use crate::bake::job::report::{
    AtlasReport, Counts, DeviceReport, FluxReport, Memory, Report, host_peak,
};
use crate::bake::order::schedule::Held;
use crate::bake::world::enclosed::darken;
use crate::cluster::{CellId, Shape};
use crate::gpu::GpuError;
use crate::lightmap::texels::{ClaimStatistics, Texels};
use crate::lightmap::{Lightmap, Texel};
use crate::transport::paths::PathSet;

impl Baker {
    /// Tiles of the objects that are there, in the objects' order: as a fresh bake lists them.
    pub(in crate::bake) fn live_tiles(&self) -> impl Iterator<Item = Range<usize>> {
        self.object_texels()
            .filter_map(|(range, there)| there.then_some(range))
    }

    /// The texels of every object that ever was, whole tiles of them, and whether it is there.
    pub(in crate::bake) fn object_texels(&self) -> impl Iterator<Item = (Range<usize>, bool)> {
        let scene = self.editor.scene();
        (0u32..).zip(&self.texels.tiles).map(|(o, t)| {
            let there = (o as usize) < scene.objects.len() && !scene.is_gone(o);
            let range = t.start as usize * Texel::TILE..t.end as usize * Texel::TILE;
            (range, there)
        })
    }

    /// Texels of the objects that are there.
    pub(super) fn lit_texels(&self) -> u64 {
        let lit = |t: &&Texel| t.pixel != Texel::NONE;
        let of = |range: Range<usize>| self.texels.list[range].iter().filter(lit).count() as u64;
        self.live_tiles().map(of).sum()
    }

    /// Waits, then resolves what the map holds at this moment.
    ///
    /// # Errors
    /// No memory, a lost device.
    pub fn lightmap(&mut self) -> Result<Lightmap, GpuError> {
        let _span = tracing::debug_span!("lightmap").entered();
        let scene = self.editor.scene().clone();
        let irradiance = self.illumination.irradiance()?;
        // In the objects' order, without what is gone: as a fresh bake lists them.
        let mut shown = Texels::default();
        let mut values = Vec::new();
        for range in self.live_tiles() {
            shown.list.extend(&self.texels.list[range.clone()]);
            values.extend(&irradiance[range]);
        }
        darken(
            &scene,
            &self.bvh,
            &shown.list,
            &mut values,
            self.atlas.density,
        );
        Ok(crate::lightmap::resolve::resolve(
            &scene,
            &self.atlas(),
            &shown,
            &values,
        ))
    }

    /// What was baked and how; `seconds` are the caller's to fill in.
    pub fn report(&self) -> Report {
        let scene = self.scene();
        let standing = || (0..scene.objects.len() as u32).filter(|&o| !scene.is_gone(o));
        let paths = self.validator.paths();
        let owned = |object: u32, of: fn(&ClaimStatistics) -> u32| {
            u64::from(self.claims.get(object as usize).map_or(0, of))
        };
        let mut counts = Counts {
            triangles: standing()
                .map(|o| scene.mesh(o).triangles.len() as u64)
                .sum(),
            objects: standing().count() as u64,
            lights: scene.lights.len() as u64,
            texels: self.lit_texels(),
            t_uv: standing().map(|o| owned(o, |c| c.t_uv)).sum(),
            p_uv: standing().map(|o| owned(o, |c| c.p_uv)).sum(),
            paths: paths.paths() as u64,
            vpls: paths.vpls().count() as u64,
            clusters: self.holdings.seen().len() as u64,
            accumulated: self.illumination.lights_sent(),
            pairs: self.illumination.pairs().clone(),
            offered_pairs: self.illumination.pass().offered(),
            taps: self.illumination.taps(),
            shadows: self.illumination.shadows(),
            ..Counts::default()
        };
        for light in self
            .holdings
            .seen()
            .values()
            .flat_map(|h| &h.selected.lights)
        {
            *counts.virtual_lights.entry(light.shape.name()).or_default() += 1;
        }
        let gpu = self.gpu();
        let atlas = self.atlas();
        Report {
            generator: concat!("rebake ", env!("CARGO_PKG_VERSION")).into(),
            semantics: if self.settings().indirect_only {
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
            flux: flux(paths, self.holdings.seen()),
            counts,
            settings: self.settings().clone(),
            estimated_error: self.error(),
            stopped_early: false,
            memory: Memory {
                host_peak: host_peak(),
                device_peak: gpu.peak_bytes(),
                device: gpu.allocations(),
            },
            seconds: BTreeMap::new(),
            total_seconds: 0.0,
            gpu: gpu.timings(),
        }
    }
}

fn flux(paths: &PathSet, held: &BTreeMap<CellId, Held>) -> FluxReport {
    let balance = paths.balance();
    let mean = |v: glam::Vec3| f64::from(v.x) / 3.0 + f64::from(v.y) / 3.0 + f64::from(v.z) / 3.0;
    let vpls: f64 = paths.vpls().map(|v| mean(v.flux)).sum();
    let lights = held.values().flat_map(|h| &h.selected.lights);
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

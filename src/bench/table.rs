//! Whole bakes: what IBGI's table 1 and VPL13's table of pre-processing say of a scene, and where the time went.

use std::collections::BTreeMap;

use super::figure::{Better, Figure};
use super::{Bench, BenchError};
use crate::bake::{Report, Silent, bake};
use crate::gpu::{Gpu, Timing};

/// What one bake took.
struct Run {
    report: Report,
    /// Device milliseconds by pass, of this bake alone.
    passes: BTreeMap<&'static str, f64>,
}

impl Bench<'_> {
    pub(super) fn table(&mut self) -> Result<(), BenchError> {
        let runs = self.repeat("bake", || {
            let before = self.gpu.timings();
            let (scene, document) = (self.scene.clone(), self.document.clone());
            let baked = bake(self.gpu, scene, document, &self.plan.job, &Silent)?;
            Ok(Run {
                report: baked.report,
                passes: since(self.gpu, &before),
            })
        })?;
        let figures = &mut self.out.figures;
        let last = &runs.last().expect("at least one run").report;
        let counts = &last.counts;
        let lights: u64 = counts.virtual_lights.values().sum();
        for (name, count) in [
            ("triangles", counts.triangles),
            ("lights", counts.lights),
            ("texels", counts.texels),
            ("paths", counts.paths),
            ("VPLs", counts.vpls),
            ("clusters", counts.clusters),
            ("virtual lights", lights),
            ("T_uv", counts.t_uv),
            ("P_uv", counts.p_uv),
            ("pairs", counts.pairs.values().sum()),
            ("pairs before culling", counts.offered_pairs),
            ("taps", counts.taps.values().sum()),
            ("depth maps", counts.shadows.maps),
            ("faces drawn", counts.shadows.faces),
            ("shadow triangles", counts.shadows.triangles),
            ("shadow triangles, large", counts.shadows.large),
            ("shadow triangles before culling", counts.shadows.offered),
        ] {
            figures.push(Figure::count(name, count as f64));
        }
        let mut of = |name: &str, unit: &str, better, value: &dyn Fn(&Run) -> f64| {
            figures.push(Figure::new(name, unit, better, runs.iter().map(value)));
        };
        of("bake", "s", Better::Lower, &|r| r.report.total_seconds);
        of("virtual light", "ms", Better::Lower, &|r| {
            1e3 * stage(&r.report, "accumulate") / r.report.counts.accumulated.max(1) as f64
        });
        of("virtual light, device", "ms", Better::Lower, &|r| {
            r.passes.values().sum::<f64>() / r.report.counts.accumulated.max(1) as f64
        });
        for name in last.seconds.keys() {
            let unit = format!("stage: {name}");
            of(&unit, "s", Better::Lower, &|r| stage(&r.report, name));
        }
        for name in runs[0].passes.keys() {
            of(&format!("pass: {name}"), "ms", Better::Lower, &|r| {
                r.passes.get(name).copied().unwrap_or_default()
            });
        }
        for name in counts.pairs.keys() {
            of(
                &format!("rate: {name}"),
                "M pairs/s",
                Better::Higher,
                &|r| {
                    let pairs = r.report.counts.pairs.get(name).copied().unwrap_or(0);
                    let ms = r.passes.get(name).copied().unwrap_or(f64::NAN);
                    pairs as f64 / ms / 1e3
                },
            );
        }
        // Pairs that culling left in, by all the time that they and their lights' depth maps took.
        of(
            "rate: pairs, shadows included",
            "M pairs/s",
            Better::Higher,
            &|r| {
                let pairs: u64 = r.report.counts.pairs.values().sum();
                let light = r.passes.iter().filter(|(name, _)| lights_up(name));
                pairs as f64 / light.map(|(_, ms)| ms).sum::<f64>() / 1e3
            },
        );
        of("depth map", "ms", Better::Lower, &|r| {
            let drawn = r.passes.iter().filter(|(name, _)| draws(name));
            drawn.map(|(_, ms)| ms).sum::<f64>() / r.report.counts.shadows.maps.max(1) as f64
        });
        of("device memory", "MiB", Better::Lower, &|r| {
            r.report.memory.device_peak as f64 / f64::from(1 << 20)
        });
        // What holds a hundredth of the memory or more; bake.json lists the rest.
        let worth = |bytes: &u64| 100 * bytes >= last.memory.device_peak;
        let held = last.memory.device.iter().filter(|(_, b)| worth(b));
        for (name, _) in held {
            of(
                &format!("device memory: {name}"),
                "MiB",
                Better::Lower,
                &|r| {
                    let bytes = r.report.memory.device.get(name).copied();
                    bytes.unwrap_or_default() as f64 / f64::from(1 << 20)
                },
            );
        }
        if last.memory.host_peak.is_some() {
            of("host memory", "MiB", Better::Lower, &|r| {
                r.report.memory.host_peak.unwrap_or(0) as f64 / f64::from(1 << 20)
            });
        }
        self.frames()?;
        Ok(())
    }
}

/// Passes that draw depth maps.
fn draws(pass: &str) -> bool {
    pass.starts_with("shadow") || pass == "depth blocks"
}

/// Passes that light the map.
fn lights_up(pass: &str) -> bool {
    draws(pass) || pass == "tile cull" || pass.starts_with("accumulate")
}

fn stage(report: &Report, name: &str) -> f64 {
    report.seconds.get(name).copied().unwrap_or_default()
}

/// Device milliseconds by pass since `before` was taken.
pub(super) fn since(gpu: &Gpu, before: &[Timing]) -> BTreeMap<&'static str, f64> {
    let earlier = |name| before.iter().find(|t| t.name == name).map_or(0.0, |t| t.ms);
    gpu.timings()
        .iter()
        .map(|t| (t.name, t.ms - earlier(t.name)))
        .filter(|(_, ms)| *ms > 0.0)
        .collect()
}

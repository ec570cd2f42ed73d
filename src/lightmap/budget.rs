//! As many texels as were asked for: the density that meets a budget.

use rayon::prelude::*;

use super::AtlasOptions;
use super::coverage::fetched;
use super::detail::{self, Probe};
use super::error::LightmapError;
use super::shape::{Laid, Shape};
use crate::scene::Scene;

/// A budget counts as met within this share of it.
const TOLERANCE: f64 = 0.02;
/// How often the density is corrected to meet it.
const CORRECTIONS: usize = 2;

/// Lays every shape out at a density. `first` are the layouts at another one: then charts are kept and only packed anew.
pub(super) fn lay_out(
    shapes: &[Shape],
    scene: &Scene,
    density: f32,
    limit: u32,
    first: Option<(&[Laid], &[Vec<f32>])>,
) -> Result<Vec<Laid>, LightmapError> {
    // Collected in order, so that the first error is the same one whatever the threads do.
    let laid: Vec<Result<Laid, LightmapError>> = shapes
        .par_iter()
        .enumerate()
        .map(|(i, shape)| {
            shape.lay_out(
                scene,
                density,
                limit,
                first.map(|(first, factors)| (&first[i], &*factors[i])),
            )
        })
        .collect();
    laid.into_iter().collect()
}

/// Finds the density at which `options.texels` are lit.
pub(super) fn within_budget(
    shapes: &[Shape],
    scene: &Scene,
    options: &AtlasOptions,
    limit: u32,
    probe: Option<&dyn Probe>,
) -> Result<(f32, Vec<Laid>), LightmapError> {
    let surface: f64 = shapes.iter().map(|s| s.area * s.objects.len() as f64).sum();
    let budget = options.texels as f64;
    let start = (budget / surface).sqrt() as f32;
    let start = if start.is_finite() {
        start.min(options.max_density)
    } else {
        1.0
    };
    let first = lay_out(shapes, scene, start, limit, None)?;
    let (mut density, mut lit) = (start, lit(shapes, &first));
    let (mut better, mut factors) = (None, vec![Vec::new(); shapes.len()]);
    if let Some(probe) = probe.filter(|_| surface > 0.0) {
        let shared = detail::share_out(scene, shapes, &first, start, budget, probe);
        factors = shared.factors;
        density = shared.density.min(options.max_density);
        let laid = lay_out(shapes, scene, density, limit, Some((&first, &factors)))?;
        lit = self::lit(shapes, &laid);
        better = Some(laid);
    }
    for _ in 0..CORRECTIONS {
        if (lit - budget).abs() <= TOLERANCE * budget
            || lit < budget && density >= options.max_density
        {
            break;
        }
        // Texels inside charts go with the density squared, those along their borders with the density.
        let at = f64::from(density);
        let border = (lit - surface * at * at).max(0.0) / at;
        let next = if surface > 0.0 {
            ((border * border + 4.0 * surface * budget).sqrt() - border) / (2.0 * surface)
        } else {
            break;
        };
        density = (next as f32).min(options.max_density);
        let laid = lay_out(shapes, scene, density, limit, Some((&first, &factors)))?;
        lit = self::lit(shapes, &laid);
        better = Some(laid);
    }
    if lit > (1.0 + 3.0 * TOLERANCE) * budget {
        // Where charts are smaller than a texel, no density is low enough.
        tracing::warn!(
            "{:.0} texels, not {budget:.0}: the surface is in so many charts, each of which takes whole texels; give objects \
             a TEXCOORD_1 with larger charts, or ask for more --texels",
            lit
        );
    }
    Ok((density, better.unwrap_or(first)))
}

/// Texels that bilinear filtering can fetch, over all objects.
fn lit(shapes: &[Shape], laid: &[Laid]) -> f64 {
    let counts = shapes.par_iter().zip(laid).map(|(shape, laid)| {
        let count = fetched(&laid.layout, laid.size)
            .iter()
            .filter(|f| **f)
            .count();
        (count * shape.objects.len()) as u64
    });
    counts.sum::<u64>() as f64
}

//! Where the lightmap is finer: charts on which light varies more get more of the texels.
//!
//! A texel of size h on a surface where light varies by V lux per metre is wrong by about V h. A chart of area A at a
//! density of d texels per metre has A d² of them, and the error summed over its surface is A V / d: for a given
//! number of texels the sum over all charts is least where every chart's density goes with the cube root of its V.

use glam::Vec3;
use rayon::prelude::*;

use super::coverage::owners;
use super::shape::{Laid, Shape};
use super::unwrap::triangle_area;
use crate::scene::Scene;

/// A point on a surface.
pub struct Point {
    /// World space.
    pub position: Vec3,
    /// Shading normal, world space.
    pub normal: Vec3,
    /// Normal of its triangle's front, world space.
    pub face: Vec3,
}

/// Estimates what lights a point, lux. Pure: the atlas depends on it.
pub trait Probe: Sync {
    /// Direct light.
    fn direct(&self, point: &Point) -> f32;
    /// Bounced light: a sample drawn by two numbers in 0..1, right in the mean over them.
    fn bounced(&self, point: &Point, u: [f32; 2]) -> f32;
}

/// Texels of the budget for each pair of points that looks at bounced light too, spread evenly over the scene.
const TEXELS_PER_FIRST: f64 = 64.0;
/// Such pairs of a shape at least.
const FEWEST: f64 = 32.0;
/// Texels of a chart, as the first pairs would have it, for each further pair.
const TEXELS_PER_SECOND: f64 = 16.0;
/// Pairs of a chart that weigh as much as what its whole shape says.
const PRIOR: f64 = 8.0;
/// Light varies at least by itself over this share of the scene's size (the root of its surface): smoothly, as
/// bounced light does.
const SMOOTH: f64 = 1.0 / 40.0;
/// The density's range, relative to that of the mean texel.
const RANGE: [f64; 2] = [0.5, 8.0];

/// How the texels are shared out.
pub(super) struct Detail {
    /// Texels per metre that every chart would have if all had the same.
    pub density: f32,
    /// Per shape, how much denser than that each of its charts should be.
    pub factors: Vec<Vec<f32>>,
}

/// Shares out `budget` texels. `laid`: the shapes' layouts at `density` texels per metre.
pub(super) fn share_out(
    scene: &Scene,
    shapes: &[Shape],
    laid: &[Laid],
    density: f32,
    budget: f64,
    probe: &dyn Probe,
) -> Detail {
    let surface: f64 = shapes.iter().map(|s| s.area * s.objects.len() as f64).sum();
    let smooth = SMOOTH * surface.sqrt();
    let mut charts: Vec<Vec<Chart>> = shapes
        .par_iter()
        .zip(laid)
        .map(|(shape, laid)| {
            let mut charts = charts(scene, shape, laid, density);
            let share = shape.area * shape.objects.len() as f64 / surface;
            let pairs = (budget / TEXELS_PER_FIRST * share).max(FEWEST) as u32;
            draw(
                scene,
                shape,
                laid,
                &mut charts,
                pairs,
                1.0 / density,
                (probe, true),
            );
            judge(&mut charts, smooth);
            charts
        })
        .collect();
    let (even, level) = levels(shapes, &charts, budget);
    charts
        .par_iter_mut()
        .zip(shapes)
        .zip(laid)
        .for_each(|((charts, shape), laid)| {
            let mut texels = 0.0;
            for chart in charts.iter_mut() {
                let own = chart.texels(chart.density(level, even));
                chart.weight = if chart.area > 0.0 {
                    own / chart.area
                } else {
                    0.0
                };
                texels += own;
            }
            let pairs = (texels * shape.objects.len() as f64 / TEXELS_PER_SECOND) as u32;
            draw(
                scene,
                shape,
                laid,
                charts,
                pairs,
                1.0 / density,
                (probe, false),
            );
            judge(charts, smooth);
        });
    let (even, level) = levels(shapes, &charts, budget);
    let factor = |c: &Chart| (c.density(level, even) / even) as f32;
    Detail {
        density: even as f32,
        factors: charts
            .iter()
            .map(|charts| charts.iter().map(factor).collect())
            .collect(),
    }
}

/// Says how much light varies on each chart of a shape, from what the pairs found so far.
fn judge(charts: &mut [Chart], smooth: f64) {
    let mut all = Chart::default();
    charts.iter().for_each(|c| all.add(c));
    let share = PRIOR / all.pairs.max(1.0);
    for chart in charts {
        let varies =
            (chart.change + share * all.change) / (chart.length + share * all.length).max(1e-12);
        let light = (chart.light + share * all.light) / (chart.lit + share * all.lit).max(1e-12);
        chart.rate = varies + light / smooth;
    }
}

/// The density that gives all charts together `budget` texels if every chart has the same, and the level of
/// [`Chart::density`] that does if each has its own.
fn levels(shapes: &[Shape], charts: &[Vec<Chart>], budget: f64) -> (f64, f64) {
    let texels = |density: &dyn Fn(&Chart) -> f64| -> f64 {
        let shapes = charts.iter().zip(shapes).map(|(charts, shape)| {
            let texels: f64 = charts.iter().map(|c| c.texels(density(c))).sum();
            texels * shape.objects.len() as f64
        });
        shapes.sum()
    };
    let even = bisect(|log| texels(&|_| log.exp2()) < budget).exp2();
    let level = bisect(|log| texels(&|c| c.density(log.exp2(), even)) < budget).exp2();
    (even, level)
}

/// The largest value for which `low` holds; it holds up to there.
fn bisect(low: impl Fn(f64) -> bool) -> f64 {
    let mut range = (-80.0f64, 80.0f64);
    for _ in 0..56 {
        let middle = 0.5 * (range.0 + range.1);
        if low(middle) {
            range.0 = middle;
        } else {
            range.1 = middle;
        }
    }
    range.0
}

/// What the pairs of points on a chart say.
#[derive(Clone, Copy, Debug, Default)]
struct Chart {
    /// m², of one object.
    area: f64,
    pairs: f64,
    /// Metres between the points, summed.
    length: f64,
    /// Lux between them, summed.
    change: f64,
    /// Lux, direct and bounced, summed over some of them.
    light: f64,
    /// How many.
    lit: f64,
    /// By how much more its surface is drawn from.
    weight: f64,
    /// Metres along its border, as texels count them.
    border: f64,
    /// Lux per metre that light varies by.
    rate: f64,
}

impl Chart {
    fn add(&mut self, other: &Self) {
        self.pairs += other.pairs;
        self.length += other.length;
        self.change += other.change;
        self.light += other.light;
        self.lit += other.lit;
    }

    /// Texels of one object at a density, those around the border included.
    fn texels(&self, density: f64) -> f64 {
        density * (self.area * density + self.border)
    }

    /// The density at which one more texel gains as much as on any other chart: d² (2 A d + border) = level A rate.
    /// `even` is the density of the mean texel.
    fn density(&self, level: f64, even: f64) -> f64 {
        let wanted = level * self.area * self.rate;
        let [mut low, mut high] = RANGE.map(|r| r * even);
        for _ in 0..24 {
            let d = (low * high).sqrt();
            if d * d * (2.0 * self.area * d + self.border) < wanted {
                low = d;
            } else {
                high = d;
            }
        }
        low
    }
}

/// A shape's charts: their areas, and their borders as the layout at `density` shows them.
fn charts(scene: &Scene, shape: &Shape, laid: &Laid, density: f32) -> Vec<Chart> {
    let layout = &laid.layout;
    let count = layout.charts.iter().max().map_or(0, |c| *c as usize + 1);
    let new = Chart {
        weight: 1.0,
        ..Chart::default()
    };
    let mut charts = vec![new; count];
    let mesh = &scene.meshes[shape.mesh as usize];
    for (corners, &chart) in mesh.triangles.iter().zip(&layout.charts) {
        charts[chart as usize].area += triangle_area(&shape.positions, corners);
    }
    let mut texels = vec![0u32; count];
    for chart in owners(layout, laid.size)
        .into_iter()
        .filter(|c| *c != u32::MAX)
    {
        texels[chart as usize] += 1;
    }
    let density = f64::from(density);
    for (chart, texels) in charts.iter_mut().zip(texels) {
        let around = f64::from(texels) - chart.area * density * density;
        chart.border = around.max(0.0) / density;
    }
    charts
}

/// Draws pairs of points on a shape's triangles, by area times weight, over its objects in turn, at most `reach` metres
/// apart. `probe`: and whether to ask it for bounced light.
fn draw(
    scene: &Scene,
    shape: &Shape,
    laid: &Laid,
    charts: &mut [Chart],
    pairs: u32,
    reach: f32,
    probe: (&dyn Probe, bool),
) {
    let layout = &laid.layout;
    let mesh = &scene.meshes[shape.mesh as usize];
    let mut total = 0.0;
    let sums: Vec<f64> = mesh
        .triangles
        .iter()
        .zip(&layout.charts)
        .map(|(t, chart)| {
            total += triangle_area(&shape.positions, t) * charts[*chart as usize].weight;
            total
        })
        .collect();
    if total <= 0.0 {
        return;
    }
    let drawn: Vec<(usize, Chart)> = (0..pairs)
        .into_par_iter()
        .with_min_len(32)
        .map(|i| {
            let u = lattice(i);
            let at = (f64::from(i) + u[0]) / f64::from(pairs) * total;
            let t = sums.partition_point(|s| *s <= at).min(sums.len() - 1);
            let object = shape.objects[i as usize % shape.objects.len()];
            let pair = pair(scene, object, t, &u, reach, probe);
            (layout.charts[t] as usize, pair)
        })
        .collect();
    for (chart, pair) in drawn {
        charts[chart].add(&pair);
    }
}

/// A pair of points inside one triangle.
fn pair(
    scene: &Scene,
    object: u32,
    triangle: usize,
    u: &[f64; 7],
    reach: f32,
    (probe, bounced): (&dyn Probe, bool),
) -> Chart {
    let mesh = scene.mesh(object);
    let transform = &scene.objects[object as usize].transform;
    let corners = mesh.triangles[triangle].map(|v| v as usize);
    let [a, b, c] = corners.map(|v| transform.transform_point3(mesh.positions[v]));
    let [p, q, r] = scene.world_triangle(object, triangle as u32);
    let face = (q - p).cross(r - p).normalize_or_zero();
    let to_world = transform.matrix3.inverse().transpose();
    let place = |w: Vec3| a * w.x + b * w.y + c * w.z;
    let point = |w: Vec3| {
        let [l, m, n] = corners.map(|v| mesh.normals[v]);
        let normal = (to_world * (l * w.x + m * w.y + n * w.z)).normalize_or_zero();
        Point {
            position: place(w),
            normal: if normal.dot(face) > 0.0 { normal } else { face },
            face,
        }
    };
    let first = uniform(u[1], u[2]);
    let mut second = uniform(u[3], u[4]);
    let apart = place(first).distance(place(second));
    if face == Vec3::ZERO || !apart.is_finite() {
        return Chart::default();
    }
    if apart > reach {
        second = first.lerp(second, reach / apart);
    }
    let (first, second) = (point(first), point(second));
    let (p, q) = (probe.direct(&first), probe.direct(&second));
    let light = if bounced {
        0.5 * (p + q) + probe.bounced(&first, [u[5] as f32, u[6] as f32])
    } else {
        0.0
    };
    Chart {
        pairs: 1.0,
        length: apart.min(reach).into(),
        change: (p - q).abs().into(),
        light: light.into(),
        lit: f64::from(u8::from(bounced)),
        ..Chart::default()
    }
}

/// Weights of a triangle's corners, uniform over it.
fn uniform(u: f64, v: f64) -> Vec3 {
    let (u, v) = (u as f32, v as f32);
    let (u, v) = if u + v > 1.0 {
        (1.0 - u, 1.0 - v)
    } else {
        (u, v)
    };
    Vec3::new(1.0 - u - v, u, v)
}

/// Seven numbers in 0..1, a lattice of irrational steps: spread evenly in any few of them.
fn lattice(i: u32) -> [f64; 7] {
    const STEPS: [f64; 7] = [
        0.618_033_988_749_894_8,
        0.754_877_666_246_692_7,
        0.569_840_290_998_053_2,
        0.414_213_562_373_095_1,
        0.732_050_807_568_877_2,
        0.236_067_977_499_789_8,
        0.645_751_311_064_590_6,
    ];
    STEPS.map(|step| (f64::from(i) * step + 0.5).fract())
}

#[cfg(test)]
#[path = "detail_tests.rs"]
mod tests;

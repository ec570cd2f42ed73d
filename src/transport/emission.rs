//! How much light each light source sends, and along which rays: flux in closed form, rays by importance.

use std::f32::consts::{PI, TAU};

use glam::{Mat3A, Vec2, Vec3, Vec3A};
use rayon::prelude::*;

use super::intersect::offset;
use super::sampling::{Distribution, Sequence, around_z, cosine_hemisphere, sphere, triangle};
use super::surface::{Piece, surface_pieces};
use crate::scene::{Aperture, Scene};

/// Dimension sets of [`Sequence::sample`] that an emission draws from; bounces draw from the sets after them.
pub const EMISSION_SETS: u32 = 2;

/// A light source made ready to send paths.
#[derive(Clone, Debug)]
pub struct Emitter {
    /// Radiant flux in lumens, linear RGB.
    pub flux: Vec3,
    kind: Kind,
}

#[derive(Clone, Debug)]
enum Kind {
    Point {
        position: Vec3,
    },
    Spot {
        position: Vec3,
        frame: Mat3A,
        falloff: SpotFalloff,
    },
    Directional {
        direction: Vec3,
        aperture: Vec<[Vec3; 3]>,
        by_area: Distribution,
    },
    Surface {
        pieces: Vec<Piece>,
        by_flux: Distribution,
    },
}

/// A ray that leaves a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmittedRay {
    /// World space, metres; off the surface that emits.
    pub origin: Vec3,
    /// Unit length.
    pub direction: Vec3,
    /// Linear RGB with a mean of 1: times a path's share of the light's flux, the path's energy.
    pub color: Vec3,
    /// Normal of the emitting side of a surface; zero for other lights.
    pub normal: Vec3,
    /// The emitting triangle of a surface light; `u32::MAX` for other lights.
    pub triangle: u32,
}

/// The falloff that `KHR_lights_punctual` suggests: the square of a clamped ramp in the cosine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpotFalloff {
    cos_outer: f32,
    scale: f32,
}

impl SpotFalloff {
    /// Half angles in radians.
    pub fn new(inner: f32, outer: f32) -> Self {
        let cos_outer = outer.cos();
        Self {
            cos_outer,
            scale: 1.0 / (inner.cos() - cos_outer).max(0.001),
        }
    }

    /// Relative intensity (0 to 1) at an angle from the axis.
    pub fn at(&self, cos: f32) -> f32 {
        let ramp = ((cos - self.cos_outer) * self.scale).clamp(0.0, 1.0);
        ramp * ramp
    }

    /// The cosine from which on the intensity is full, and the integrals over the cosine of the full part and of the ramp.
    fn parts(&self) -> (f32, f32, f32) {
        let full = (self.cos_outer + 1.0 / self.scale).min(1.0);
        (
            full,
            1.0 - full,
            self.scale * self.scale * (full - self.cos_outer).powi(3) / 3.0,
        )
    }

    /// The integral of the relative intensity over all directions, sr.
    pub fn solid_angle(&self) -> f32 {
        let (_, cap, ramp) = self.parts();
        TAU * (cap + ramp)
    }

    /// A cosine with a density in proportion to the intensity.
    fn sample(&self, u: f32) -> f32 {
        let (full, cap, ramp) = self.parts();
        let below = (1.0 - u) * (cap + ramp);
        if below > ramp {
            return (full + (below - ramp)).min(1.0);
        }
        (self.cos_outer + (3.0 * below / (self.scale * self.scale)).cbrt()).min(1.0)
    }
}

impl Emitter {
    /// Prepares light `index` of the scene.
    pub fn new(scene: &Scene, index: usize) -> Self {
        let light = &scene.lights[index];
        let position = light.transform.translation.into();
        let aim = (light.transform.matrix3 * Vec3A::NEG_Z).normalize().into();
        match light.aperture {
            Aperture::Point => Self {
                flux: light.intensity * (4.0 * PI),
                kind: Kind::Point { position },
            },
            Aperture::Spot { inner, outer } => {
                let falloff = SpotFalloff::new(inner, outer);
                Self {
                    flux: light.intensity * falloff.solid_angle(),
                    kind: Kind::Spot {
                        position,
                        frame: light.transform.matrix3,
                        falloff,
                    },
                }
            }
            Aperture::Directional => {
                let aperture = directional_aperture(scene, light.transform.matrix3);
                let by_area = Distribution::new(
                    aperture
                        .iter()
                        .map(|&[a, b, c]| f64::from((b - a).cross(c - a).length() * 0.5)),
                );
                Self {
                    flux: light.intensity * by_area.total() as f32,
                    kind: Kind::Directional {
                        direction: aim,
                        aperture,
                        by_area,
                    },
                }
            }
            Aperture::Surface { object } => {
                let pieces = surface_pieces(scene, object);
                let by_flux = Distribution::new(pieces.iter().map(|p| f64::from(mean(p.flux()))));
                let flux = pieces
                    .iter()
                    .fold(glam::DVec3::ZERO, |sum, p| sum + p.flux().as_dvec3());
                Self {
                    flux: flux.as_vec3(),
                    kind: Kind::Surface { pieces, by_flux },
                }
            }
        }
    }

    /// Whether there is anything that rays can leave from, bright or dark.
    pub fn emits(&self) -> bool {
        match &self.kind {
            Kind::Surface { pieces, .. } => !pieces.is_empty(),
            Kind::Directional { aperture, .. } => !aperture.is_empty(),
            Kind::Point { .. } | Kind::Spot { .. } => true,
        }
    }

    /// The emissive pieces of a surface light; empty for other lights.
    pub fn pieces(&self) -> &[Piece] {
        match &self.kind {
            Kind::Surface { pieces, .. } => pieces,
            _ => &[],
        }
    }

    /// The ray of path `index`: a pure function of the light and the index. [`Self::emits`] must hold.
    pub fn emit(&self, sequence: &Sequence, index: u32) -> EmittedRay {
        let [u0, u1, u2, u3] = sequence.sample(index, 0);
        let plain = |origin, direction| EmittedRay {
            origin,
            direction,
            color: color(self.flux),
            normal: Vec3::ZERO,
            triangle: u32::MAX,
        };
        match &self.kind {
            Kind::Point { position } => plain(*position, sphere([u0, u1])),
            Kind::Spot {
                position,
                frame,
                falloff,
            } => {
                let local = around_z(falloff.sample(u0), u1);
                // The cone is sampled around +Z; a half turn about X takes it to -Z.
                let local = Vec3A::new(local.x, -local.y, -local.z);
                plain(*position, (*frame * local).normalize().into())
            }
            Kind::Directional {
                direction,
                aperture,
                by_area,
            } => {
                let [a, b, c] = aperture[by_area.choose(u2)];
                let [s, t] = triangle([u0, u1]);
                plain(a + (b - a) * s + (c - a) * t, *direction)
            }
            Kind::Surface { pieces, by_flux } => {
                let [choice, side, ..] = sequence.sample(index, 1);
                let piece = &pieces[by_flux.choose(choice)];
                let [a, b, c] = piece.corners;
                let [s, t] = triangle([u0, u1]);
                let normal = if piece.double_sided && side >= 0.5 {
                    -piece.normal
                } else {
                    piece.normal
                };
                EmittedRay {
                    origin: offset(a + (b - a) * s + (c - a) * t, normal),
                    direction: cosine_hemisphere(normal, [u2, u3]),
                    color: color(piece.radiance),
                    normal,
                    triangle: piece.triangle,
                }
            }
        }
    }
}

/// A colour with a mean of 1, on a grid of 2^-16: a light that is dimmed then keeps its colour bit for bit in spite of
/// rounding, and with it what its paths carry in proportion. Dark light is white.
fn color(v: Vec3) -> Vec3 {
    const GRID: f32 = 65536.0;
    if mean(v) <= 0.0 {
        return Vec3::ONE;
    }
    (v / mean(v) * GRID).round() / GRID
}

/// Mean over RGB: the scalar that paths, metrics and reports count energy in.
pub fn mean(v: Vec3) -> f32 {
    (v.x + v.y + v.z) * (1.0 / 3.0)
}

/// World-space bounds of all objects, or none if there is no vertex.
pub fn bounds(scene: &Scene) -> Option<[Vec3; 2]> {
    scene
        .objects
        .par_iter()
        .filter_map(|object| {
            let points = scene.meshes[object.mesh as usize].positions.iter();
            points
                .map(|&p| object.transform.transform_point3(p))
                .fold(None, |b: Option<[Vec3; 2]>, p| {
                    Some(b.map_or([p, p], |[lo, hi]| [lo.min(p), hi.max(p)]))
                })
        })
        .reduce_with(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
}

/// What a directional light shines through: the scene's bounds seen along the light, as triangles before the scene.
/// The bounds are widened to a coarse grid first, so that small edits leave every path of the light where it was.
fn directional_aperture(scene: &Scene, frame: Mat3A) -> Vec<[Vec3; 3]> {
    let Some([lo, hi]) = bounds(scene) else {
        return Vec::new();
    };
    let grid = ((hi - lo).max_element().max(1e-6).log2().ceil() - 5.0).exp2();
    let lo = (lo / grid).floor() * grid;
    let hi = (hi / grid).ceil() * grid;
    let (x, y, z): (Vec3, Vec3, Vec3) = (
        frame.x_axis.normalize().into(),
        frame.y_axis.normalize().into(),
        frame.z_axis.normalize().into(),
    );
    let corners = (0..8u32).map(|i| {
        let pick = |axis: usize| {
            if i >> axis & 1 == 1 {
                hi[axis]
            } else {
                lo[axis]
            }
        };
        Vec3::new(pick(0), pick(1), pick(2))
    });
    let back = corners.clone().map(|c| c.dot(z)).fold(f32::MIN, f32::max) + grid;
    let hull = convex_hull(corners.map(|c| Vec2::new(c.dot(x), c.dot(y))).collect());
    let lift = |p: Vec2| x * p.x + y * p.y + z * back;
    (2..hull.len())
        .map(|i| [lift(hull[0]), lift(hull[i - 1]), lift(hull[i])])
        .collect()
}

/// Counter-clockwise convex hull (Andrew's monotone chain), without collinear points.
pub fn convex_hull(mut points: Vec<Vec2>) -> Vec<Vec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let mut hull: Vec<Vec2> = Vec::with_capacity(points.len() + 1);
    let chain = |points: &mut dyn Iterator<Item = Vec2>, hull: &mut Vec<Vec2>| {
        let base = hull.len();
        for p in points {
            while hull.len() >= base + 2
                && (hull[hull.len() - 1] - hull[hull.len() - 2]).perp_dot(p - hull[hull.len() - 1])
                    <= 0.0
            {
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop();
    };
    chain(&mut points.iter().copied(), &mut hull);
    chain(&mut points.iter().rev().copied(), &mut hull);
    hull
}

#[cfg(test)]
mod tests;

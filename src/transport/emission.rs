//! How much light each light source sends, and along which rays: flux in closed form, rays by importance.

use std::f32::consts::{PI, TAU};

use glam::{Mat3A, Vec2, Vec3, Vec3A};
use rayon::prelude::*;

use super::bvh::{offset, weights};
use super::sampling::{Distribution, Sequence, around_z, cosine_hemisphere, sphere, triangle};
use crate::scene::{Aperture, Scene};

/// Dimension sets of [`Sequence::sample`] that an emission draws from; bounces draw from the sets after them.
pub const EMISSION_SETS: u32 = 2;

/// Triangles of a surface light with an emission texture are cut into `TEXTURE_CUTS`² pieces of constant radiance.
const TEXTURE_CUTS: u32 = 8;

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

/// A part of an emissive triangle with constant radiance.
#[derive(Clone, Debug)]
pub struct Piece {
    /// Triangle of the object's mesh.
    pub triangle: u32,
    /// World space, metres, in the mesh's vertex order.
    pub corners: [Vec3; 3],
    /// Unit normal of the front.
    pub normal: Vec3,
    /// Emitted radiance in cd/m².
    pub radiance: Vec3,
    /// Emits from both sides.
    pub double_sided: bool,
}

impl Piece {
    /// m², of one side.
    pub fn area(&self) -> f32 {
        (self.corners[1] - self.corners[0])
            .cross(self.corners[2] - self.corners[0])
            .length()
            * 0.5
    }

    /// Lumens, both sides where both emit: pi L A a side.
    pub fn flux(&self) -> Vec3 {
        self.radiance * (PI * self.area() * if self.double_sided { 2.0 } else { 1.0 })
    }
}

/// A ray that leaves a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmittedRay {
    /// World space, metres; off the surface that emits.
    pub origin: Vec3,
    /// Unit length.
    pub direction: Vec3,
    /// Linear RGB with a mean of 1: times the flux per path, the path's energy.
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

    /// The emissive pieces of a surface light; empty for other lights.
    pub fn pieces(&self) -> &[Piece] {
        match &self.kind {
            Kind::Surface { pieces, .. } => pieces,
            _ => &[],
        }
    }

    /// The ray of path `index`: a pure function of the light and the index. Needs a positive flux.
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
/// rounding, and with it all of its paths.
fn color(v: Vec3) -> Vec3 {
    const GRID: f32 = 65536.0;
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

/// The emissive triangles of an object, those with an emission texture cut into small ones.
fn surface_pieces(scene: &Scene, object: u32) -> Vec<Piece> {
    let instance = &scene.objects[object as usize];
    let mesh = &scene.meshes[instance.mesh as usize];
    let mirror = instance.transform.matrix3.determinant().signum();
    let mut pieces = Vec::new();
    for primitive in &mesh.primitives {
        let material = &scene.materials[primitive.material as usize];
        if material.emission.max_element() <= 0.0 {
            continue;
        }
        let cuts = if material.emission_texture.is_some() {
            TEXTURE_CUTS
        } else {
            1
        };
        for t in primitive.triangles.clone() {
            let world = mesh.triangles[t as usize].map(|v| {
                instance
                    .transform
                    .transform_point3(mesh.positions[v as usize])
            });
            let [a, b, c] = world;
            let normal = (b - a).cross(c - a).normalize_or_zero() * mirror;
            for corners in cut_triangle(cuts) {
                let middle = corners
                    .iter()
                    .fold(Vec3::ZERO, |sum, &c| sum + weights(c) / 3.0);
                let piece = Piece {
                    triangle: t,
                    corners: corners.map(|[s, t]| a + (b - a) * s + (c - a) * t),
                    normal,
                    radiance: scene.emission(object, t, middle),
                    double_sided: material.double_sided,
                };
                if mean(piece.flux()) > 0.0 {
                    pieces.push(piece);
                }
            }
        }
    }
    pieces
}

/// `n`² equal triangles that fill a triangle: weights of the second and third vertex at each corner.
fn cut_triangle(n: u32) -> impl Iterator<Item = [[f32; 2]; 3]> {
    let at = move |i: u32, j: u32| [i as f32 / n as f32, j as f32 / n as f32];
    (0..n).flat_map(move |i| {
        (0..n - i).flat_map(move |j| {
            let up = [at(i, j), at(i + 1, j), at(i, j + 1)];
            let down = [at(i + 1, j + 1), at(i, j + 1), at(i + 1, j)];
            std::iter::once(up).chain((i + j + 2 <= n).then_some(down))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Light;
    use crate::transport::testing::{add_quads, cornell, light, material, quad, room};
    use glam::Affine3A;

    fn lit(aperture: Aperture) -> (Scene, Emitter) {
        let mut scene = room(0.5);
        let transform = Affine3A::from_rotation_translation(
            glam::Quat::from_rotation_x(-0.7),
            Vec3::new(0.1, 0.2, 0.3),
        );
        scene
            .lights
            .push(light(aperture, Vec3::new(1.0, 2.0, 3.0), transform));
        let emitter = Emitter::new(&scene, 0);
        (scene, emitter)
    }

    #[test]
    fn spots_send_what_their_falloff_integrates_to() {
        for (inner, outer) in [
            (0.0, 0.5),
            (0.3, 0.31),
            (0.4, 0.4),
            (0.0, PI / 2.0),
            (0.0, 0.001),
        ] {
            let falloff = SpotFalloff::new(inner, outer);
            let n = 200_000;
            let step = (1.0 - f64::from(outer.cos())) / f64::from(n);
            let sum: f64 = (0..n)
                .map(|i| {
                    f64::from(
                        falloff.at((f64::from(outer.cos()) + (f64::from(i) + 0.5) * step) as f32),
                    ) * step
                })
                .sum();
            let exact = sum * std::f64::consts::TAU;
            assert!(
                (f64::from(falloff.solid_angle()) / exact - 1.0).abs() < 0.03 || exact < 1e-5,
                "{inner} {outer} {exact}"
            );
            // A sampled cosine's share below a threshold is the integral's.
            let threshold = falloff.sample(0.5);
            let above: f64 = (0..n)
                .map(|i| f64::from(outer.cos()) + (f64::from(i) + 0.5) * step)
                .filter(|&c| c > f64::from(threshold))
                .map(|c| f64::from(falloff.at(c as f32)) * step)
                .sum();
            assert!(
                (above / sum - 0.5).abs() < 0.03 || exact < 1e-5,
                "{inner} {outer}"
            );
        }
    }

    #[test]
    fn rays_leave_where_they_should() {
        let sequence = Sequence::new(0, 0);
        let (_, point) = lit(Aperture::Point);
        assert!((point.flux - Vec3::new(1.0, 2.0, 3.0) * 4.0 * PI).length() < 1e-4);
        assert_eq!(point.emit(&sequence, 9).origin, Vec3::new(0.1, 0.2, 0.3));
        let (scene, spot) = lit(Aperture::Spot {
            inner: 0.2,
            outer: 0.4,
        });
        let axis = Vec3::from(scene.lights[0].transform.matrix3 * Vec3A::NEG_Z);
        let (_, sun) = lit(Aperture::Directional);
        for i in 0..500 {
            assert!(spot.emit(&sequence, i).direction.dot(axis) > 0.4f32.cos() - 1e-5);
            let ray = sun.emit(&sequence, i);
            assert!((ray.direction - axis).length() < 1e-5 && (mean(ray.color) - 1.0).abs() < 1e-5);
            assert!(ray.origin.dot(axis) < -1.41, "starts outside of the room");
        }
        // The room's 2 m cube, widened by its grid of 2/16 a side at most, seen along a direction that tilts in the yz plane.
        let area = f64::from(mean(sun.flux)) / 2.0;
        let exact = 4.0 * f64::from(axis.y.abs() + axis.z.abs());
        assert!(
            area >= exact - 1e-4 && area <= exact * 1.2,
            "{area} {exact}"
        );
    }

    #[test]
    fn surfaces_send_pi_l_a_a_side() {
        let mut scene = cornell();
        let lamp = Emitter::new(&scene, 0);
        assert!((lamp.flux.x - PI * 17.0 * 0.25).abs() < 1e-4);
        assert!(lamp.emit(&Sequence::new(0, 0), 3).direction.y < 0.0);
        let quad = quad(Vec3::ZERO, Vec3::X, Vec3::Y);
        let object = add_quads(&mut scene, &[quad], material(Vec3::ONE, Vec3::ONE, true));
        // A mirrored, stretched object keeps its front's flux.
        scene.objects[object as usize].transform = Affine3A::from_scale(Vec3::new(-2.0, 1.0, 1.0));
        let both = Emitter::new(&scene, 1);
        assert!((both.flux.x - 2.0 * PI * 2.0).abs() < 1e-4);
        let up = (0..64)
            .filter(|&i| both.emit(&Sequence::new(0, 1), i).direction.z > 0.0)
            .count();
        assert_eq!(up, 32);
        assert!(both.pieces().iter().all(|p| p.normal.z > 0.99));
    }

    #[test]
    fn cut_triangles_fill_the_triangle() {
        let area: f32 = cut_triangle(5)
            .map(|[a, b, c]| {
                let twice = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
                assert!(twice > 0.0);
                twice
            })
            .sum();
        assert_eq!(cut_triangle(5).count(), 25);
        assert!((area - 1.0).abs() < 1e-5);
    }

    #[test]
    fn a_light_without_a_scene_sends_nothing() {
        let mut scene = Scene::default();
        let sun: Light = light(Aperture::Directional, Vec3::ONE, Affine3A::IDENTITY);
        scene.lights.push(sun);
        assert_eq!(Emitter::new(&scene, 0).flux, Vec3::ZERO);
    }
}

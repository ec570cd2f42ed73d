//! What an exchange of virtual lights shows: the irradiance that goes and that comes, at the places where rays from these lights meet
//! surfaces. What lies beside what it replaces makes little difference, however large both are, and what many lights of a cell do
//! together is more than what each does alone.

use arrayvec::ArrayVec;
use glam::Vec3;

use super::eye::Eye;
use super::places::{Around, LOOKS, Place, Size, falls, source};
use super::sight::{Both, missed};
use crate::cluster::{Shape, VirtualLight};
use crate::transport::intersect::offset;
use crate::transport::sampling;

/// Rays of a light.
const RAYS: usize = 12;
/// Places that an exchange is judged by at most: of more, every so many.
const PLACES: usize = 96;
/// Of what the light that shines most on a place does there, what makes it matter whether another one sees it.
const FAINT: f32 = 0.1;

/// What rays from a light have found.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// Parallel light falls everywhere: the norm over both parts of what a lux of it causes. Nothing of other light.
    everywhere: Both,
    places: ArrayVec<Place, { RAYS + LOOKS }>,
    size: Size,
}

/// A light, and what its rays have found.
pub(super) type Shining<'a> = (&'a VirtualLight, &'a Found);

impl Found {
    pub const NOTHING: &Self = &Self {
        everywhere: [0.0; 2],
        places: ArrayVec::new_const(),
        size: Size::NONE,
    };

    /// `index`: of the light, in its cell.
    pub fn new(around: &Around, eye: Option<&Eye>, (index, light): (usize, &VirtualLight)) -> Self {
        let mut found = Self {
            size: Size::new(light, around.texel),
            ..Self::NOTHING.clone()
        };
        if matches!(light.shape, Shape::Directional { .. }) {
            let area = around.even();
            found.everywhere = match around.division {
                Some(_) => [(0.5 * area).sqrt(); 2],
                None => [0.0, area.sqrt()],
            };
            return found;
        }
        let far = around.far();
        let hits = (0..RAYS).filter_map(|i| {
            let (origin, direction) = ray(light, i)?;
            around.closest(origin, direction, far)
        });
        let met = hits.map(|hit| around.place(eye, &hit));
        let sees = |place: &Place| {
            falls(light, &found.size, place)[0] > 0.0
                && !around.hidden(offset(place.point, place.normal), source(light))
        };
        let seen = around.looked(eye, index).filter(sees);
        found.places = met.chain(seen).collect();
        found
    }
}

/// The origin and direction of one of a light's rays, drawn as it shines; none where its own surface hides it.
fn ray(light: &VirtualLight, i: usize) -> Option<(Vec3, Vec3)> {
    // The golden ratio: even in both directions.
    let u = [
        (i as f32 + 0.5) / RAYS as f32,
        (i as f32 * 0.618_034).fract(),
    ];
    Some(match light.shape {
        Shape::Point => (light.position, sampling::sphere(u)),
        Shape::Spot { outer, .. } => {
            let local = sampling::around_z(1.0 - u[0] * (1.0 - outer.cos()), u[1]);
            let (x, y) = sampling::basis(light.normal);
            let direction = x * local.x + y * local.y + light.normal * local.z;
            (light.position, direction)
        }
        _ => {
            let direction = sampling::cosine_hemisphere(light.normal, u);
            (direction.dot(light.surface) > 0.0).then(|| (source(light), direction))?
        }
    })
}

/// The norm over either part of the map (root of the integral of the square over all surfaces, lux m) of the irradiance by which lights
/// that come differ from those that go, what is not seen counting less where somebody looks.
///
/// Monte Carlo with one sample of several densities (Veach and Guibas 1995, balance heuristic): a place that a ray of one light has
/// met stands for as much surface as the rays of all of them together leave to it.
pub(super) fn difference(gone: &[Shining], come: &[Shining], around: &Around) -> Both {
    let lights: Vec<(Vec3, &Shining)> = (gone.iter().map(|l| (-l.0.flux, l)))
        .chain(come.iter().map(|l| (l.0.flux, l)))
        .collect();
    let places = || {
        let lights = lights.iter().enumerate();
        lights.flat_map(|(i, (_, (_, found)))| found.places.iter().map(move |place| (i, place)))
    };
    let step = places().count().div_ceil(PLACES).max(1);
    let mut sums = [0.0; 2];
    let mut fall = Vec::new();
    for (owner, place) in places().step_by(step) {
        fall.clear();
        fall.extend(lights.iter().map(|(change, light)| {
            let [irradiance, dense] = falls(light.0, &light.1.size, place);
            (*change * irradiance, dense)
        }));
        let most = fall.iter().map(|f| f.0.length()).fold(0.0, f32::max);
        let to = offset(place.point, place.normal);
        let (mut flux, mut density) = (Vec3::ZERO, 0.0);
        for (i, &(irradiance, dense)) in fall.iter().enumerate() {
            density += LOOKS as f32 * place.looked;
            if i != owner
                && irradiance.length() > FAINT * most
                && around.hidden(to, source(lights[i].1.0))
            {
                continue;
            }
            flux += irradiance;
            density += RAYS as f32 * dense;
        }
        if density > 0.0 {
            let square = flux.length_squared() / 3.0;
            sums[place.part] += f64::from(square * place.weight / density);
        }
    }
    let rays = (RAYS * lights.len()) as u32;
    let sums = missed(sums, rays).map(|sum| sum * step as f64);
    let even = |part: usize| -> f64 {
        let all = lights.iter().filter(|(_, (_, f))| f.everywhere != [0.0; 2]);
        let mut left: Vec<(Vec3, Vec3, f64)> = Vec::new();
        for (change, (light, found)) in all {
            match left.iter_mut().find(|(way, ..)| *way == light.normal) {
                Some((_, sum, _)) => *sum += *change,
                None => left.push((light.normal, *change, found.everywhere[part])),
            }
        }
        let squares = left
            .iter()
            .map(|(_, change, norm)| f64::from(change.length_squared() / 3.0) * norm * norm);
        squares.sum()
    };
    [0, 1].map(|part| (sums[part] + even(part)).sqrt())
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::*;
    use crate::bake::order::eye::UNSEEN;
    use crate::scene::builtin::builtin;
    use crate::scene::{Camera, Scene};
    use crate::transport::bvh::SceneBvh;

    fn disk(position: Vec3, normal: Vec3, flux: f32) -> VirtualLight {
        VirtualLight {
            shape: Shape::Disk { area: 0.0 },
            position,
            normal,
            surface: normal,
            flux: Vec3::splat(flux),
            direct: false,
        }
    }

    fn norm(scene: &Scene, gone: &[VirtualLight], come: &[VirtualLight]) -> f64 {
        norm_for(None, scene, gone, come)
    }

    fn norm_for(
        eye: Option<&Eye>,
        scene: &Scene,
        gone: &[VirtualLight],
        come: &[VirtualLight],
    ) -> f64 {
        let bvh = SceneBvh::build(scene);
        let around = Around::new(scene, &bvh, 0.0, None);
        let found = |lights: &[VirtualLight]| -> Vec<Found> {
            let new = |light| Found::new(&around, eye, light);
            lights.iter().enumerate().map(new).collect()
        };
        let (old, new) = (found(gone), found(come));
        let gone: Vec<Shining> = gone.iter().zip(&old).collect();
        let come: Vec<Shining> = come.iter().zip(&new).collect();
        let [_, norm] = difference(&gone, &come, &around);
        norm
    }

    /// In a sphere that shines on itself all irradiance is the same: flux over area, and its norm flux over the root of it.
    #[test]
    fn in_a_sphere_it_is_that_of_even_light() {
        let scene = Scene::from_document(&builtin("integrating-sphere").unwrap()).unwrap();
        let bounds = scene.bounds();
        let (center, radius) = (bounds.center(), 0.5 * bounds.size().x);
        let even = 1.0 / f64::from(radius * (4.0 * PI).sqrt());
        let wall = center + Vec3::X * 0.99 * radius;
        let one = norm(&scene, &[], &[disk(wall, Vec3::NEG_X, 1.0)]);
        assert!((0.8 * even..1.3 * even).contains(&one), "{one} {even}");
        let bulb = VirtualLight {
            shape: Shape::Point,
            ..disk(center, Vec3::Z, 1.0)
        };
        let point = norm(&scene, &[], &[bulb]);
        let all = 4.0 * f64::from(PI) * even;
        assert!((0.98 * all..1.02 * all).contains(&point), "{point} {all}");
    }

    /// Of even light, a picture that is too small for the light's own rays shows what its area says.
    #[test]
    fn what_is_seen_is_found_however_small_it_is() {
        let scene = Scene::from_document(&builtin("integrating-sphere").unwrap()).unwrap();
        let bvh = SceneBvh::build(&scene);
        let bounds = scene.bounds();
        let (center, radius) = (bounds.center(), 0.5 * bounds.size().x);
        let even = 1.0 / f64::from(4.0 * PI * radius * radius);
        let light = disk(center + Vec3::X * 0.99 * radius, Vec3::NEG_X, 1.0);
        for turn in [0.3, 1.7, 4.4] {
            let mut eye = Eye::new(&Camera {
                name: String::new(),
                transform: glam::Affine3A::from_rotation_translation(
                    glam::Quat::from_rotation_y(turn),
                    center,
                ),
                fov_y: 0.3,
            });
            eye.look(&scene, &bvh);
            let (_, weight) = eye.seen(0).next().expect("the sphere is all around");
            let seen = f64::from(weight / eye.density(*weight));
            let unseen = f64::from(UNSEEN * 4.0 * PI * radius * radius);
            let expected = even * (seen + unseen).sqrt();
            let found = norm_for(Some(&eye), &scene, &[], std::slice::from_ref(&light));
            let off = (found / expected - 1.0).abs();
            assert!(off < 0.2, "{found} {expected}");
        }
    }

    /// Lights add up, what is replaced by its like makes no difference, and what is dimmed as much of one as it is dimmed.
    #[test]
    fn what_is_the_same_makes_no_difference() {
        let scene = Scene::from_document(&builtin("integrating-sphere").unwrap()).unwrap();
        let bounds = scene.bounds();
        let wall = bounds.center() + Vec3::X * 0.495 * bounds.size().x;
        let light = |along: f32, flux| disk(wall + Vec3::Z * along, Vec3::NEG_X, flux);
        let one = norm(&scene, &[], &[light(0.0, 1.0)]);
        let four: Vec<_> = [-0.03, -0.01, 0.01, 0.03]
            .map(|z| light(z * bounds.size().x, 1.0))
            .into();
        let together = norm(&scene, &[], &four);
        assert!((3.2..4.8).contains(&(together / one)), "{together} {one}");
        let refined = norm(&scene, &[light(0.0, 4.0)], &four);
        assert!(refined < 0.2 * together, "{refined} {together}");
        let dimmed = norm(&scene, &[light(0.0, 1.0)], &[light(0.0, 0.75)]);
        assert!((dimmed / one - 0.25).abs() < 1e-3, "{dimmed} {one}");
        // In an even room it matters little where a light is: but for what is right beside it.
        let there = wall - Vec3::X * 0.98 * bounds.size().x;
        let far = norm(&scene, &[light(0.0, 1.0)], &[disk(there, Vec3::X, 1.0)]);
        assert!(far < 0.5 * one, "{far} {one}");
    }
}

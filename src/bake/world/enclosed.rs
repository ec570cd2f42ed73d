//! Texels that no light can reach: surface inside closed, single-sided geometry, such as the floor below a box, and in
//! hollows hardly larger than a texel, such as those between a wall and its mouldings.
//!
//! A depth map decides about them with the precision of its pixels, so a little light seeps in along the outline. Rays
//! are exact: where every ray meets the back of a single-sided surface, or anything very near, and no light source stands
//! inside, the texel is dark.

use glam::Vec3;
use rayon::prelude::*;

use crate::lightmap::Texel;
use crate::scene::{Aperture, Bounds, Scene};
use crate::transport::SceneBvh;
use crate::transport::intersect::offset;

/// Rays of a texel. The first one that meets neither a back side nor anything near ends the search.
const RAYS: usize = 24;
/// How large a hollow is at most, in texels of the mean density.
const HOLLOW: f32 = 6.0;

/// Takes the light of enclosed texels away; `density` is the mean, texels per metre.
pub(in crate::bake) fn darken(
    scene: &Scene,
    bvh: &SceneBvh,
    texels: &[Texel],
    values: &mut [[f32; 3]],
    density: f32,
) {
    let (mut lamps, mut suns, mut emitters) = (Vec::new(), Vec::new(), Vec::new());
    for light in &scene.lights {
        match light.aperture {
            Aperture::Point | Aperture::Spot { .. } => {
                lamps.push(Vec3::from(light.transform.translation));
            }
            Aperture::Directional => {
                suns.push(Vec3::from(light.transform.matrix3.z_axis.normalize()));
            }
            Aperture::Surface { object } => emitters.push(scene.object_bounds(object)),
        }
    }
    let surroundings = Surroundings {
        scene,
        bvh,
        directions: hemisphere(),
        hollow: HOLLOW / density,
        lamps,
        suns,
        emitters,
    };
    texels
        .par_chunks(Texel::TILE)
        .zip(values.par_chunks_mut(Texel::TILE))
        .for_each(|(texels, values)| {
            // Neighbours often see out in the same direction.
            let mut first = 0;
            for (texel, value) in texels.iter().zip(values) {
                if *value != [0.0; 3] && surroundings.enclose(texel, &mut first) {
                    *value = [0.0; 3];
                }
            }
        });
}

/// What rays from texels are asked about.
struct Surroundings<'a> {
    scene: &'a Scene,
    bvh: &'a SceneBvh,
    directions: [Vec3; RAYS],
    /// Metres.
    hollow: f32,
    /// Where points and spots are, where parallel light comes from, and what shines of itself.
    lamps: Vec<Vec3>,
    suns: Vec<Vec3>,
    emitters: Vec<Bounds>,
}

impl Surroundings<'_> {
    /// Whether a texel is enclosed. `first`: the direction that is tried first, then the one that it turned out to be open in; it
    /// makes no difference to the answer.
    fn enclose(&self, texel: &Texel, first: &mut usize) -> bool {
        let (scene, bvh, hollow) = (self.scene, self.bvh, self.hollow);
        let transform = &scene.objects[texel.object as usize].transform;
        let face = (transform.matrix3.inverse().transpose() * Vec3::from_array(texel.face))
            .normalize_or_zero();
        if face == Vec3::ZERO {
            return false;
        }
        let position = transform.transform_point3(Vec3::from_array(texel.position));
        let origin = offset(position, face);
        let (x, y) = face.any_orthonormal_pair();
        let mut in_hollow = false;
        let start = *first;
        let open = std::iter::once(start)
            .chain((0..RAYS).filter(|i| *i != start))
            .find(|i| {
                let d = self.directions[*i];
                let direction = x * d.x + y * d.y + face * d.z;
                let hit = bvh.closest(scene, origin, direction, f32::INFINITY);
                let walled = hit.is_some_and(|hit| {
                    let back = !hit.front && !scene.materials[hit.material as usize].double_sided;
                    in_hollow |= !back;
                    back || hit.t < hollow
                });
                !walled
            });
        if let Some(open) = open {
            *first = open;
            return false;
        }
        let apart = |b: &Bounds| {
            let beside = (b.min - origin).max(origin - b.max);
            beside.max(Vec3::ZERO).length()
        };
        !(in_hollow && self.emitters.iter().any(|b| apart(b) < hollow))
            && self
                .suns
                .iter()
                .all(|sun| bvh.occluded(scene, origin, *sun, f32::INFINITY))
            && self.lamps.iter().all(|lamp| {
                let to_lamp = *lamp - origin;
                let distance = to_lamp.length();
                bvh.occluded(scene, origin, to_lamp / distance.max(1e-20), distance)
            })
    }
}

/// Directions spread evenly by solid angle over the upper half space (a spherical Fibonacci lattice), the steepest first.
fn hemisphere() -> [Vec3; RAYS] {
    std::array::from_fn(|i| {
        let z = 1.0 - (i as f32 + 0.5) / RAYS as f32;
        let (sin, cos) = (i as f32 * 2.399_963_2).sin_cos();
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * cos, r * sin, z)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::testing::cornell;

    /// Texels of the scene's triangles, just off their vertices' mean: the box's own, those under its blocks included.
    fn texels(scene: &Scene) -> Vec<Texel> {
        let of = |object: u32| {
            let mesh = scene.mesh(object);
            mesh.triangles.iter().flat_map(move |corners| {
                let [a, b, c] = corners.map(|v| mesh.positions[v as usize]);
                (0..40).map(move |i| {
                    let (s, t) = (0.025 * (i as f32 + 0.5), 0.37 * i as f32 % 1.0);
                    Texel {
                        position: a.lerp(b, s).lerp(c, t).to_array(),
                        object,
                        normal: [0.0; 3],
                        face: (b - a).cross(c - a).to_array(),
                        pixel: 0,
                    }
                })
            })
        };
        (0..scene.objects.len() as u32).flat_map(of).collect()
    }

    #[test]
    fn what_is_tried_first_makes_no_difference() {
        let scene = cornell();
        let bvh = SceneBvh::build(&scene);
        let texels = texels(&scene);
        let bounds = scene.bounds().size().max_element();
        let mut dark = 0;
        for density in [4.0 / bounds, 40.0 / bounds] {
            let mut values = vec![[1.0; 3]; texels.len()];
            darken(&scene, &bvh, &texels, &mut values, density);
            for (texel, value) in texels.iter().zip(&values) {
                let mut alone = [[1.0; 3]];
                darken(
                    &scene,
                    &bvh,
                    std::slice::from_ref(texel),
                    &mut alone,
                    density,
                );
                assert_eq!(alone[0], *value);
            }
            dark += values.iter().filter(|v| v[0] == 0.0).count();
        }
        assert!(dark > 0 && dark < 2 * texels.len(), "{dark}");
    }
}

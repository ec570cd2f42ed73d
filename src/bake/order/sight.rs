//! Which of the map's tiles a camera sees: that part follows an edit first.

use glam::Vec3;
use rayon::prelude::*;

use super::eye::{ASPECT, PICTURE, UNSEEN};
use crate::bake::device::records::Parts;
use crate::lightmap::texels::Texels;
use crate::lightmap::{Atlas, Texel, sample};
use crate::scene::{Bounds, Camera, Scene};
use crate::transport::SceneBvh;
use crate::transport::bvh::{Hit, weights as corner_weights};

/// What a pixel of a picture shows.
#[derive(Clone, Copy, Debug)]
pub(in crate::bake) struct Pixel {
    /// Metres from the camera.
    distance: f32,
    /// Texels that a bilinear lookup fetches there, as offsets into all pages, and their weights.
    pub taps: [(usize, f32); 4],
}

/// A camera's picture of the scene, as far as its texels go.
#[derive(Clone, Debug)]
pub(in crate::bake) struct Sight {
    camera: Camera,
    pixels: Vec<Option<Pixel>>,
    slots: Slots,
}

/// Which entry of the texel list a texel of the pages is.
#[derive(Clone, Debug)]
pub(in crate::bake) struct Slots {
    at: Vec<u32>,
    /// Texels of a page.
    page: usize,
}

impl Slots {
    /// Of the objects that are there.
    pub fn new(scene: &Scene, atlas: &Atlas, texels: &Texels) -> Self {
        let side = atlas.page_size as usize;
        let mut at = vec![Texel::NONE; side * side * atlas.pages as usize];
        for (object, tiles) in (0..).zip(&texels.tiles) {
            if object as usize >= scene.objects.len() || scene.is_gone(object) {
                continue;
            }
            let range = tiles.start as usize * Texel::TILE..tiles.end as usize * Texel::TILE;
            for (slot, texel) in (range.start as u32..).zip(&texels.list[range]) {
                if let Some(at) = at.get_mut(texel.pixel as usize) {
                    *at = slot;
                }
            }
        }
        Self {
            at,
            page: side * side,
        }
    }

    /// The entry of a texel, by its offset into all pages; none for one that nobody has.
    pub fn get(&self, pixel: usize) -> Option<usize> {
        let slot = self.at.get(pixel).copied()?;
        (slot != Texel::NONE).then_some(slot as usize)
    }

    /// What a bilinear lookup fetches where a ray has hit, as offsets into all pages.
    fn taps(&self, atlas: &Atlas, hit: &Hit) -> [(usize, f32); 4] {
        let place = &atlas.objects[hit.object as usize];
        let corners = place.layout.triangles[hit.triangle as usize];
        let [a, b, c] = corners.map(|v| place.layout.vertices[v as usize].uv);
        let w = corner_weights(hit.bary);
        let uv = a * w.x + b * w.y + c * w.z + place.origin.as_vec2();
        let page = place.page as usize * self.page;
        sample::taps(uv, atlas.page_size).map(|(i, weight)| (page + i, weight))
    }

    /// The tile that a place which a ray has hit belongs to.
    pub fn tile(&self, atlas: &Atlas, hit: &Hit) -> Option<usize> {
        let taps = self.taps(atlas, hit);
        let nearest = taps.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        Some(self.get(nearest?.0)? / Texel::TILE)
    }
}

impl Sight {
    pub fn new(
        scene: &Scene,
        bvh: &SceneBvh,
        atlas: &Atlas,
        texels: &Texels,
        camera: &Camera,
    ) -> Self {
        let mut sight = Self {
            camera: camera.clone(),
            pixels: vec![None; (PICTURE[0] * PICTURE[1]) as usize],
            slots: Slots::new(scene, atlas, texels),
        };
        sight.cast(scene, bvh, atlas, |_, _, _| true);
        sight
    }

    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    pub fn slots(&self) -> &Slots {
        &self.slots
    }

    /// What is seen, pixel by pixel.
    pub fn pixels(&self) -> impl Iterator<Item = &Pixel> {
        self.pixels.iter().flatten()
    }

    /// The scene changed inside the boxes; `moved_in`: texels came.
    pub fn follow(
        &mut self,
        scene: &Scene,
        bvh: &SceneBvh,
        atlas: &Atlas,
        texels: &Texels,
        boxes: &[Bounds],
        moved_in: bool,
    ) {
        if moved_in {
            self.slots = Slots::new(scene, atlas, texels);
        }
        self.cast(scene, bvh, atlas, |eye, direction, pixel| {
            let far = pixel.map_or(f32::INFINITY, |p: Pixel| 1.001 * p.distance);
            boxes.iter().any(|b| meets(b, eye, direction) <= far)
        });
    }

    /// Looks again through the pixels that are `asked` for, by the ray's origin and direction and what was there.
    fn cast(
        &mut self,
        scene: &Scene,
        bvh: &SceneBvh,
        atlas: &Atlas,
        asked: impl Fn(Vec3, Vec3, Option<Pixel>) -> bool + Sync,
    ) {
        let far = 4.0 * scene.bounds().size().length();
        let scale = (0.5 * self.camera.fov_y).tan();
        let (transform, slots) = (self.camera.transform, &self.slots);
        let eye: Vec3 = transform.translation.into();
        let pixels = self.pixels.par_iter_mut().enumerate();
        pixels.for_each(|(i, pixel)| {
            let part = |i: u32, n: u32| 2.0 * (i as f32 + 0.5) / n as f32 - 1.0;
            let (column, row) = (i as u32 % PICTURE[0], i as u32 / PICTURE[0]);
            let (x, y) = (part(column, PICTURE[0]) * ASPECT, -part(row, PICTURE[1]));
            let local = Vec3::new(x * scale, y * scale, -1.0);
            let direction = transform.transform_vector3(local).normalize();
            if asked(eye, direction, *pixel) {
                let hit = bvh.closest(scene, eye, direction, far);
                *pixel = hit.map(|hit| Pixel {
                    distance: hit.t,
                    taps: slots.taps(atlas, &hit),
                });
            }
        });
    }

    /// By tile of texels, whether the camera sees any of it.
    pub fn tiles(&self, texels: &Texels) -> Vec<bool> {
        let mut seen = vec![false; texels.list.len() / Texel::TILE];
        for (pixel, _) in self.pixels().flat_map(|p| p.taps) {
            if let Some(slot) = self.slots.get(pixel) {
                seen[slot / Texel::TILE] = true;
            }
        }
        seen
    }
}

/// How far along a ray a box is; infinitely, where the ray misses it.
fn meets(bounds: &Bounds, origin: Vec3, direction: Vec3) -> f32 {
    let (a, b) = (
        (bounds.min - origin) / direction,
        (bounds.max - origin) / direction,
    );
    let (enters, leaves) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
    if enters <= leaves * 1.000_01 {
        enters
    } else {
        f32::INFINITY
    }
}

/// A number for each part of the map: what is seen, and the rest.
pub(in crate::bake) type Both = [f64; 2];

/// The norm over both parts of what has these norms there.
pub(in crate::bake) fn norm_in(parts: Parts, norms: Both) -> f64 {
    let squares = [Parts::SEEN, Parts::REST].into_iter().zip(norms);
    let held = squares.filter(|(part, _)| parts.hold(*part));
    held.map(|(_, norm)| norm * norm).sum::<f64>().sqrt()
}

/// Sums of rays' squares in both parts; in the rest no less than half a ray's that is like those which met what is seen: that so many
/// rays did not meet it does not say that no light does.
pub(super) fn missed([seen, rest]: Both, rays: u32) -> Both {
    let ray = f64::from(UNSEEN) * seen / f64::from(rays);
    [seen, rest.max(0.5 * ray)]
}

/// The map in two parts: what was seen when it was divided, and the rest. Places belong to the part of the tile that they lie in.
#[derive(Clone, Copy)]
pub(in crate::bake) struct Division<'a> {
    pub slots: &'a Slots,
    pub atlas: &'a Atlas,
    /// By tile of texels.
    pub seen: &'a [bool],
}

impl Division<'_> {
    /// Which of [`Both`] parts a place belongs to that a ray has hit.
    pub fn part(&self, hit: &Hit) -> usize {
        let tile = self.slots.tile(self.atlas, hit);
        usize::from(tile.is_none_or(|tile| self.seen.get(tile) != Some(&true)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_that_met_nothing_of_the_rest_leave_it_a_little() {
        let [seen, rest] = missed([8.0, 0.0], 4);
        assert_eq!(seen, 8.0);
        assert!(rest > 0.0 && rest < 0.5 * f64::from(UNSEEN) * seen);
        assert_eq!(missed([8.0, 3.0], 4), [8.0, 3.0]);
    }

    #[test]
    fn rays_meet_boxes_where_they_enter_them() {
        let unit = Bounds {
            min: Vec3::splat(-1.0),
            max: Vec3::splat(1.0),
        };
        let along = |x: f32, y: f32| meets(&unit, Vec3::new(x, y, 0.0), Vec3::X);
        assert_eq!(along(-3.0, 0.5), 2.0);
        assert_eq!(along(0.0, 0.5), 0.0, "from inside");
        assert_eq!(along(-3.0, 1.5), f32::INFINITY);
        assert_eq!(along(3.0, 0.5), f32::INFINITY, "behind");
    }
}

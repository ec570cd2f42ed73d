//! What stands near each texel, by rays: how far, and which way, shadow lookups can keep clear of it.
//!
//! It depends on the scene around a texel alone, not on how the scene came about: after an edit, texels around what
//! changed are looked at again, and get what a fresh bake of the edited scene would give them, bit for bit.

use std::ops::Range;

use glam::{Vec3, Vec3Swizzles as _};
use rayon::prelude::*;

use super::changes::{holds, widened};
use crate::lightmap::texels::Texels;
use crate::lightmap::{Clearance, Texel};
use crate::scene::{Bounds, Scene};
use crate::transport::SceneBvh;
use crate::transport::intersect::offset;

/// How far is looked, in texels of the mean density: about what a depth map's pixel spans at the far end of a room.
const REACH: f32 = 3.0;
/// Rays along the surface start this share of the reach above it.
const HEIGHT: f32 = 1.0 / 16.0;
/// No ray leads further away from its texel than this many times the reach: the last one starts a whole reach along both
/// axes of the surface away.
const FURTHEST: f32 = 3.0;

/// Keeps [`Texels::clearances`] up to date.
pub(in crate::bake) struct Clearances {
    /// Metres.
    reach: f32,
    /// By tile, object space.
    boxes: Vec<Bounds>,
}

impl Clearances {
    /// Finds what stands near each texel; `density` is the mean, texels per metre.
    pub(in crate::bake) fn new(
        scene: &Scene,
        bvh: &SceneBvh,
        texels: &mut Texels,
        density: f32,
    ) -> Self {
        let mut new = Self {
            reach: REACH / density,
            boxes: Vec::new(),
        };
        let all = 0..(texels.list.len() / Texel::TILE) as u32;
        new.extend(texels, std::slice::from_ref(&all));
        texels.clearances = texels
            .list
            .par_iter()
            .with_min_len(Texel::TILE)
            .map(|texel| new.around(scene, bvh, texel))
            .collect();
        new
    }

    /// How far a texel is from what is near it, at most, along each axis, metres.
    pub(in crate::bake) fn reach(&self) -> f32 {
        FURTHEST * self.reach
    }

    /// Follows a change of `objects`, which stood and stand in `boxes`. Returns the tiles of other objects that hold texels
    /// which have something else near them now, ascending, and where these texels are. What tiles hold that came has to be
    /// [told](Clearances::extend) before.
    pub(in crate::bake) fn update(
        &mut self,
        scene: &Scene,
        bvh: &SceneBvh,
        texels: &mut Texels,
        objects: &[u32],
        boxes: &[Bounds],
    ) -> (Vec<u32>, Vec<Vec3>) {
        texels.clearances.resize(texels.list.len(), Clearance::OPEN);
        let within = |by| -> Vec<Bounds> { boxes.iter().map(|b| widened(b, by)).collect() };
        let (wide, touched) = (within(self.reach()), within(1.25 * HEIGHT * self.reach));
        let whole = wide.iter().fold(Bounds::EMPTY, |all, b| all.union(b));
        let live = (0..scene.objects.len() as u32).filter(|o| !scene.is_gone(*o));
        let tiles: Vec<(u32, bool)> = live
            .flat_map(|object| {
                let changed = objects.binary_search(&object).is_ok();
                let own = texels.tiles.get(object as usize).cloned();
                let own = own.unwrap_or_default();
                own.map(move |tile| (object, tile, changed))
            })
            .filter(|&(object, tile, changed)| {
                changed || {
                    let tile = self.world_box(scene, object, tile);
                    meet(&tile, &whole) && wide.iter().any(|b| meet(&tile, b))
                }
            })
            .map(|(_, tile, changed)| (tile, changed))
            .collect();
        let list = &texels.list;
        let old = &texels.clearances;
        // Of each tile, what is not as before: the entry, where it is, and what is near it now.
        let found: Vec<Vec<(usize, Vec3, Clearance)>> = tiles
            .par_iter()
            .map(|&(tile, changed)| {
                let entries = tile as usize * Texel::TILE..(tile as usize + 1) * Texel::TILE;
                entries
                    .filter_map(|i| {
                        let position = world(scene, &list[i]);
                        if !changed && !wide.iter().any(|b| holds(b, position)) {
                            return None;
                        }
                        // Rays that pass by what changed find what they found.
                        let rays = self.rays(scene, &list[i], &old[i]);
                        if !changed && !rays.iter().any(|ray| ray.meets(&touched)) {
                            return None;
                        }
                        let new = self.around(scene, bvh, &list[i]);
                        (new != old[i]).then_some((i, position, new))
                    })
                    .collect()
            })
            .collect();
        let (mut replaced, mut near) = (Vec::new(), Vec::new());
        for ((tile, changed), found) in tiles.into_iter().zip(found) {
            if !changed && !found.is_empty() {
                replaced.push(tile);
            }
            for (entry, position, new) in found {
                texels.clearances[entry] = new;
                if !changed {
                    near.push(position);
                }
            }
        }
        replaced.sort_unstable();
        (replaced, near)
    }

    /// Boxes of tiles that came.
    pub(in crate::bake) fn extend(&mut self, texels: &Texels, new: &[Range<u32>]) {
        let tiles = texels.list.len() / Texel::TILE;
        self.boxes.resize(tiles, Bounds::EMPTY);
        for tile in new.iter().flat_map(|range| range.clone()) {
            let first = tile as usize * Texel::TILE;
            let own = texels.list[first..first + Texel::TILE].iter();
            let positions = own.map(|texel| Vec3::from_array(texel.position));
            self.boxes[tile as usize] = positions.fold(Bounds::EMPTY, Bounds::with);
        }
    }

    fn world_box(&self, scene: &Scene, object: u32, tile: u32) -> Bounds {
        let own = &self.boxes[tile as usize];
        let transform = &scene.objects[object as usize].transform;
        let center = transform.transform_point3(own.center());
        let half = 0.5 * own.size();
        let axes = transform.matrix3;
        let half: Vec3 =
            (axes.x_axis.abs() * half.x + axes.y_axis.abs() * half.y + axes.z_axis.abs() * half.z)
                .into();
        let half = half + (center.abs() + half) * 1e-5;
        Bounds {
            min: center - half,
            max: center + half,
        }
    }

    /// All that [`Clearances::around`] has looked along, or more, for what it found; but for the height at which it starts.
    fn rays(&self, scene: &Scene, texel: &Texel, found: &Clearance) -> [Segment; 5] {
        let (origin, face) = place(scene, texel);
        let (u, v) = face.any_orthonormal_pair();
        let push = Vec3::from_array(found.push);
        let both = |axis: Vec3| Segment {
            middle: origin,
            half: axis * self.reach,
        };
        let ahead = |from: Vec3, way: Vec3| Segment {
            middle: from + 0.5 * way,
            half: 0.5 * way,
        };
        let up = face * self.reach;
        [
            ahead(origin, up),
            both(u),
            both(v),
            ahead(origin, push.normalize_or_zero() * FURTHEST * self.reach),
            ahead(origin + push * found.way, up),
        ]
    }

    fn around(&self, scene: &Scene, bvh: &SceneBvh, texel: &Texel) -> Clearance {
        let (origin, face) = place(scene, texel);
        if texel.pixel == Texel::NONE || face == Vec3::ZERO {
            return Clearance::OPEN;
        }
        let reach = self.reach;
        let free = |from: Vec3, way: Vec3, most: f32| {
            bvh.closest(scene, from, way, most)
                .map_or(most, |hit| hit.t)
        };
        let above = free(origin, face, reach);
        let room = |distance: f32| {
            if distance < reach {
                distance
            } else {
                Clearance::OPEN.room
            }
        };
        let start = origin + face * (reach * HEIGHT).min(0.5 * above);
        let (u, v) = face.any_orthonormal_pair();
        let (mut push, mut most, mut near) = (Vec3::ZERO, 0.0f32, reach);
        for axis in [u, v] {
            // Mostly there is nothing: one ray tells for both ways.
            if !bvh.occluded(scene, start - axis * reach, axis, 2.0 * reach) {
                continue;
            }
            let [ahead, behind] = [axis, -axis].map(|way| free(start, way, reach));
            near = near.min(ahead).min(behind);
            // Between two walls to the middle, else a whole reach away from the one there is.
            let way = match (ahead < reach, behind < reach) {
                (true, true) => 0.5 * (ahead - behind),
                (true, false) => ahead - reach,
                (false, true) => reach - behind,
                (false, false) => 0.0,
            };
            push += axis * way;
            most = most.max(way.abs());
        }
        let open = Clearance {
            room: room(above),
            ..Clearance::OPEN
        };
        if most <= 0.0 {
            return open;
        }
        let (length, way) = (push.length(), push.normalize());
        let share = (0.5 * free(start, way, 2.0 * length) / length).min(1.0);
        let push = push * share;
        if share * most < 1e-6 * reach {
            // Nowhere to go; the way is kept, because it was looked along.
            return Clearance {
                push: way.to_array(),
                ..open
            };
        }
        let above = above.min(free(start + push, face, reach));
        Clearance {
            push: (push / (share * most)).to_array(),
            near,
            way: share * most,
            room: room(above),
        }
    }
}

/// A part of a ray, from end to end.
struct Segment {
    middle: Vec3,
    half: Vec3,
}

impl Segment {
    /// Whether it comes into one of the boxes: no axis separates the two (Ericson, Real-Time Collision Detection, 5.3.3).
    fn meets(&self, boxes: &[Bounds]) -> bool {
        let (half, reach) = (self.half, self.half.abs());
        boxes.iter().any(|b| {
            let (way, extent) = (self.middle - b.center(), 0.5 * b.size());
            let across = extent.yzx() * reach.zxy() + extent.zxy() * reach.yzx();
            way.abs().cmple(extent + reach).all()
                && way.cross(half).abs().cmple(across * 1.000_01 + 1e-12).all()
        })
    }
}

/// Where rays around a texel start, and its face's normal; 0 without area.
fn place(scene: &Scene, texel: &Texel) -> (Vec3, Vec3) {
    let transform = &scene.objects[texel.object as usize].transform;
    let face = transform.matrix3.inverse().transpose() * Vec3::from_array(texel.face);
    let face = face.normalize_or_zero();
    (offset(world(scene, texel), face), face)
}

fn world(scene: &Scene, texel: &Texel) -> Vec3 {
    let transform = &scene.objects[texel.object as usize].transform;
    transform.transform_point3(Vec3::from_array(texel.position))
}

fn meet(a: &Bounds, b: &Bounds) -> bool {
    a.min.cmple(b.max).all() && b.min.cmple(a.max).all()
}

#[cfg(test)]
mod tests;

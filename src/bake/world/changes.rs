//! What edits changed, and from that, where two versions of the scene differ. What stood somewhere for a while in between is
//! no difference: a light that has not followed an object on its way need only follow it to its end.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::Bound;
use std::sync::Arc;

use glam::Vec3;

use crate::bake::device::records::{Region, Version};
use crate::scene::Bounds;

/// Boxes that a light's update is limited to; more are joined into fewer.
const MAX_BOXES: usize = 8;
/// More than this many are joined in the order that they come in, without a search for the best pair.
const SEARCHED: usize = 64;

/// An object that stops light elsewhere than before.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Index of the object.
    pub object: u32,
    /// World bounds of where it stood, if it did.
    pub before: Option<Bounds>,
    /// World bounds of where it stands, if it does.
    pub after: Option<Bounds>,
}

/// What an edit changed.
#[derive(Clone, Debug, Default)]
pub struct Changed {
    /// Each object once.
    pub places: Vec<Place>,
    /// Where texels of other objects are that have something else near them now, world space.
    pub near: Vec<Vec3>,
    /// How far such a texel is from what stands near it, at most, along each axis, metres. The same for all edits.
    pub reach: f32,
}

impl Changed {
    /// World bounds of what stood and stands.
    pub fn boxes(&self) -> Vec<Bounds> {
        let both = self.places.iter().flat_map(|p| [p.before, p.after]);
        both.flatten().collect()
    }
}

/// Where two versions differ.
#[derive(Clone, Debug, Default)]
pub(in crate::bake) struct Between {
    /// What light passes otherwise: outside of the shadows of these boxes all light is the same.
    pub occluders: Vec<Region>,
    /// These boxes, and the receivers whose lookups differ: depth maps must be right around all of them.
    pub lookups: Vec<Region>,
    /// Whether anything stands in the earlier version alone, and in the later one.
    pub alone: [bool; 2],
}

/// What changed when versions began.
#[derive(Debug, Default)]
pub(in crate::bake) struct Changes {
    begun: BTreeMap<Version, Changed>,
    /// What was asked for, which is the same every time: lights ask one by one.
    known: RefCell<BTreeMap<[Version; 2], Arc<Between>>>,
}

impl Changes {
    pub(super) fn begin(&mut self, version: Version, changed: Changed) {
        self.begun.insert(version, changed);
    }

    /// Nobody asks for versions before `oldest` any more.
    pub(super) fn forget(&mut self, oldest: Version) {
        self.begun.retain(|&version, _| version > oldest);
        let known = self.known.get_mut();
        known.retain(|[from, _], _| *from >= oldest);
    }

    /// Where anything differs between two versions.
    pub(super) fn between(&self, a: Version, b: Version) -> Arc<Between> {
        let key = [a.min(b), a.max(b)];
        let mut known = self.known.borrow_mut();
        let found = || Arc::new(self.differences(key));
        Arc::clone(known.entry(key).or_insert_with(found))
    }

    /// Of each object that anything happened to, where it stands in the one version, and where in the other.
    ///
    /// A texel of another object that has something else near it has one of these boxes within reach, and was told of when it
    /// changed, perhaps when something came near that is gone again. What stands nearer than that is the same in both versions,
    /// and so is what the texel knows of it.
    fn differences(&self, [from, to]: [Version; 2]) -> Between {
        let after = (Bound::Excluded(from), Bound::Included(to));
        let changes = || self.begun.range(after).map(|(_, changed)| changed);
        if from == to {
            return Between::default();
        }
        let mut ends: BTreeMap<u32, Place> = BTreeMap::new();
        for place in changes().flat_map(|changed| &changed.places) {
            let end = ends.entry(place.object).or_insert(*place);
            end.after = place.after;
        }
        let mut boxes: Vec<Bounds> = Vec::new();
        for b in ends.values().flat_map(|p| [p.before, p.after]).flatten() {
            if !boxes.contains(&b) {
                boxes.push(b);
            }
        }
        let mut grown = boxes.clone();
        for changed in changes() {
            let wide: Vec<Bounds> = boxes.iter().map(|b| widened(b, changed.reach)).collect();
            for point in &changed.near {
                if let Some(i) = wide.iter().position(|b| holds(b, *point)) {
                    grown[i] = grown[i].with(*point);
                }
            }
        }
        Between {
            occluders: regions(boxes),
            lookups: regions(grown),
            alone: [
                ends.values().any(|p| p.before.is_some()),
                ends.values().any(|p| p.after.is_some()),
            ],
        }
    }
}

/// By so much to each side, and a little more, so that rounding lets nothing out.
pub(super) fn widened(bounds: &Bounds, by: f32) -> Bounds {
    let by = Vec3::splat(by) + (bounds.min.abs() + bounds.max.abs()) * 1e-5;
    Bounds {
        min: bounds.min - by,
        max: bounds.max + by,
    }
}

pub(super) fn holds(bounds: &Bounds, point: Vec3) -> bool {
    bounds.min.cmple(point).all() && point.cmple(bounds.max).all()
}

/// Not too many boxes that hold all of some.
fn regions(mut boxes: Vec<Bounds>) -> Vec<Region> {
    if boxes.len() > SEARCHED {
        let together = boxes.len().div_ceil(SEARCHED);
        let all = boxes.chunks(together);
        boxes = all
            .map(|few| few.iter().fold(Bounds::EMPTY, |all, b| all.union(b)))
            .collect();
    }
    while boxes.len() > MAX_BOXES {
        let pairs = (0..boxes.len()).flat_map(|i| (0..i).map(move |k| (k, i)));
        let grows = |&(a, b): &(usize, usize)| {
            let (a, b) = (&boxes[a], &boxes[b]);
            surface(&a.union(b)) - surface(a) - surface(b)
        };
        let least = pairs.min_by(|a, b| grows(a).total_cmp(&grows(b)));
        let (a, b) = least.expect("several boxes");
        boxes[a] = boxes[a].union(&boxes[b]);
        boxes.swap_remove(b);
    }
    let region = |b: &Bounds| Region {
        center: b.center().to_array(),
        // Rounding must not let a triangle out of its box.
        extent: (b.size() * 0.5 + (b.min.abs() + b.max.abs()) * 1e-6 + Vec3::splat(1e-6))
            .to_array(),
    };
    boxes.iter().map(region).collect()
}

fn surface(bounds: &Bounds) -> f32 {
    let size = bounds.size();
    size.x * size.y + size.y * size.z + size.z * size.x
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(x: f32) -> Bounds {
        let center = Vec3::new(x, 0.0, 0.0);
        Bounds {
            min: center - 0.5,
            max: center + 0.5,
        }
    }

    fn moved(object: u32, before: Option<f32>, after: Option<f32>, near: &[f32]) -> Changed {
        Changed {
            places: vec![Place {
                object,
                before: before.map(cube),
                after: after.map(cube),
            }],
            near: near.iter().map(|x| Vec3::new(*x, 0.0, 0.0)).collect(),
            reach: 1.0,
        }
    }

    fn spans(regions: &[Region]) -> Vec<(f32, f32)> {
        let ends = |r: &Region| (r.center[0] - r.extent[0], r.center[0] + r.extent[0]);
        let round = |x: f32| (x * 100.0).round() / 100.0;
        let spans = regions.iter().map(ends);
        spans.map(|(a, b)| (round(a), round(b))).collect()
    }

    /// An object comes, goes on, and another one is there and gone again: from the first version to the last, the places in
    /// between are no difference, but texels near the end are, whenever they were told of.
    #[test]
    fn what_happened_in_between_is_no_difference() {
        let mut changes = Changes::default();
        changes.begin(1, moved(0, Some(0.0), Some(10.0), &[1.2, 9.0]));
        changes.begin(2, moved(1, None, Some(5.0), &[20.9, 5.9]));
        changes.begin(3, moved(0, Some(10.0), Some(20.0), &[11.0]));
        changes.begin(4, moved(1, Some(5.0), None, &[5.9]));
        let lookups = |a, b| spans(&changes.between(a, b).lookups);
        assert_eq!(lookups(0, 1), [(-0.5, 1.2), (9.0, 10.5)]);
        assert_eq!(lookups(0, 4), [(-0.5, 1.2), (19.5, 20.9)]);
        assert_eq!(lookups(4, 0), lookups(0, 4));
        assert_eq!(lookups(1, 4), [(9.5, 11.0), (19.5, 20.9)]);
        let occluders = spans(&changes.between(0, 4).occluders);
        assert_eq!(occluders, [(-0.5, 0.5), (19.5, 20.5)]);
        assert!(lookups(2, 2).is_empty());
        changes.forget(3);
        assert_eq!(spans(&changes.between(3, 4).lookups), [(4.5, 5.9)]);
    }

    /// Many boxes become few that hold them all, and those far apart stay apart.
    #[test]
    fn boxes_that_lie_together_are_joined() {
        let boxes: Vec<Bounds> = (0..300u16)
            .map(|i| cube(f32::from(i % 100) * 0.01 + f32::from(i / 100) * 50.0))
            .collect();
        let joined = regions(boxes.clone());
        assert!(joined.len() <= MAX_BOXES);
        let all = spans(&joined);
        for b in &boxes {
            let inside = |s: &&(f32, f32)| s.0 <= b.min.x + 0.01 && b.max.x - 0.01 <= s.1;
            assert!(all.iter().any(|s| inside(&s)));
        }
        assert!(all.iter().all(|(a, b)| b - a < 3.0), "{all:?}");
    }
}

//! Lightmap space for objects that come after the atlas was made: nothing that lies there moves.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::UVec2;
use rayon::prelude::*;

use super::atlas::address;
use super::error::LightmapError;
use super::shape::{Laid, canonical_scale, shapes_among};
use super::{Atlas, ObjectAtlas, UvSource};
use crate::scene::Scene;

impl ObjectAtlas {
    /// Of an object that has no surface.
    pub(super) fn nowhere() -> Self {
        Self {
            page: 0,
            origin: UVec2::ZERO,
            size: UVec2::ZERO,
            source: UvSource::Unwrapped,
            layout: Arc::default(),
        }
    }
}

/// A rectangle in use: left, top, right, bottom, texels.
type Rectangle = [u32; 4];

impl Atlas {
    /// Follows an edit: lays out the objects of `scene` that have no texels yet, at the atlas's density, and finds free
    /// rectangles for them, on new pages where there is none left. Returns these objects, ascending.
    ///
    /// What objects that are gone lay on is free, but they keep their layout and their place: an undo brings them back there,
    /// after it took away all that came later. Those that an undo took away altogether lose it. An object with the mesh and scale of another one gets its layout. The result depends on the atlas and
    /// the scenes that it has followed alone.
    ///
    /// # Errors
    /// [`LightmapError::TooLarge`] for an object larger than a page, and what else [`Atlas::build`] finds wrong with an object; the
    /// atlas is then as it was.
    pub fn update(&mut self, scene: &Scene) -> Result<Vec<u32>, LightmapError> {
        let mut objects = self.objects.clone();
        objects.truncate(scene.objects.len());
        objects.resize_with(scene.objects.len(), ObjectAtlas::nowhere);
        let is_new = |object: &u32| {
            let triangles = scene.mesh(*object).triangles.len();
            triangles > 0 && objects[*object as usize].layout.triangles.is_empty()
        };
        let new: Vec<u32> = (0..objects.len() as u32).filter(is_new).collect();
        let mut unlike: Vec<u32> = Vec::new();
        let twins = twins(scene, &new);
        for &object in &new {
            match twins.get(&object) {
                Some(twin) => {
                    let like = &objects[*twin as usize];
                    objects[object as usize] = ObjectAtlas {
                        page: 0,
                        origin: UVec2::ZERO,
                        ..like.clone()
                    };
                }
                None => unlike.push(object),
            }
        }
        let shapes = shapes_among(scene, &unlike)?;
        // Collected in order, so that the first error is the same one whatever the threads do.
        let laid: Vec<Result<Laid, LightmapError>> = shapes
            .par_iter()
            .map(|shape| shape.lay_out(scene, self.density, self.page_size, None))
            .collect();
        for (shape, laid) in shapes.iter().zip(laid) {
            let laid = laid?;
            let layout = Arc::new(laid.layout);
            for &object in &shape.objects {
                objects[object as usize] = ObjectAtlas {
                    size: laid.size,
                    source: laid.source,
                    layout: layout.clone(),
                    ..ObjectAtlas::nowhere()
                };
            }
        }
        let pages = self.find_room(scene, &mut objects, &new)?;
        (self.objects, self.pages) = (objects, pages);
        Ok(new)
    }

    /// Without the objects that are gone, and without the pages after the last one in use: what is written, and what
    /// a bake of the written file starts from. Objects keep their index.
    pub fn shown(&self, scene: &Scene) -> Self {
        let mut shown = self.clone();
        shown.objects.truncate(scene.objects.len());
        for (i, object) in shown.objects.iter_mut().enumerate() {
            if scene.is_gone(i as u32) {
                *object = ObjectAtlas::nowhere();
            }
        }
        let used = shown.objects.iter().filter(|o| o.size != UVec2::ZERO);
        shown.pages = used.map(|o| o.page + 1).max().unwrap_or(1);
        shown
    }

    /// Places the `new` ones of `objects`, the highest first; returns the number of pages.
    fn find_room(
        &self,
        scene: &Scene,
        objects: &mut [ObjectAtlas],
        new: &[u32],
    ) -> Result<u32, LightmapError> {
        let mut pages: Vec<Vec<Rectangle>> = vec![Vec::new(); self.pages as usize];
        for (i, object) in objects.iter().enumerate() {
            let i = i as u32;
            if object.size != UVec2::ZERO && !scene.is_gone(i) && new.binary_search(&i).is_err() {
                pages[object.page as usize].push(rectangle(object.origin, object.size));
            }
        }
        let mut order = new.to_vec();
        order.sort_by_key(|&i| {
            let size = objects[i as usize].size;
            (std::cmp::Reverse((size.y, size.x)), i)
        });
        for i in order {
            let size = objects[i as usize].size;
            let found = pages
                .iter()
                .enumerate()
                .find_map(|(p, used)| Some((p, room(used, size, self.page_size)?)));
            let (page, origin) = match found {
                Some(place) => place,
                None => {
                    let origin =
                        room(&[], size, self.page_size).ok_or_else(|| LightmapError::TooLarge {
                            object: scene.objects[i as usize].name.clone(),
                            width: size.x.into(),
                            height: size.y.into(),
                            page_size: self.page_size,
                        })?;
                    pages.push(Vec::new());
                    (pages.len() - 1, origin)
                }
            };
            pages[page].push(rectangle(origin, size));
            let object = &mut objects[i as usize];
            (object.page, object.origin) = (page as u32, origin);
        }
        address(pages.len(), self.page_size).map(|(_, pages)| pages)
    }
}

/// For each of some objects another one, the first, that has the same mesh at the same scale.
fn twins(scene: &Scene, new: &[u32]) -> BTreeMap<u32, u32> {
    let key = |object: u32| {
        let object = &scene.objects[object as usize];
        let scale = canonical_scale(object.transform.matrix3.into());
        (object.mesh, scale.to_cols_array().map(f32::to_bits))
    };
    let mut wanted: BTreeMap<_, Vec<u32>> = BTreeMap::new();
    for &object in new {
        wanted.entry(key(object)).or_default().push(object);
    }
    let meshes: Vec<u32> = wanted.keys().map(|(mesh, _)| *mesh).collect();
    let mut twins = BTreeMap::new();
    for object in 0..scene.objects.len() as u32 {
        let mesh = scene.objects[object as usize].mesh;
        if meshes.binary_search(&mesh).is_ok()
            && new.binary_search(&object).is_err()
            && let Some(objects) = wanted.remove(&key(object))
        {
            twins.extend(objects.into_iter().map(|new| (new, object)));
        }
    }
    twins
}

fn rectangle(origin: UVec2, size: UVec2) -> Rectangle {
    let end = origin + size;
    [origin.x, origin.y, end.x, end.y]
}

/// The highest free place in a page (then the leftmost): its top is the page's or the bottom of a rectangle in use, its left
/// side the page's or the right side of one.
fn room(used: &[Rectangle], size: UVec2, page_size: u32) -> Option<UVec2> {
    if size.max_element() > page_size {
        return None;
    }
    let mut tops: Vec<u32> = used.iter().map(|r| r[3]).collect();
    tops.push(0);
    tops.sort_unstable();
    tops.dedup();
    for y in tops.into_iter().take_while(|y| *y <= page_size - size.y) {
        let mut beside: Vec<(u32, u32)> = used
            .iter()
            .filter(|r| r[1] < y + size.y && y < r[3])
            .map(|r| (r[0], r[2]))
            .collect();
        beside.sort_unstable();
        let mut x = 0;
        for (left, right) in beside {
            if x + size.x <= left {
                break;
            }
            x = x.max(right);
        }
        if x + size.x <= page_size {
            return Some(UVec2::new(x, y));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn room_is_the_first_free_place(
            rectangles in prop::collection::vec((0u32..14, 0u32..14, 1u32..6, 1u32..6), 0..12),
            size in (1u32..9, 1u32..9),
        ) {
            const PAGE: u32 = 16;
            let used: Vec<Rectangle> = rectangles
                .iter()
                .map(|&(x, y, w, h)| [x, y, (x + w).min(PAGE), (y + h).min(PAGE)])
                .collect();
            let size = UVec2::from(size);
            let free = |at: UVec2| {
                let end = at + size;
                end.max_element() <= PAGE
                    && used.iter().all(|r| {
                        r[2] <= at.x || end.x <= r[0] || r[3] <= at.y || end.y <= r[1]
                    })
            };
            let places = (0..PAGE).flat_map(|y| (0..PAGE).map(move |x| UVec2::new(x, y)));
            prop_assert_eq!(room(&used, size, PAGE), places.into_iter().find(|p| free(*p)));
        }
    }
}

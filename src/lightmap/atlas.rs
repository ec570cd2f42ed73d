//! The atlas: how fine every object is, and which rectangle of which page it gets.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::UVec2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::authored::verbatim;
use super::budget::{lay_out, within_budget};
use super::detail::Probe;
use super::error::LightmapError;
use super::shape::{shapes, snap};
use super::skyline::Skyline;
use super::{Atlas, ObjectAtlas, UvSource};
use crate::scene::Scene;

/// How the atlas is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtlasOptions {
    /// Texels per metre; none: from `texels`.
    pub density: Option<f32>,
    /// Texels to be lit, those around the charts' borders included: the density that comes closest.
    pub texels: u64,
    /// What `texels` makes the atlas at most, texels per metre: small scenes need no more.
    pub max_density: f32,
    /// Width and height of a page, texels; none: the smallest power of two that holds everything, or several pages of 4096.
    pub page_size: Option<u32>,
}

impl AtlasOptions {
    /// The default, or as many texels as asked for: those are not capped.
    pub fn with_texels(texels: Option<u64>) -> Self {
        texels.map_or_else(Self::default, |texels| Self {
            texels,
            max_density: f32::MAX,
            ..Self::default()
        })
    }
}

impl Default for AtlasOptions {
    fn default() -> Self {
        Self {
            density: None,
            texels: 1_000_000,
            max_density: 100.0,
            page_size: None,
        }
    }
}

/// Where an object lies in the atlas, as the files record it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Placement {
    /// The object's name.
    pub name: String,
    /// The glTF node.
    pub node: u32,
    /// Page: the K of `lightmap_K.exr`.
    pub page: u32,
    /// Left column, texels.
    pub x: u32,
    /// Top row, texels.
    pub y: u32,
    /// Texels.
    pub width: u32,
    /// Texels.
    pub height: u32,
    /// Where the coordinates came from.
    pub source: UvSource,
}

/// The largest page that is chosen unasked.
const LARGEST_PAGE: u32 = 4096;
/// The smallest page.
const SMALLEST_PAGE: u32 = 16;

impl Atlas {
    /// Makes the layout of every object and packs their rectangles. The result depends on the scene and the options alone.
    pub fn build(scene: &Scene, options: &AtlasOptions) -> Result<Self, LightmapError> {
        Self::build_lit(scene, options, None)
    }

    /// [`Atlas::build`], with more of `options.texels` where the light that `probe` tells of varies more. A density that was
    /// asked for is the same everywhere.
    pub fn build_lit(
        scene: &Scene,
        options: &AtlasOptions,
        probe: Option<&dyn Probe>,
    ) -> Result<Self, LightmapError> {
        check(options)?;
        let shapes = shapes(scene)?;
        if scene
            .objects
            .iter()
            .all(|o| scene.meshes[o.mesh as usize].triangles.is_empty())
        {
            return Err(LightmapError::NoSurface);
        }
        let limit = options.page_size.unwrap_or(LARGEST_PAGE);
        let (density, laid) = match options.density {
            Some(density) => (density, lay_out(&shapes, scene, density, limit, None)?),
            None => within_budget(&shapes, scene, options, limit, probe)?,
        };
        let mut objects: Vec<Option<ObjectAtlas>> = vec![None; scene.objects.len()];
        for (shape, laid) in shapes.iter().zip(laid) {
            let layout = Arc::new(laid.layout);
            for &object in &shape.objects {
                objects[object as usize] = Some(ObjectAtlas {
                    page: 0,
                    origin: UVec2::ZERO,
                    size: laid.size,
                    source: laid.source,
                    layout: layout.clone(),
                });
            }
        }
        let mut objects: Vec<ObjectAtlas> = objects.into_iter().flatten().collect();
        let (page_size, pages) = pack(scene, &mut objects, options.page_size)?;
        tracing::info!(
            density,
            page_size,
            pages,
            objects = objects.len(),
            authored = objects
                .iter()
                .filter(|o| o.source == UvSource::Authored)
                .count(),
            "atlas"
        );
        Ok(Self {
            page_size,
            pages,
            density,
            objects,
        })
    }

    /// The atlas of an earlier bake, from the scene that it wrote (whose `TEXCOORD_1` are atlas coordinates) and the
    /// placements that it recorded.
    pub fn from_settings(
        scene: &Scene,
        density: f32,
        page_size: u32,
        pages: u32,
        placements: &[Placement],
    ) -> Result<Self, LightmapError> {
        if !(SMALLEST_PAGE..=16384).contains(&page_size)
            || pages == 0
            || density.is_nan()
            || density <= 0.0
        {
            return Err(LightmapError::Option {
                option: "the recorded atlas",
                requirement: "one or more pages of 16 to 16384 texels",
            });
        }
        address(pages as usize, page_size)?;
        let by_node: BTreeMap<u32, &Placement> = placements.iter().map(|p| (p.node, p)).collect();
        let objects = scene
            .objects
            .par_iter()
            .enumerate()
            .map(|(i, object)| {
                if scene.is_gone(i as u32) {
                    return Ok(ObjectAtlas::nowhere());
                }
                let fail = |reason: String| LightmapError::Repeat {
                    object: object.name.clone(),
                    reason,
                };
                let place = by_node
                    .get(&object.node)
                    .ok_or_else(|| fail(format!("node {} has no rectangle", object.node)))?;
                let origin = UVec2::new(place.x, place.y);
                let size = UVec2::new(place.width, place.height);
                let inside = |o: u32, s: u32| o.checked_add(s).is_some_and(|end| end <= page_size);
                if place.page >= pages || !inside(origin.x, size.x) || !inside(origin.y, size.y) {
                    return Err(fail("its rectangle leaves the pages".into()));
                }
                let mesh = &scene.meshes[object.mesh as usize];
                let mut layout =
                    verbatim(mesh, page_size as f32, origin).map_err(|r| fail(r.to_string()))?;
                snap(mesh, &mut layout);
                let leaves = |uv: glam::Vec2| {
                    uv.min_element() < 0.0 || (uv - size.as_vec2()).max_element() > 0.0
                };
                if layout.vertices.iter().any(|v| leaves(v.uv)) {
                    return Err(fail("its TEXCOORD_1 leaves its rectangle".into()));
                }
                let (page, source, layout) = (place.page, place.source, Arc::new(layout));
                Ok(ObjectAtlas {
                    page,
                    origin,
                    size,
                    source,
                    layout,
                })
            })
            .collect::<Result<_, _>>()?;
        Ok(Self {
            page_size,
            pages,
            density,
            objects,
        })
    }

    /// The rectangle of every object that is shown, for `bake.json` and for [`Atlas::from_settings`].
    pub fn placements(&self, scene: &Scene) -> Vec<Placement> {
        let placement = |(i, place): (usize, &ObjectAtlas)| {
            let object = scene.objects.get(i).filter(|_| !scene.is_gone(i as u32))?;
            Some(Placement {
                name: object.name.clone(),
                node: object.node,
                page: place.page,
                x: place.origin.x,
                y: place.origin.y,
                width: place.size.x,
                height: place.size.y,
                source: place.source,
            })
        };
        self.objects
            .iter()
            .enumerate()
            .filter_map(placement)
            .collect()
    }
}

fn check(options: &AtlasOptions) -> Result<(), LightmapError> {
    let positive = |v: f32| v.is_finite() && v > 0.0;
    let tests = [
        (
            options.density.is_none_or(positive),
            "--density",
            "a positive number of texels per metre",
        ),
        (
            options.max_density > 0.0,
            "the largest density",
            "a positive number of texels per metre",
        ),
        (options.texels > 0, "--texels", "at least 1"),
        (
            options
                .page_size
                .is_none_or(|p| (SMALLEST_PAGE..=16384).contains(&p)),
            "--page-size",
            "between 16 and 16384 texels",
        ),
    ];
    match tests.into_iter().find(|t| !t.0) {
        Some((_, option, requirement)) => Err(LightmapError::Option {
            option,
            requirement,
        }),
        None => Ok(()),
    }
}

/// Places the rectangles; returns the page size and the number of pages.
fn pack(
    scene: &Scene,
    objects: &mut [ObjectAtlas],
    page_size: Option<u32>,
) -> Result<(u32, u32), LightmapError> {
    let mut order: Vec<usize> = (0..objects.len())
        .filter(|&i| objects[i].size != UVec2::ZERO)
        .collect();
    order.sort_by_key(|&i| {
        let size = objects[i].size;
        (std::cmp::Reverse((size.y, size.x)), i)
    });
    let size = page_size.unwrap_or_else(|| {
        let area: u64 = order
            .iter()
            .map(|&i| u64::from(objects[i].size.x) * u64::from(objects[i].size.y))
            .sum();
        let widest = order
            .iter()
            .map(|&i| objects[i].size.max_element())
            .max()
            .unwrap_or(0);
        let mut size = SMALLEST_PAGE;
        while size < LARGEST_PAGE && (size < widest || u64::from(size).pow(2) < area) {
            size *= 2;
        }
        let fits = |size: u32| {
            let mut page = Skyline::new(size, size);
            order
                .iter()
                .all(|&i| page.insert(objects[i].size).is_some())
        };
        while size < LARGEST_PAGE && !fits(size) {
            size *= 2;
        }
        size
    });
    let mut pages: Vec<Skyline> = Vec::new();
    for i in order {
        let wanted = objects[i].size;
        let found = pages
            .iter_mut()
            .enumerate()
            .find_map(|(p, page)| Some((p, page.insert(wanted)?)));
        let (page, origin) = match found {
            Some(place) => place,
            None => {
                let mut page = Skyline::new(size, size);
                let origin = page.insert(wanted).ok_or_else(|| LightmapError::TooLarge {
                    object: scene.objects[i].name.clone(),
                    width: wanted.x.into(),
                    height: wanted.y.into(),
                    page_size: size,
                })?;
                pages.push(page);
                (pages.len() - 1, origin)
            }
        };
        (objects[i].page, objects[i].origin) = (page as u32, origin);
    }
    address(pages.len(), size)
}

/// A texel's index must stay below [`super::Texel::NONE`].
pub(super) fn address(pages: usize, page_size: u32) -> Result<(u32, u32), LightmapError> {
    if pages as u64 * u64::from(page_size).pow(2) >= u64::from(super::Texel::NONE) {
        return Err(LightmapError::TooManyPages { pages, page_size });
    }
    Ok((page_size, pages as u32))
}

#[cfg(test)]
#[path = "atlas_tests.rs"]
mod tests;

//! The atlas: how fine every object is, and which rectangle of which page it gets.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DMat3, Mat3, UVec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::authored::{Refusal, authored, verbatim};
use super::edges::charts;
use super::skyline::Skyline;
use super::unwrap::{triangle_area, unwrap};
use super::{Atlas, ObjectAtlas, UvLayout, UvSource};
use crate::scene::{Mesh, Scene};

/// How the atlas is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtlasOptions {
    /// Texels per metre; none: from `texels`.
    pub density: Option<f32>,
    /// Texels that the scene's surface should cover, those around the charts' borders not counted.
    pub texels: u64,
    /// What `texels` makes the atlas at most, texels per metre: small scenes need no more.
    pub max_density: f32,
    /// Width and height of a page, texels; none: the smallest power of two that holds everything, or several pages of 4096.
    pub page_size: Option<u32>,
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

/// Why there is no atlas.
#[derive(Debug, thiserror::Error)]
pub enum LightmapError {
    /// Nothing to light.
    #[error("the scene has no surface: add a mesh to a node of the default scene")]
    NoSurface,
    /// An option out of range.
    #[error("{option} must be {requirement}")]
    Option {
        /// As on the command line.
        option: &'static str,
        /// What would be right.
        requirement: &'static str,
    },
    /// Positions or a transform with NaN or infinity.
    #[error(
        "object '{object}' has a position or a transform that is not a number: repair it in the modelling tool"
    )]
    NotFinite {
        /// The object's name.
        object: String,
    },
    /// One object is larger than a page.
    #[error(
        "object '{object}' needs {width} x {height} texels, and a page has {page_size} x {page_size}: lower --density, raise --page-size, or split the object"
    )]
    TooLarge {
        /// The object's name.
        object: String,
        /// Texels.
        width: u64,
        /// Texels.
        height: u64,
        /// Texels.
        page_size: u32,
    },
    /// More texels than can be addressed.
    #[error(
        "{pages} pages of {page_size} x {page_size} are more than can be addressed: lower --density or --page-size"
    )]
    TooManyPages {
        /// Number of pages.
        pages: usize,
        /// Texels.
        page_size: u32,
    },
    /// Unwrapping failed.
    #[error("object '{object}' cannot be unwrapped ({reason}): give it a TEXCOORD_1, or split it")]
    Unwrap {
        /// The object's name.
        object: String,
        /// From the unwrapper.
        reason: String,
    },
    /// A written atlas does not fit the scene.
    #[error(
        "object '{object}' does not fit the recorded atlas ({reason}): repeat with the scene.glb that was written beside it"
    )]
    Repeat {
        /// The object's name.
        object: String,
        /// What does not fit.
        reason: String,
    },
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
/// Layouts are snapped to this part of a texel. Then coordinates survive the way through a file bit for bit: a corner in
/// a page of 16384 texels takes 14 + 8 bits, and f32 has 24.
const SNAP: f32 = 256.0;

impl Atlas {
    /// Makes the layout of every object and packs their rectangles. The result depends on the scene and the options alone.
    pub fn build(scene: &Scene, options: &AtlasOptions) -> Result<Self, LightmapError> {
        check(options)?;
        let shapes = shapes(scene)?;
        let surface: f64 = shapes.iter().map(|s| s.area * s.objects.len() as f64).sum();
        if scene
            .objects
            .iter()
            .all(|o| scene.meshes[o.mesh as usize].triangles.is_empty())
        {
            return Err(LightmapError::NoSurface);
        }
        let density = options.density.unwrap_or_else(|| {
            ((options.texels as f64 / surface).sqrt() as f32).min(options.max_density)
        });
        let limit = options.page_size.unwrap_or(LARGEST_PAGE);
        let mut objects: Vec<Option<ObjectAtlas>> = vec![None; scene.objects.len()];
        let layouts: Vec<_> = shapes
            .par_iter()
            .map(|shape| shape.layout(scene, density, limit))
            .collect();
        for (shape, layout) in shapes.iter().zip(layouts) {
            let (layout, size, source) = layout?;
            let layout = Arc::new(layout);
            for &object in &shape.objects {
                let (page, origin) = (0, UVec2::ZERO);
                objects[object as usize] = Some(ObjectAtlas {
                    page,
                    origin,
                    size,
                    source,
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
            .map(|object| {
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

    /// Every object's rectangle, for `bake.json` and for [`Atlas::from_settings`].
    pub fn placements(&self, scene: &Scene) -> Vec<Placement> {
        let placement = |(object, place): (&crate::scene::Object, &ObjectAtlas)| Placement {
            name: object.name.clone(),
            node: object.node,
            page: place.page,
            x: place.origin.x,
            y: place.origin.y,
            width: place.size.x,
            height: place.size.y,
            source: place.source,
        };
        scene
            .objects
            .iter()
            .zip(&self.objects)
            .map(placement)
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

/// A mesh at one scale: what objects share a layout for.
struct Shape {
    objects: Vec<u32>,
    mesh: u32,
    /// Vertex positions, metres of the world up to a rotation.
    positions: Vec<Vec3>,
    /// m².
    area: f64,
}

/// Groups the objects, in the order of each group's first.
fn shapes(scene: &Scene) -> Result<Vec<Shape>, LightmapError> {
    let mut groups: BTreeMap<(u32, [u32; 9]), Vec<u32>> = BTreeMap::new();
    for (i, object) in scene.objects.iter().enumerate() {
        let scale = canonical_scale(object.transform.matrix3.into());
        let key = (object.mesh, scale.to_cols_array().map(f32::to_bits));
        groups.entry(key).or_default().push(i as u32);
    }
    let mut shapes = groups
        .into_par_iter()
        .map(|((mesh, scale), objects)| {
            let scale = Mat3::from_cols_array(&scale.map(f32::from_bits));
            let data = &scene.meshes[mesh as usize];
            let positions: Vec<Vec3> = data.positions.iter().map(|p| scale * *p).collect();
            let object = &scene.objects[objects[0] as usize];
            if !object.transform.is_finite() || positions.iter().any(|p| !p.is_finite()) {
                return Err(LightmapError::NotFinite {
                    object: object.name.clone(),
                });
            }
            let area = data
                .triangles
                .iter()
                .map(|t| triangle_area(&positions, t))
                .sum();
            Ok(Shape {
                objects,
                mesh,
                positions,
                area,
            })
        })
        .collect::<Result<Vec<_>, _>>()?;
    shapes.sort_by_key(|s| s.objects[0]);
    Ok(shapes)
}

/// The scale and shear of a transform without its rotation and mirroring: the upper triangular R with RᵀR = MᵀM, rounded to
/// one part in 4096, so that instances at one scale compare equal however they are turned.
fn canonical_scale(matrix: Mat3) -> Mat3 {
    let m: DMat3 = matrix.as_dmat3();
    let gram = m.transpose() * m;
    let mean = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
    if !(mean > 0.0 && mean.is_finite()) {
        return if mean == 0.0 { Mat3::ZERO } else { Mat3::NAN };
    }
    let round = |v: f64| (v / mean * 4096.0).round() / 4096.0 + 0.0; // never -0
    let [a, b, c] = [gram.x_axis.x, gram.y_axis.x, gram.z_axis.x].map(round);
    let [d, e, f] = [gram.y_axis.y, gram.z_axis.y, gram.z_axis.z].map(round);
    // Cholesky; an axis that is scaled to nothing leaves a row of zeros.
    let divide = |v: f64, by: f64| if by > 0.0 { v / by } else { 0.0 };
    let r11 = a.max(0.0).sqrt();
    let (r12, r13) = (divide(b, r11), divide(c, r11));
    let r22 = (d - r12 * r12).max(0.0).sqrt();
    let r23 = divide(e - r12 * r13, r22);
    let r33 = (f - r13 * r13 - r23 * r23).max(0.0).sqrt();
    let size =
        f32::from_bits((mean.sqrt() as f32).to_bits().wrapping_add(1 << 11) & !((1 << 12) - 1));
    let columns = [[r11, 0.0, 0.0], [r12, r22, 0.0], [r13, r23, r33]];
    Mat3::from_cols_array_2d(&columns.map(|c| c.map(|v| v as f32))) * size
}

impl Shape {
    fn layout(
        &self,
        scene: &Scene,
        density: f32,
        limit: u32,
    ) -> Result<(UvLayout, UVec2, UvSource), LightmapError> {
        let mesh = &scene.meshes[self.mesh as usize];
        let object = || scene.objects[self.objects[0] as usize].name.clone();
        if mesh.triangles.is_empty() {
            return Ok((UvLayout::default(), UVec2::ZERO, UvSource::Unwrapped));
        }
        let too_large = |width: f64, height: f64| LightmapError::TooLarge {
            object: object(),
            width: width as u64,
            height: height as u64,
            page_size: limit,
        };
        // Before any memory is asked for: the surface alone, or one edge, may already be more than a page.
        let side = self.area.sqrt() * f64::from(density);
        if side > f64::from(limit) {
            return Err(too_large(side, side));
        }
        let longest = self.longest_edge(mesh) * f64::from(density);
        if longest > 1.42 * f64::from(limit) {
            return Err(too_large(longest, 1.0));
        }
        let kept = match authored(mesh, &self.positions, density) {
            Ok((layout, size)) if size.max_element() <= limit => Some((layout, size)),
            Ok((_, size)) => {
                let refusal = Refusal::Sparse {
                    width: size.x,
                    height: size.y,
                };
                tracing::info!(mesh = mesh.name, "TEXCOORD_1 is not used: {refusal}");
                None
            }
            Err(Refusal::Missing) => None,
            Err(refusal) => {
                tracing::info!(mesh = mesh.name, "TEXCOORD_1 is not used: {refusal}");
                None
            }
        };
        let (mut layout, size, source) = match kept {
            Some((layout, size)) => (layout, size, UvSource::Authored),
            None => {
                let (layout, size) =
                    unwrap(mesh, &self.positions, density, limit).map_err(|e| {
                        LightmapError::Unwrap {
                            object: object(),
                            reason: e.to_string(),
                        }
                    })?;
                (layout, size, UvSource::Unwrapped)
            }
        };
        if size.max_element() > limit {
            return Err(too_large(size.x.into(), size.y.into()));
        }
        snap(mesh, &mut layout);
        Ok((layout, size, source))
    }

    fn longest_edge(&self, mesh: &Mesh) -> f64 {
        let edges = mesh
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
        let length = |(a, b): (u32, u32)| {
            self.positions[a as usize]
                .as_dvec3()
                .distance(self.positions[b as usize].as_dvec3())
        };
        edges.map(length).fold(0.0, f64::max)
    }
}

/// Rounds the coordinates to what a file can hold, and numbers the charts by what the file will tell: so that the atlas read
/// back is the atlas that was written.
fn snap(mesh: &Mesh, layout: &mut UvLayout) {
    for vertex in &mut layout.vertices {
        vertex.uv = (vertex.uv * SNAP).round() / SNAP;
    }
    layout.charts = charts(mesh, layout);
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
fn address(pages: usize, page_size: u32) -> Result<(u32, u32), LightmapError> {
    if pages as u64 * u64::from(page_size).pow(2) >= u64::from(super::Texel::NONE) {
        return Err(LightmapError::TooManyPages { pages, page_size });
    }
    Ok((page_size, pages as u32))
}

#[cfg(test)]
#[path = "atlas_tests.rs"]
mod tests;

//! Where the light is kept: charts in an atlas, the texels that surfaces fetch, the finished map, and its files.

mod atlas;
mod authored;
mod budget;
pub mod compare;
pub mod coverage;
pub mod detail;
mod edges;
mod error;
pub mod export;
pub mod exr;
mod flat;
mod glb;
mod grow;
pub(crate) mod pool;
pub mod preview;
mod raster;
mod raw;
pub mod resolve;
pub(crate) mod sample;
mod seams;
mod shape;
mod skyline;
pub mod texels;
mod tiles;
mod unwrap;
pub(crate) mod viewpoint;

pub use atlas::{AtlasOptions, Placement};
pub use authored::Refusal;
pub use error::LightmapError;
pub use glb::{lit_document, page_file};

use std::sync::Arc;

use glam::{UVec2, Vec2};
use serde::{Deserialize, Serialize};

/// Empty texels around every chart and every object's rectangle: charts are twice this apart, so that neither bilinear
/// filtering nor a coarser mip level or two mixes them.
pub const PADDING: u32 = 2;

/// Where every object's charts lie. A chart's texels belong to one object alone.
#[derive(Clone, Debug)]
pub struct Atlas {
    /// Width and height of every page, texels.
    pub page_size: u32,
    /// Number of pages.
    pub pages: u32,
    /// Texels per metre that was asked for.
    pub density: f32,
    /// One per [`crate::scene::Scene::objects`]; without size for those that have no surface.
    pub objects: Vec<ObjectAtlas>,
}

/// An object's rectangle in the atlas and the layout inside it.
#[derive(Clone, Debug)]
pub struct ObjectAtlas {
    /// Page index.
    pub page: u32,
    /// Top-left corner, texels.
    pub origin: UVec2,
    /// Width and height, texels, padding included.
    pub size: UVec2,
    /// Authored or unwrapped.
    pub source: UvSource,
    /// Shared by objects that instance one mesh at one scale.
    pub layout: Arc<UvLayout>,
}

/// Where an object's lightmap coordinates come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UvSource {
    /// The file's `TEXCOORD_1`.
    Authored,
    /// Charts made for it.
    Unwrapped,
}

/// A mesh's triangles laid out in a rectangle.
#[derive(Clone, Debug, Default)]
pub struct UvLayout {
    /// Vertices, split where charts separate.
    pub vertices: Vec<UvVertex>,
    /// One per mesh triangle, in the mesh's order, indices into `vertices`.
    pub triangles: Vec<[u32; 3]>,
    /// One per triangle: which connected chart it belongs to.
    pub charts: Vec<u32>,
}

/// A vertex of a [`UvLayout`].
#[derive(Clone, Copy, Debug)]
pub struct UvVertex {
    /// The mesh vertex it came from.
    pub source: u32,
    /// Texels, relative to [`ObjectAtlas::origin`]; the centre of the first texel is at (0.5, 0.5).
    pub uv: Vec2,
}

/// A surface sample that receives light: what one lit texel of the lightmap stands for. Shared with the shaders.
///
/// Texels are listed object by object, so that every 64 in the list (a *tile*) lie together and face alike; an object's last
/// tile is filled up with texels whose `pixel` is [`Texel::NONE`].
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Texel {
    /// Object space.
    pub position: [f32; 3],
    /// Index into [`crate::scene::Scene::objects`].
    pub object: u32,
    /// Object space, unit length: the interpolated vertex normal, or the geometric one where that is missing or turned away.
    pub normal: [f32; 3],
    /// Object space, unit length: the geometric normal of the front. Light from behind it does not arrive, whatever `normal` says.
    pub face: [f32; 3],
    /// `page * page_size² + y * page_size + x`, or [`Texel::NONE`].
    pub pixel: u32,
}

impl Texel {
    /// Marks a filler.
    pub const NONE: u32 = u32::MAX;
    /// Texels per tile.
    pub const TILE: usize = 64;
}

/// What stands near a texel: shadows are looked up where nothing that is near can be mistaken for what shades it. World
/// space. Shared with the shaders.
///
/// A depth map's pixel stands for all that it covers. A wall that a texel touches covers pixels that the texel is looked up
/// in, and a panel that lies on the texel's surface is, for most pixels, as far away as the surface. So lookups keep as
/// far from what is near as a pixel is wide there: along `push`, which leads away from it, and along the surface's normal
/// only into the room that there is.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Clearance {
    /// Away from what is near, metres per metre that this leads away from it: longer than 1 in a corner. 0 where nothing is near,
    /// or as much on either side.
    pub push: [f32; 3],
    /// Distance of what is nearest, along the surface, metres.
    pub near: f32,
    /// How far away from what is near a lookup may go at most, metres.
    pub way: f32,
    /// Free distance along the face's normal, metres; [`Clearance::OPEN`]'s where nothing is near.
    pub room: f32,
}

impl Clearance {
    /// Nothing is near.
    pub const OPEN: Self = Self {
        push: [0.0; 3],
        near: 0.0,
        way: 0.0,
        room: 1e30,
    };
}

/// A finished map: irradiance in lux, linear RGB (Rec. 709 primaries), of each surface's front side.
#[derive(Clone, Debug)]
pub struct Lightmap {
    /// Width and height of every page, texels.
    pub page_size: u32,
    /// `page_size²` texels a page, top row first.
    pub pages: Vec<Vec<[f32; 3]>>,
}

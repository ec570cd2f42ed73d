//! What the shaders read: the `repr(C)` twins of the structures in glsl/common.glsl, and how virtual lights become them.

pub(in crate::bake) mod asked;
mod lights;

use bytemuck::{Pod, Zeroable};

use super::shared::*;
use crate::gpu::Address;
use crate::lightmap::Clearance;
pub(in crate::bake) use lights::{
    ShadowSizes, Surroundings, coarse, hemicube_bytes, misses, parallel_bytes, record,
};

/// `Receiver`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(in crate::bake) struct Receiver {
    pub position: [f32; 3],
    pub normal: [f32; 3],
    pub face: [f32; 3],
    pub clearance: Clearance,
}

/// `Replaced`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(in crate::bake) struct Replaced {
    pub tile: u32,
    pub old: u32,
    pub ended: u32,
    pub new: u32,
    pub instance: u32,
}

/// `Tile`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(in crate::bake) struct Tile {
    pub center: [f32; 3],
    pub extent: [f32; 3],
    pub axis: [f32; 3],
    pub cone_cos: f32,
    pub face_cos: f32,
    pub thickness: f32,
    pub aside: f32,
    pub sums: u32,
    pub instance: u32,
}

/// `Placement`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(in crate::bake) struct Placement {
    pub row: [[f32; 4]; 3],
    pub normal_row: [[f32; 3]; 3],
}

/// `Triangle`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(in crate::bake) struct Triangle {
    pub a: [f32; 3],
    pub b: [f32; 3],
    pub c: [f32; 3],
}

/// `Cutout`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(in crate::bake) struct Cutout {
    pub uv: [[f32; 2]; 3],
    pub first: u32,
    pub size: [u32; 2],
    pub wrap: u32,
}

/// `Chunk`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(in crate::bake) struct Chunk {
    pub center: [f32; 3],
    pub extent: [f32; 3],
    pub count: u32,
}

/// `Group`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(in crate::bake) struct Group {
    pub center: [f32; 3],
    pub extent: [f32; 3],
    pub instance: u32,
    pub first: [u32; LEVELS as usize],
    pub count: [u32; LEVELS as usize],
    pub cell: [f32; LEVELS as usize],
}

/// Counts edits of the scene; 0 is the scene as loaded.
pub type Version = u32;

/// Parts of the map: what a camera sees of it, and the rest. Each holds its own lights while an edit is followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Parts(u32);

impl Parts {
    /// What the camera sees.
    pub const SEEN: Self = Self(PART_SEEN);
    /// What it does not.
    pub const REST: Self = Self(PART_REST);
    /// The whole map.
    pub const ALL: Self = Self(PART_SEEN | PART_REST);

    /// Each by itself.
    pub(in crate::bake) const EACH: [Self; 2] = [Self::SEEN, Self::REST];

    /// As the shaders read them.
    pub(in crate::bake) fn bits(self) -> u32 {
        self.0
    }

    /// Whether all of another are among these.
    pub(in crate::bake) fn hold(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

/// `Instance`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(in crate::bake) struct Instance {
    pub since: Version,
    pub until: Version,
    pub crowded: u32,
}

/// `Region`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(in crate::bake) struct Region {
    pub center: [f32; 3],
    pub extent: [f32; 3],
}

/// `View`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(in crate::bake) struct View {
    pub origin: [f32; 3],
    pub x: [f32; 3],
    pub y: [f32; 3],
    pub z: [f32; 3],
    pub depth: Address,
    pub size: u32,
    pub kind: u32,
    pub cos_cone: f32,
    pub coarse: f32,
    pub version: u32,
    pub other: u32,
    pub base: i32,
    pub kept: u32,
    pub asked: [u32; FACES as usize],
}

impl View {
    /// Of its depth map, and what follows it.
    pub(in crate::bake) fn bytes(&self) -> u64 {
        match self.kind {
            VIEW_HEMICUBE => hemicube_bytes(self.size),
            _ => parallel_bytes(self.size),
        }
    }

    /// Whether everything in its map is to be drawn.
    pub(in crate::bake) fn begins_empty(&self) -> bool {
        self.base == 0 && self.kept != KEPT_ALL
    }
}

/// `Light`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(in crate::bake) struct Light {
    pub position: [f32; 3],
    pub normal: [f32; 3],
    pub flux: [f32; 3],
    pub other_flux: [f32; 3],
    pub area: f32,
    pub radius: f32,
    pub spot_scale: f32,
    pub spot_offset: f32,
    pub kind: u32,
    pub sign: i32,
    pub view: u32,
    pub other_view: u32,
    pub version: u32,
    pub other: u32,
    pub parts: u32,
    pub first_region: u32,
    pub regions: u32,
    pub origin: [f32; 3],
    pub blur: f32,
    pub blur_slope: f32,
    pub vertices: u32,
    pub vertex: [[f32; 3]; MAX_VERTICES as usize],
}

/// `ListHead`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct ListHead {
    pub groups_x: u32,
    pub groups_y: u32,
    pub groups_z: u32,
    pub entries: u32,
    pub weight: u32,
}

#[cfg(test)]
mod tests;

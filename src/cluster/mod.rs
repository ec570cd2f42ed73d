//! What stands for the light: an octree over the VPLs, the cells selected from it, and the virtual lights made from each.

use arrayvec::ArrayVec;
use glam::{Affine3A, Vec3};

/// A light that the GPU accumulates into the lightmap with one shadow map.
#[derive(Clone, Debug, PartialEq)]
pub struct VirtualLight {
    /// Geometry of the emitter.
    pub shape: Shape,
    /// Where visibility is evaluated from, world space. Unused for directional lights.
    pub position: Vec3,
    /// Unit vector the emitter faces (polygon, disk) or aims along (spot, directional).
    pub normal: Vec3,
    /// Polygon, disk: radiant flux in lumens. Point, spot: candela. Directional: lux.
    pub flux: Vec3,
    /// Comes straight from a light source: gets the finer shadow map.
    pub direct: bool,
}

/// The emitter's geometry.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A convex planar polygon, counter-clockwise seen from its front.
    Polygon {
        /// 3 to 8 vertices, world space.
        vertices: ArrayVec<Vec3, 8>,
    },
    /// A Lambertian disk of the given area in m² (0: a Lambertian point).
    Disk {
        /// m².
        area: f32,
    },
    /// An isotropic point.
    Point,
    /// A cone, half angles in radians.
    Spot {
        /// Full intensity inside.
        inner: f32,
        /// Dark outside.
        outer: f32,
    },
    /// Parallel light along `normal`.
    Directional {
        /// Light space to world space; looks along -Z.
        frame: Affine3A,
    },
}

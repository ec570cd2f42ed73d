//! How light travels: rays, quasi-Monte Carlo paths from the lights, and the virtual point lights they leave behind.

pub mod bvh;
pub mod differences;
pub mod direct;
pub mod emission;
mod flux;
pub mod intersect;
pub mod paths;
pub mod sampling;
pub mod surface;
#[cfg(test)]
pub(crate) mod testing;
mod touched;
pub mod tracer;
pub mod validate;
#[cfg(test)]
pub(crate) mod validate_tests;

use glam::Vec3;

pub use bvh::{Hit, SceneBvh};
pub use differences::{Differences, EmissionChange, LightChange};
pub use flux::FluxBalance;
pub use paths::{Emission, Emitters, LightPaths, Path, PathSet, PathSettings};
pub use tracer::{Tracer, trace};
pub use validate::Validator;

/// Which path left a VPL: orders VPLs, and is the same in every scene version.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct VplKey {
    /// [`crate::scene::Light::id`].
    pub light: u32,
    /// Index of the path in its light's sequence.
    pub path: u32,
    /// 0 for the first surface that the path meets.
    pub bounce: u32,
}

/// A virtual point light (Keller 1997): a path's hit on a surface, which sends the light on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vpl {
    /// Where it came from.
    pub key: VplKey,
    /// World space, metres.
    pub position: Vec3,
    /// Geometric normal of the side that was hit, unit length.
    pub normal: Vec3,
    /// What of the path's energy is reflected here, linear RGB: every albedo on the way, over what Russian roulette let live.
    pub share: Vec3,
    /// What it counts where VPLs are weighed against each other, in paths: its share, mean over RGB, of what the path carries when
    /// its light is as bright as it is referred to. Other than the flux, it is the same when the light is dimmed; so what stands for
    /// VPLs stays where it is.
    pub weight: f32,
    /// Reflected radiant flux, lumens, linear RGB: the share of the path's energy.
    pub flux: Vec3,
    /// The object that was hit.
    pub object: u32,
    /// Where the light sent on from here arrived.
    pub scatter: Scatter,
}

/// A ray of a path and what it found: feeds the balancing metric (IBGI section 5), and tells after an edit whether the ray
/// can have changed (section 4.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// Unit length.
    pub direction: Vec3,
    /// Metres to the surface that was hit; infinite if the ray left the scene.
    pub distance: f32,
    /// Mean over RGB of that surface's albedo; 0 if the ray left the scene.
    pub albedo: f32,
    /// The object that was hit; [`Scatter::NOTHING`] if the ray left the scene.
    pub object: u32,
}

impl Scatter {
    /// No object.
    pub const NOTHING: u32 = u32::MAX;
}

impl Default for Scatter {
    /// A ray that left the scene.
    fn default() -> Self {
        Self {
            direction: Vec3::Z,
            distance: f32::INFINITY,
            albedo: 0.0,
            object: Self::NOTHING,
        }
    }
}

//! What stands for the light: an octree over the VPLs, the cells selected from it, and the virtual lights made from each.

pub mod aperture;
pub mod balance;
mod border;
pub mod evaluate;
pub mod octree;
pub mod polygon;
pub mod similarity;

use arrayvec::ArrayVec;
use glam::{Affine3A, Vec3};
use rayon::prelude::*;

use crate::scene::Scene;
use crate::transport::paths::{PathSet, PathSettings, emitters};

use aperture::ApertureTree;
pub use balance::{Balancer, Budget, Cut, Forest, Step};
pub use octree::{Cell, FluxScale, Octree};
use similarity::Groups;
pub use similarity::SimilaritySettings;

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

/// Names a cell of the forest: a part of a light's aperture, or an octree cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum CellId {
    /// A node of an aperture's tree.
    Aperture {
        /// Index into [`Scene::lights`].
        light: u32,
        /// The way from the root: a 1, then a bit for each step, 0 for the first part.
        path: u64,
    },
    /// VPLs.
    Octree(Cell),
}

/// A selected cell and what stands for its light.
#[derive(Clone, Debug, PartialEq)]
pub struct Selected {
    /// The cell.
    pub cell: CellId,
    /// Its virtual lights; none if its VPLs joined a neighbour's polygon.
    pub lights: Vec<VirtualLight>,
}

/// All light of a scene, direct and bounced, in trees that can be cut at any level of detail.
#[derive(Clone, Debug)]
pub struct Clusters {
    /// Over all VPLs.
    pub octree: Octree,
    apertures: Vec<ApertureTree>,
    settings: SimilaritySettings,
    /// Lumens (mean over RGB) that all lights send.
    flux: f64,
}

impl Clusters {
    /// Over the paths of a scene, traced with `paths_settings`.
    pub fn new(
        scene: &Scene,
        paths: &PathSet,
        path_settings: &PathSettings,
        settings: SimilaritySettings,
    ) -> Self {
        let scale = FluxScale::new(path_settings.flux_per_path);
        let apertures = emitters(scene)
            .par_iter()
            .zip(&paths.lights)
            .enumerate()
            .map(|(l, (emitter, paths))| ApertureTree::new(scene, l, emitter, paths, &scale))
            .collect();
        let flux = paths
            .lights
            .iter()
            .map(|l| f64::from(crate::transport::emission::mean(l.flux)))
            .sum();
        Self {
            octree: Octree::build(scale, paths.vpls()),
            apertures,
            settings,
            flux,
        }
    }

    /// The cut at the fixed point of Algorithm 1.
    pub fn select(&self, budget: Budget) -> Cut<CellId> {
        balance::select(self, budget)
    }

    /// The virtual lights of a cut, cell by cell in the cut's order.
    pub fn virtual_lights(&self, cut: &Cut<CellId>) -> Vec<Selected> {
        let groups: Vec<(Cell, Groups)> = cut
            .cells
            .par_iter()
            .filter_map(|id| match id {
                CellId::Octree(cell) => {
                    let vpls = self.octree.node(cell)?.vpls();
                    Some((*cell, Groups::new(*cell, vpls, &self.settings)))
                }
                CellId::Aperture { .. } => None,
            })
            .collect();
        let groups = border::join(groups, &self.settings);
        cut.cells
            .par_iter()
            .map(|&cell| {
                let lights = match cell {
                    CellId::Aperture { light, path } => {
                        self.apertures[light as usize].lights(path, self.settings.lights_per_cell)
                    }
                    CellId::Octree(cell) => groups
                        .get(&cell)
                        .map_or_else(Vec::new, |g| g.lights(self.octree.scale(), &self.settings)),
                };
                Selected { cell, lights }
            })
            .collect()
    }
}

impl Forest for Clusters {
    type Id = CellId;

    fn roots(&self) -> Vec<CellId> {
        let apertures =
            (0..self.apertures.len() as u32).map(|light| CellId::Aperture { light, path: 1 });
        apertures
            .chain(self.octree.roots().map(|(cell, _)| CellId::Octree(cell)))
            .collect()
    }

    fn children(&self, id: &CellId) -> Vec<CellId> {
        match *id {
            CellId::Aperture { light, path } => {
                let parts = self.apertures[light as usize]
                    .node(path)
                    .map_or(0, |n| n.parts() as u64);
                (0..parts)
                    .map(|part| CellId::Aperture {
                        light,
                        path: path << 1 | part,
                    })
                    .collect()
            }
            CellId::Octree(cell) => {
                let node = self.octree.node(&cell);
                node.into_iter()
                    .flat_map(|n| n.children())
                    .map(|(octant, _)| CellId::Octree(cell.child(octant)))
                    .collect()
            }
        }
    }

    fn parent(&self, id: &CellId) -> Option<CellId> {
        match *id {
            CellId::Aperture { light, path } => (path > 1).then_some(CellId::Aperture {
                light,
                path: path >> 1,
            }),
            CellId::Octree(cell) => cell.parent().map(CellId::Octree),
        }
    }

    fn key(&self, id: &CellId) -> u64 {
        match id {
            CellId::Aperture { light, path } => self.apertures[*light as usize]
                .node(*path)
                .map_or(0, |n| n.key()),
            CellId::Octree(cell) => self.octree.node(cell).map_or(0, |n| n.sums().key),
        }
    }

    fn depth(&self, id: &CellId) -> u32 {
        match id {
            CellId::Aperture { path, .. } => 63 - path.leading_zeros(),
            CellId::Octree(cell) => u32::from(cell.level),
        }
    }

    fn scale(&self) -> f64 {
        let flux = Vec3::splat(self.flux as f32);
        self.octree.scale().units(flux)[0] as f64
    }
}

//! What stands for the light: an octree over the VPLs, the cells selected from it, and the virtual lights made from each.

pub mod aperture;
pub mod balance;
mod border;
pub mod cell;
pub mod evaluate;
pub mod facet;
pub mod invalid;
pub mod octree;
pub mod polygon;
pub mod similarity;
mod starts;
pub mod sums;
pub mod wanted;
#[cfg(test)]
mod wanted_tests;

use std::collections::{BTreeMap, BTreeSet};

use arrayvec::ArrayVec;
use glam::{Affine3A, Vec3};
use rayon::prelude::*;

use crate::scene::Scene;
use crate::transport::Differences;
use crate::transport::Emission;
use crate::transport::emission::Emitter;
use crate::transport::paths::{PathSet, PathSettings, emitters};

use aperture::ApertureTree;
pub use balance::{Budget, Cut, Forest};
use border::Border;
pub use cell::Cell;
pub use invalid::Ledger;
pub use octree::Octree;
use similarity::Groups;
pub use similarity::SimilaritySettings;
pub use sums::FluxScale;
pub use wanted::Wanted;

/// A light that the GPU accumulates into the lightmap with one shadow map.
#[derive(Clone, Debug, PartialEq)]
pub struct VirtualLight {
    /// Geometry of the emitter.
    pub shape: Shape,
    /// Where visibility is evaluated from, world space. Unused for directional lights.
    pub position: Vec3,
    /// Unit vector the emitter faces (polygon, disk) or aims along (spot, directional).
    pub normal: Vec3,
    /// Of indirect light, the unit normal of the surface that the position lies on, which hides what is behind it; of direct
    /// light, the normal. What stands for many VPLs faces as they do in the mean, which any of them changes; what it sees
    /// depends on the position and this alone.
    pub surface: Vec3,
    /// Polygon, disk: radiant flux in lumens. Point, spot: candela. Directional: lux.
    pub flux: Vec3,
    /// Comes straight from a light source: gets the finer shadow map.
    pub direct: bool,
}

impl VirtualLight {
    /// Whether another light is this one, but for its flux.
    pub(crate) fn is_dimmed(&self, other: &Self) -> bool {
        let at = |light: &Self| (light.position, light.normal, light.surface, light.direct);
        at(self) == at(other) && self.shape == other.shape
    }

    /// Whether another light of an area sees the scene as this one does: the same shadows.
    pub(crate) fn sees_as(&self, other: &Self) -> bool {
        let is_area =
            |light: &Self| matches!(light.shape, Shape::Disk { .. } | Shape::Polygon { .. });
        let at = |light: &Self| (light.position, light.surface, light.direct);
        is_area(self) && is_area(other) && at(self) == at(other)
    }
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
        /// [`crate::scene::Light::id`].
        light: u32,
        /// The way from the root: a 1, then a bit for each step, 0 for the first part.
        path: u64,
    },
    /// VPLs.
    Octree(Cell),
}

impl std::fmt::Display for CellId {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            CellId::Aperture { light, path } => write!(f, "light {light}/{path:b}"),
            CellId::Octree(Cell { level, index }) => {
                write!(f, "cell {level}/{}/{}/{}", index[0], index[1], index[2])
            }
        }
    }
}

/// A selected cell and what stands for its light.
#[derive(Clone, Debug, PartialEq)]
pub struct Selected {
    /// The cell.
    pub cell: CellId,
    /// Its virtual lights; none if its VPLs joined a neighbour's polygon, or are all dark.
    pub lights: Vec<VirtualLight>,
    /// Fingerprints of the VPLs that its lights stand for, ascending: those of its places but for what left them in the border
    /// step, and what came instead. Where cells are exchanged for others, each VPL's flux goes from one to another at once.
    pub vpls: Vec<u64>,
}

/// Without those that shine no more: what a lamp that is switched off leaves of its cells.
fn bright(mut lights: Vec<VirtualLight>) -> Vec<VirtualLight> {
    lights.retain(|light| light.flux != Vec3::ZERO);
    lights
}

/// All light of a scene, direct and bounced, in trees that can be cut at any level of detail.
#[derive(Clone, Debug)]
pub struct Clusters {
    /// Over all VPLs.
    pub octree: Octree,
    /// By light, each with the octree's version in which it was made for its light; on the paths only its depth depends.
    apertures: BTreeMap<u32, (u64, ApertureTree)>,
    settings: SimilaritySettings,
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
        let span = tracing::debug_span!("aperture trees").entered();
        let apertures: BTreeMap<_, _> = emitters(scene)
            .par_iter()
            .zip(&scene.lights)
            .filter_map(|(emitter, light)| {
                let paths = paths.lights.get(&light.id())?;
                Some((light.id(), (0, ApertureTree::new(light, emitter, paths))))
            })
            .collect();
        drop(span);
        Self {
            octree: tracing::debug_span!("octree").in_scope(|| Octree::build(scale, paths.vpls())),
            apertures,
            settings,
        }
    }

    fn aperture(&self, light: u32, path: u64) -> Option<&aperture::ApertureNode> {
        self.apertures.get(&light)?.1.node(path)
    }

    /// What stands for a part of an aperture.
    fn direct(&self, cell: CellId) -> Selected {
        let lights = match cell {
            CellId::Aperture { light, path } => self.aperture_lights(light, path),
            CellId::Octree(_) => Vec::new(),
        };
        Selected {
            cell,
            lights: bright(lights),
            vpls: Vec::new(),
        }
    }

    /// What stands for the VPLs of an octree cell.
    fn indirect(&self, groups: &Groups, border: &Border) -> Selected {
        Selected {
            cell: CellId::Octree(groups.cell),
            lights: bright(groups.lights(border, self.octree.scale(), &self.settings)),
            vpls: border.holds(groups),
        }
    }

    /// Takes in what [`crate::transport::validate::Validator::step`] changed; `paths` are those after it. The trees are then
    /// those of [`Self::new`].
    pub fn apply(&mut self, scene: &Scene, paths: &PathSet, differences: &Differences) {
        self.octree.begin_version();
        for vpl in &differences.removed {
            self.octree.remove(vpl);
        }
        for vpl in &differences.added {
            self.octree.add(vpl);
        }
        self.octree.revise(&differences.revised);
        let version = self.octree.version();
        let changed: BTreeSet<u32> = differences.lights.iter().map(|l| l.light).collect();
        for emission in &differences.emissions {
            if let Some((_, tree)) = self.apertures.get_mut(&emission.light)
                && !changed.contains(&emission.light)
            {
                tree.change(emission);
            }
        }
        for (index, light) in scene.lights.iter().enumerate() {
            if !changed.contains(&light.id()) {
                continue;
            }
            if let Some(paths) = paths.lights.get(&light.id()) {
                let tree = ApertureTree::new(light, &Emitter::new(scene, index), paths);
                self.apertures.insert(light.id(), (version, tree));
            }
        }
        self.apertures
            .retain(|light, _| paths.lights.contains_key(light));
    }

    /// The way to the leaf of a light's tree that a path leaves from; the root for other lights.
    fn locate(&self, light: u32, emission: &Emission) -> u64 {
        self.apertures
            .get(&light)
            .map_or(1, |a| a.1.locate(emission))
    }

    fn aperture_lights(&self, light: u32, path: u64) -> Vec<VirtualLight> {
        let tree = self.apertures.get(&light);
        tree.map_or_else(Vec::new, |t| {
            t.1.lights(path, self.settings.lights_per_cell)
        })
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
            .filter_map(|&cell| match cell {
                CellId::Aperture { .. } => Some(self.direct(cell)),
                CellId::Octree(cell) => {
                    let (groups, border) = groups.get(&cell)?;
                    Some(self.indirect(groups, border))
                }
            })
            .collect()
    }
}

impl Forest for Clusters {
    type Id = CellId;

    fn roots(&self) -> Vec<CellId> {
        let apertures = self
            .apertures
            .keys()
            .map(|&light| CellId::Aperture { light, path: 1 });
        apertures
            .chain(self.octree.roots().map(|(cell, _)| CellId::Octree(cell)))
            .collect()
    }

    fn children(&self, id: &CellId) -> Vec<CellId> {
        match *id {
            CellId::Aperture { light, path } => {
                let parts = self.aperture(light, path).map_or(0, |n| n.parts() as u64);
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
            CellId::Aperture { light, path } => self.aperture(*light, *path).map_or(0, |n| n.key()),
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
        let apertures: u64 = self
            .apertures
            .values()
            .filter_map(|a| a.1.node(1))
            .map(|n| n.contribution())
            .sum();
        (apertures + self.octree.total().contribution) as f64
    }
}

#[cfg(test)]
mod tests;

//! The tree over a light's aperture (IBGI section 4.1, "Direct Virtual Lights"): emissive triangles merged to convex facets,
//! halved along their longest extent as far as the balancing metric may want to go.

use std::collections::BTreeMap;

use glam::Vec3;

use super::facet::{Facet, extent, facet_lights, merge};
use super::octree::FluxScale;
use super::{Shape, VirtualLight};
use crate::scene::{Aperture, Light};
use crate::transport::emission::{Emitter, Piece, mean};
use crate::transport::paths::LightPaths;

/// A facet with fewer paths than this is not cut further: its key would be noise.
const MIN_PATHS: usize = 16;
/// A facet is halved at most this often.
const MAX_CUTS: u32 = 10;
/// Direct light is sharper than bounced light, and errors in it are seen first: its keys count this much more.
const DIRECT_WEIGHT: f32 = 4.0;

/// A node of an aperture's tree.
#[derive(Clone, Debug, PartialEq)]
pub struct ApertureNode {
    key: u64,
    contribution: u64,
    facets: Vec<Facet>,
    children: Vec<ApertureNode>,
}

/// The tree of one light.
#[derive(Clone, Debug, PartialEq)]
pub struct ApertureTree {
    root: ApertureNode,
    /// What stands for a light without extent.
    single: Option<VirtualLight>,
}

/// A path's start on a facet: position, and how its first hit weighs in the metric.
#[derive(Clone, Copy)]
struct Start {
    position: Vec3,
    facet: u32,
    distance: f32,
    albedo: f32,
}

impl ApertureTree {
    /// The tree of a light, whose paths feed the metric.
    pub fn new(light: &Light, emitter: &Emitter, paths: &LightPaths, scale: &FluxScale) -> Self {
        let leaf = ApertureNode {
            key: 0,
            contribution: 0,
            facets: Vec::new(),
            children: Vec::new(),
        };
        if let Some(single) = punctual(light) {
            return Self {
                root: leaf,
                single: Some(single),
            };
        }
        let (facets, of_piece) = merge(emitter.pieces());
        let starts = link(emitter.pieces(), &of_piece, facets.len(), paths);
        // The back sides of double-sided facets come after all fronts.
        let mut sides = facets.clone();
        let mut index_of_back = BTreeMap::new();
        let mut double_sided = vec![false; facets.len()];
        for (piece, &facet) in emitter.pieces().iter().zip(&of_piece) {
            double_sided[facet as usize] = piece.double_sided;
        }
        for (i, facet) in facets.iter().enumerate() {
            if double_sided[i] {
                index_of_back.insert(i as u32, sides.len() as u32);
                let vertices = facet.vertices.iter().rev().copied().collect();
                sides.push(Facet {
                    vertices,
                    normal: -facet.normal,
                    radiance: facet.radiance,
                });
            }
        }
        let starts = starts
            .into_iter()
            .map(|(start, back)| Start {
                facet: if back {
                    index_of_back
                        .get(&start.facet)
                        .copied()
                        .unwrap_or(start.facet)
                } else {
                    start.facet
                },
                ..start
            })
            .collect();
        let energy = paths.paths.len().max(1) as f32;
        let flux = mean(emitter.flux) / energy;
        let indices = (0..sides.len() as u32).collect();
        Self {
            root: Builder {
                sides: &sides,
                flux,
                scale,
            }
            .node(indices, starts, f64::INFINITY),
            single: None,
        }
    }

    /// The node at the end of a path from the root: bits after the highest set one, 0 for the first part.
    pub fn node(&self, path: u64) -> Option<&ApertureNode> {
        let steps = 63 - path.leading_zeros();
        (0..steps).rev().try_fold(&self.root, |node, step| {
            node.children.get((path >> step & 1) as usize)
        })
    }

    /// The virtual lights of a node, exact in flux: a facet as itself, more facets as one polygon where they fill one,
    /// else as up to `k` disks by direction.
    pub fn lights(&self, path: u64, k: usize) -> Vec<VirtualLight> {
        match (&self.single, self.node(path)) {
            (Some(single), _) => vec![single.clone()],
            (None, Some(node)) => facet_lights(&node.facets, k),
            (None, None) => Vec::new(),
        }
    }
}

impl ApertureNode {
    /// The balancing metric, in units of [`FluxScale`].
    pub fn key(&self) -> u64 {
        self.key
    }

    /// Flux times albedo met, the key of an aperture without end, in units of [`FluxScale`].
    pub fn contribution(&self) -> u64 {
        self.contribution
    }

    /// Number of parts, 0 or 2.
    pub fn parts(&self) -> usize {
        self.children.len()
    }
}

struct Builder<'a> {
    sides: &'a [Facet],
    /// Lumens a path.
    flux: f32,
    scale: &'a FluxScale,
}

impl Builder<'_> {
    /// Key and contribution.
    fn weigh(&self, starts: &[Start], radius: f64) -> [u64; 2] {
        let sum = |flux: f32, near: &dyn Fn(&Start) -> f64| {
            starts
                .iter()
                .map(|s| self.scale.key(flux, s.albedo, near(s)))
                .sum()
        };
        let near = |s: &Start| f64::from(s.distance) / radius;
        [
            sum(self.flux * DIRECT_WEIGHT, &near),
            sum(self.flux, &|_| 0.0),
        ]
    }

    /// Several facets: halves at the middle of their centres along the major extent.
    fn node(&self, facets: Vec<u32>, starts: Vec<Start>, radius: f64) -> ApertureNode {
        let list = |facets: &[u32]| {
            facets
                .iter()
                .map(|&f| self.sides[f as usize].clone())
                .collect::<Vec<_>>()
        };
        if let [facet] = facets[..] {
            return self.piece(self.sides[facet as usize].clone(), starts, radius, MAX_CUTS);
        }
        let radius = extent(
            facets
                .iter()
                .flat_map(|&f| &self.sides[f as usize].vertices),
        )
        .min(radius);
        let [key, contribution] = self.weigh(&starts, radius);
        let centers: Vec<Vec3> = facets
            .iter()
            .map(|&f| self.sides[f as usize].center())
            .collect();
        let lo = centers.iter().fold(Vec3::INFINITY, |a, &b| a.min(b));
        let hi = centers.iter().fold(Vec3::NEG_INFINITY, |a, &b| a.max(b));
        let axis = (hi - lo).max_position();
        let middle = (lo[axis] + hi[axis]) * 0.5;
        let mut first: Vec<u32> = (0..facets.len())
            .filter(|&i| centers[i][axis] <= middle)
            .map(|i| facets[i])
            .collect();
        if first.len() == facets.len() {
            // All centres in one place, as those of the two sides of a facet.
            first.truncate(facets.len() / 2);
        }
        let second: Vec<u32> = facets
            .iter()
            .copied()
            .filter(|f| first.binary_search(f).is_err())
            .collect();
        let content = list(&facets);
        if facets.is_empty() || starts.len() < MIN_PATHS {
            return ApertureNode {
                key,
                contribution,
                facets: content,
                children: Vec::new(),
            };
        }
        let (a, b): (Vec<Start>, Vec<Start>) = starts
            .into_iter()
            .partition(|s| first.binary_search(&s.facet).is_ok());
        let children = vec![self.node(first, a, radius), self.node(second, b, radius)];
        ApertureNode {
            key,
            contribution,
            facets: content,
            children,
        }
    }

    fn piece(&self, facet: Facet, starts: Vec<Start>, radius: f64, cuts: u32) -> ApertureNode {
        let radius = extent(facet.vertices.iter()).min(radius);
        let [key, contribution] = self.weigh(&starts, radius);
        let mut children = Vec::new();
        if cuts > 0
            && starts.len() >= MIN_PATHS
            && let Some(([first, second], (axis, middle))) = facet.halves()
        {
            let (a, b): (Vec<Start>, Vec<Start>) = starts
                .into_iter()
                .partition(|s| s.position.dot(axis) <= middle);
            children = vec![
                self.piece(first, a, radius, cuts - 1),
                self.piece(second, b, radius, cuts - 1),
            ];
        }
        ApertureNode {
            key,
            contribution,
            facets: vec![facet],
            children,
        }
    }
}

/// Points, spots and suns are one light each.
fn punctual(light: &Light) -> Option<VirtualLight> {
    let shape = match light.aperture {
        Aperture::Point => Shape::Point,
        Aperture::Spot { inner, outer } => Shape::Spot { inner, outer },
        Aperture::Directional => Shape::Directional {
            frame: light.transform,
        },
        Aperture::Surface { .. } => return None,
    };
    Some(VirtualLight {
        shape,
        position: light.transform.translation.into(),
        normal: -Vec3::from(light.transform.matrix3.z_axis).normalize(),
        flux: light.intensity,
        direct: true,
    })
}

/// Which facet each path left, and whether from its back.
fn link(
    pieces: &[Piece],
    of_piece: &[u32],
    facets: usize,
    paths: &LightPaths,
) -> Vec<(Start, bool)> {
    let mut of_triangle: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (i, piece) in pieces.iter().enumerate() {
        of_triangle.entry(piece.triangle).or_default().push(i);
    }
    let center = |i: usize| pieces[i].corners.iter().sum::<Vec3>() / 3.0;
    let emissions = paths.paths.iter().map(|p| &p.emission);
    let starts = emissions.filter_map(|e| {
        let candidates = of_triangle.get(&e.triangle)?;
        let distance = |i: usize| center(i).distance_squared(e.position);
        let &piece = candidates
            .iter()
            .min_by(|&&a, &&b| distance(a).total_cmp(&distance(b)))?;
        let start = Start {
            position: e.position,
            facet: of_piece[piece],
            distance: e.scatter.distance,
            albedo: e.scatter.albedo,
        };
        (start.distance.is_finite() && (start.facet as usize) < facets)
            .then_some((start, e.normal.dot(pieces[piece].normal) < 0.0))
    });
    starts.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::Shape;
    use crate::scene::Material;
    use crate::transport::bvh::SceneBvh;
    use crate::transport::paths::{PathSettings, trace};
    use crate::transport::testing::{add_quads, box_quads, light, material, quad, room};
    use glam::Affine3A;

    fn tree(quads: &[[Vec3; 4]], material: Material) -> (ApertureTree, Emitter) {
        let mut scene = room(0.5);
        add_quads(&mut scene, quads, material);
        let bvh = SceneBvh::build(&scene);
        let settings = PathSettings::for_paths(&scene, 2000);
        let paths = trace(&scene, &bvh, &settings);
        let emitter = Emitter::new(&scene, 0);
        let scale = FluxScale::new(settings.flux_per_path);
        (
            ApertureTree::new(&scene.lights[0], &emitter, &paths.lights[&3], &scale),
            emitter,
        )
    }

    fn lamp(double_sided: bool) -> Material {
        material(Vec3::ZERO, Vec3::new(3.0, 2.0, 1.0), double_sided)
    }

    /// Every node's lights carry its exact flux, its parts' as well, and keys fall.
    fn check(tree: &ApertureTree, path: u64, flux: Vec3) -> usize {
        let node = tree.node(path).expect("a node");
        let sum = |path: u64| tree.lights(path, 4).iter().map(|l| l.flux).sum::<Vec3>();
        assert!(
            (sum(path) - flux).abs().max_element() < 1e-4 * flux.x,
            "{path:b}: {} {flux}",
            sum(path)
        );
        if node.parts() == 0 {
            return 1;
        }
        let parts = [path << 1, path << 1 | 1];
        assert!(
            (parts.map(sum).iter().sum::<Vec3>() - flux)
                .abs()
                .max_element()
                < 1e-4 * flux.x
        );
        parts
            .iter()
            .map(|&p| {
                assert!(tree.node(p).expect("a part").key() <= node.key());
                check(tree, p, sum(p))
            })
            .sum()
    }

    #[test]
    fn a_rectangle_is_one_polygon_and_splits_into_rectangles() {
        let (tree, emitter) = tree(
            &[quad(Vec3::new(-0.5, 0.9, -0.1), Vec3::X, Vec3::Z * 0.2)],
            lamp(false),
        );
        let root = tree.lights(1, 4);
        let [
            VirtualLight {
                shape: Shape::Polygon { vertices },
                ..
            },
        ] = &root[..]
        else {
            panic!("{root:?}")
        };
        assert_eq!(vertices.len(), 4);
        assert!(check(&tree, 1, emitter.flux) > 16);
        for path in [0b10, 0b111, 0b10101] {
            let [
                VirtualLight {
                    shape: Shape::Polygon { vertices },
                    normal,
                    direct: true,
                    ..
                },
            ] = &tree.lights(path, 4)[..]
            else {
                panic!("not one polygon");
            };
            assert!(vertices.len() == 4 && normal.y < -0.99);
        }
        assert!(tree.node(1 << 20).is_none() && tree.lights(1 << 20, 4).is_empty());
    }

    #[test]
    fn boxes_and_two_sides_keep_their_flux() {
        let crate_ = box_quads(Vec3::splat(-0.2), Vec3::splat(0.2), false);
        let (faces, emitter) = tree(&crate_, lamp(false));
        assert_eq!(faces.root.facets.len(), 6);
        check(&faces, 1, emitter.flux);
        assert!(faces.lights(1, 4).len() <= 4);
        let (both, emitter) = tree(
            &[quad(Vec3::ZERO, Vec3::X * 0.5, Vec3::Y * 0.5)],
            lamp(true),
        );
        check(&both, 1, emitter.flux);
        let normals: Vec<Vec3> = both.lights(1, 4).iter().map(|l| l.normal).collect();
        assert_eq!(normals, [Vec3::Z, -Vec3::Z]);
    }

    #[test]
    fn grids_merge_and_notches_stay() {
        let tile = |x: u32, y: u32| {
            quad(
                Vec3::new(x as f32 * 0.25, y as f32 * 0.25, 0.0),
                Vec3::X * 0.25,
                Vec3::Y * 0.25,
            )
        };
        let grid: Vec<_> = (0..9).map(|i| tile(i % 3, i / 3)).collect();
        assert_eq!(tree(&grid, lamp(false)).0.root.facets.len(), 1);
        let notched: Vec<_> = (0..8).map(|i| tile(i % 3, i / 3)).collect();
        let (notched, emitter) = tree(&notched, lamp(false));
        assert_eq!(notched.root.facets.len(), 2);
        check(&notched, 1, emitter.flux);
    }

    #[test]
    fn punctual_lights_are_themselves() {
        let mut scene = room(0.5);
        let aim = Affine3A::from_rotation_x(-1.0);
        scene.lights.push(light(
            Aperture::Spot {
                inner: 0.1,
                outer: 0.2,
            },
            Vec3::new(1.0, 2.0, 3.0),
            aim,
        ));
        let emitter = Emitter::new(&scene, 0);
        let tree = ApertureTree::new(
            &scene.lights[0],
            &emitter,
            &LightPaths::default(),
            &FluxScale::new(1.0),
        );
        let [spot] = &tree.lights(1, 4)[..] else {
            panic!("not one light")
        };
        assert_eq!(
            (&spot.shape, spot.flux),
            (
                &Shape::Spot {
                    inner: 0.1,
                    outer: 0.2
                },
                Vec3::new(1.0, 2.0, 3.0)
            )
        );
        assert!((spot.normal - aim.transform_vector3(Vec3::NEG_Z)).length() < 1e-6);
        assert_eq!(tree.node(1).map(|n| (n.key(), n.parts())), Some((0, 0)));
    }
}

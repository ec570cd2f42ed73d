//! The tree over a light's aperture (IBGI section 4.1, "Direct Virtual Lights"): emissive triangles merged to convex facets,
//! halved along their longest extent as far as the balancing metric may want to go.

use glam::Vec3;

use super::facet::{Facet, extent, facet_lights};
use super::octree::FluxScale;
use super::starts::{Linker, Start};
use super::{Shape, VirtualLight};
use crate::scene::{Aperture, Light};
use crate::transport::Emission;
use crate::transport::emission::Emitter;
use crate::transport::paths::LightPaths;
use crate::transport::validate::EmissionChange;

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
    /// Into [`Linker::sides`], ascending: of the facets, or of the one that this is a piece of.
    numbers: Vec<u32>,
    /// How often a piece may be halved.
    cuts: u32,
    radius: f64,
    /// Paths that met a surface.
    count: usize,
    content: Content,
}

#[derive(Clone, Debug, PartialEq)]
enum Content {
    /// The paths, in order.
    Leaf(Vec<Start>),
    Halves(Rule, Box<[ApertureNode; 2]>),
}

/// Which starts go to the first half.
#[derive(Clone, Debug, PartialEq)]
enum Rule {
    /// Those on these facets.
    Facets(Vec<u32>),
    /// Those up to this far along an axis.
    Plane(Vec3, f32),
}

/// The tree of one light: a pure function of the light and the set of its paths.
#[derive(Clone, Debug, PartialEq)]
pub struct ApertureTree {
    root: ApertureNode,
    /// None for a light without extent.
    linker: Option<Linker>,
    /// What stands for a light without extent.
    single: Option<VirtualLight>,
    scale: FluxScale,
}

impl ApertureTree {
    /// The tree of a light, whose paths feed the metric.
    pub fn new(light: &Light, emitter: &Emitter, paths: &LightPaths, scale: &FluxScale) -> Self {
        let single = punctual(light);
        let linker = single.is_none().then(|| Linker::new(emitter.pieces()));
        let starts = linker.iter().flat_map(|linker| {
            let paths = paths.paths.iter().zip(0..);
            paths.filter_map(|(p, i)| linker.start(i, &p.emission))
        });
        let numbers = (0..linker.iter().map(|l| l.sides().len() as u32).sum()).collect();
        let builder = Builder {
            sides: linker.as_ref().map_or(&[], |l| l.sides()),
            scale,
        };
        Self {
            root: builder.node(numbers, starts.collect(), f64::INFINITY),
            single,
            linker,
            scale: *scale,
        }
    }

    /// Takes in that a path starts otherwise than before, or met something else, while the light is the same.
    pub fn change(&mut self, change: &EmissionChange) {
        let Some(linker) = &self.linker else { return };
        let builder = Builder {
            sides: linker.sides(),
            scale: &self.scale,
        };
        let start = |e: &Option<Emission>| linker.start(change.path, e.as_ref()?);
        if let Some(old) = start(&change.old) {
            builder.remove(&mut self.root, &old);
        }
        if let Some(new) = start(&change.new) {
            builder.add(&mut self.root, new);
        }
    }

    /// The node at the end of a path from the root: bits after the highest set one, 0 for the first part.
    pub fn node(&self, path: u64) -> Option<&ApertureNode> {
        let steps = 63 - path.leading_zeros();
        (0..steps)
            .rev()
            .try_fold(&self.root, |node, step| match &node.content {
                Content::Leaf(_) => None,
                Content::Halves(_, parts) => Some(&parts[(path >> step & 1) as usize]),
            })
    }

    /// The way to the leaf that a path leaves from.
    pub fn locate(&self, emission: &Emission) -> u64 {
        let start = self.linker.as_ref().and_then(|l| l.locate(0, emission));
        let (mut way, mut node) = (1, &self.root);
        while let (Some(start), Content::Halves(rule, parts)) = (&start, &node.content) {
            let half = rule.half(start);
            way = way << 1 | half as u64;
            node = &parts[half];
        }
        way
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
        match self.content {
            Content::Leaf(_) => 0,
            Content::Halves(..) => 2,
        }
    }

    fn collect(&mut self, all: &mut Vec<Start>) {
        match &mut self.content {
            Content::Leaf(starts) => all.append(starts),
            Content::Halves(_, parts) => parts.iter_mut().for_each(|p| p.collect(all)),
        }
    }
}

impl Rule {
    fn half(&self, start: &Start) -> usize {
        let first = match self {
            Self::Facets(first) => first.binary_search(&start.facet).is_ok(),
            Self::Plane(axis, middle) => start.position.dot(*axis) <= *middle,
        };
        usize::from(!first)
    }
}

struct Builder<'a> {
    sides: &'a [Facet],
    scale: &'a FluxScale,
}

impl Builder<'_> {
    /// A start's part of a node's key and contribution.
    fn weigh(&self, start: &Start, radius: f64) -> [u64; 2] {
        let flux = self.scale.flux_per_path() as f32;
        let key = |flux, near| self.scale.key(flux, start.albedo, near);
        [
            key(flux * DIRECT_WEIGHT, f64::from(start.distance) / radius),
            key(flux, 0.0),
        ]
    }

    /// Several facets, or one that can be cut into pieces.
    fn node(&self, numbers: Vec<u32>, starts: Vec<Start>, radius: f64) -> ApertureNode {
        let facets = numbers.iter().map(|&n| self.sides[n as usize].clone());
        self.make(facets.collect(), numbers, MAX_CUTS, starts, radius)
    }

    fn make(
        &self,
        facets: Vec<Facet>,
        numbers: Vec<u32>,
        cuts: u32,
        starts: Vec<Start>,
        radius: f64,
    ) -> ApertureNode {
        let radius = extent(facets.iter().flat_map(|f| &f.vertices)).min(radius);
        let sums = starts.iter().map(|s| self.weigh(s, radius));
        let [key, contribution] = sums.fold([0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        let mut node = ApertureNode {
            key,
            contribution,
            facets,
            numbers,
            cuts,
            radius,
            count: starts.len(),
            content: Content::Leaf(starts),
        };
        self.split(&mut node);
        node
    }

    /// Halves a leaf that has paths enough.
    fn split(&self, node: &mut ApertureNode) {
        let Content::Leaf(starts) = &mut node.content else {
            return;
        };
        if starts.len() < MIN_PATHS {
            return;
        }
        let starts = std::mem::take(starts);
        let apart = |rule: &Rule, starts: Vec<Start>| -> [Vec<Start>; 2] {
            let (a, b) = starts.into_iter().partition(|s| rule.half(s) == 0);
            [a, b]
        };
        node.content = if node.numbers.len() > 1 {
            let [first, second] = self.halves(&node.numbers);
            let rule = Rule::Facets(first.clone());
            let [a, b] = apart(&rule, starts);
            let (a, b) = both(
                node.count,
                || self.node(first, a, node.radius),
                || self.node(second, b, node.radius),
            );
            Content::Halves(rule, Box::new([a, b]))
        } else if let ([facet], 1..) = (&node.facets[..], node.cuts)
            && let Some(([first, second], (axis, middle))) = facet.halves()
        {
            let rule = Rule::Plane(axis, middle);
            let [a, b] = apart(&rule, starts);
            let piece = |facet, starts| {
                let cuts = node.cuts - 1;
                self.make(vec![facet], node.numbers.clone(), cuts, starts, node.radius)
            };
            let (a, b) = both(node.count, || piece(first, a), || piece(second, b));
            Content::Halves(rule, Box::new([a, b]))
        } else {
            Content::Leaf(starts)
        };
    }

    /// Several facets: halves at the middle of their centres along the major extent.
    fn halves(&self, numbers: &[u32]) -> [Vec<u32>; 2] {
        let centers: Vec<Vec3> = numbers
            .iter()
            .map(|&n| self.sides[n as usize].center())
            .collect();
        let lo = centers.iter().fold(Vec3::INFINITY, |a, &b| a.min(b));
        let hi = centers.iter().fold(Vec3::NEG_INFINITY, |a, &b| a.max(b));
        let axis = (hi - lo).max_position();
        let middle = (lo[axis] + hi[axis]) * 0.5;
        let mut first: Vec<u32> = (0..numbers.len())
            .filter(|&i| centers[i][axis] <= middle)
            .map(|i| numbers[i])
            .collect();
        if first.len() == numbers.len() {
            // All centres in one place, as those of the two sides of a facet.
            first.truncate(numbers.len() / 2);
        }
        let second = numbers
            .iter()
            .copied()
            .filter(|n| first.binary_search(n).is_err())
            .collect();
        [first, second]
    }

    fn add(&self, node: &mut ApertureNode, start: Start) {
        let [key, contribution] = self.weigh(&start, node.radius);
        node.key += key;
        node.contribution += contribution;
        node.count += 1;
        match &mut node.content {
            Content::Leaf(starts) => {
                let place = starts.partition_point(|s| s.path < start.path);
                starts.insert(place, start);
                self.split(node);
            }
            Content::Halves(rule, parts) => self.add(&mut parts[rule.half(&start)], start),
        }
    }

    /// The start must be in the tree.
    fn remove(&self, node: &mut ApertureNode, start: &Start) {
        let [key, contribution] = self.weigh(start, node.radius);
        node.key -= key;
        node.contribution -= contribution;
        node.count -= 1;
        match &mut node.content {
            Content::Leaf(starts) => starts.retain(|s| s.path != start.path),
            Content::Halves(rule, parts) => self.remove(&mut parts[rule.half(start)], start),
        }
        if node.parts() > 0 && node.count < MIN_PATHS {
            let mut starts = Vec::with_capacity(node.count);
            node.collect(&mut starts);
            starts.sort_unstable_by_key(|s| s.path);
            node.content = Content::Leaf(starts);
        }
    }
}

/// Both results, worked out side by side where there is much to do.
fn both<A: Send, B: Send>(
    count: usize,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    if count > 4096 {
        rayon::join(a, b)
    } else {
        (a(), b())
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
    fn changed_paths_leave_the_tree_of_a_new_one() {
        let crate_ = box_quads(Vec3::splat(-0.2), Vec3::splat(0.2), false);
        let mut scene = room(0.5);
        add_quads(&mut scene, &crate_, lamp(true));
        let bvh = SceneBvh::build(&scene);
        let settings = PathSettings::for_paths(&scene, 700);
        let all = trace(&scene, &bvh, &settings).lights[&3].clone();
        let emitter = Emitter::new(&scene, 0);
        let scale = FluxScale::new(settings.flux_per_path);
        let build =
            |paths: &LightPaths| ApertureTree::new(&scene.lights[0], &emitter, paths, &scale);
        let mut paths = all.clone();
        let mut tree = build(&paths);
        // Most go dark, one after the other, then come back in another order with something nearer, or at all.
        let order: Vec<usize> = (0..all.paths.len())
            .map(|i| i * 311 % all.paths.len())
            .collect();
        for (step, &i) in order.iter().chain(order.iter().rev()).enumerate() {
            let old = paths.paths[i].emission;
            let mut new = all.paths[i].emission;
            if step < order.len() {
                new.scatter.distance = f32::INFINITY;
            } else if i % 2 == 0 {
                new.scatter.distance *= 0.5;
            }
            paths.paths[i].emission = new;
            tree.change(&EmissionChange {
                light: 3,
                path: i as u32,
                old: Some(old),
                new: Some(new),
            });
            if step % 100 == 0 {
                assert_eq!(tree, build(&paths));
            }
        }
        assert_eq!(tree, build(&paths));
        let mut found = 0;
        for path in &all.paths {
            let way = tree.locate(&path.emission);
            let leaf = tree.node(way).expect("a leaf");
            assert_eq!(leaf.parts(), 0);
            let Content::Leaf(starts) = &leaf.content else {
                continue;
            };
            found += usize::from(starts.iter().any(|s| s.position == path.emission.position));
        }
        assert_eq!(found, tree.root.count);
        assert_ne!(tree, build(&all));
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

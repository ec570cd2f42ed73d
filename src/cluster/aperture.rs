//! The tree over a light's aperture (IBGI section 4.1, "Direct Virtual Lights"): emissive triangles merged to convex facets,
//! halved along their longest extent as far as the balancing metric may want to go.

use glam::Vec3;

use super::facet::{Facet, extent, facet_lights};
use super::starts::{Linker, Start};
use super::sums::key_of;
use super::{Shape, VirtualLight};
use crate::scene::{Aperture, Light};
use crate::transport::Emission;
use crate::transport::EmissionChange;
use crate::transport::emission::Emitter;
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
    /// Of a path ([`LightPaths::weight`]).
    weight: f32,
}

impl ApertureTree {
    /// The tree of a light, whose paths feed the metric.
    pub fn new(light: &Light, emitter: &Emitter, paths: &LightPaths) -> Self {
        let single = punctual(light);
        let linker = single.is_none().then(|| Linker::new(emitter.pieces()));
        let starts = linker.iter().flat_map(|linker| {
            let paths = paths.paths.iter().zip(0..);
            paths.filter_map(|(p, i)| linker.start(i, &p.emission))
        });
        let numbers = (0..linker.iter().map(|l| l.sides().len() as u32).sum()).collect();
        let builder = Builder {
            sides: linker.as_ref().map_or(&[], |l| l.sides()),
            weight: paths.weight,
        };
        Self {
            root: builder.node(numbers, starts.collect(), f64::INFINITY),
            single,
            linker,
            weight: paths.weight,
        }
    }

    /// Takes in that a path starts otherwise than before, or met something else, while the light is the same.
    pub fn change(&mut self, change: &EmissionChange) {
        let Some(linker) = &self.linker else { return };
        let builder = Builder {
            sides: linker.sides(),
            weight: self.weight,
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
    /// The balancing metric ([`super::sums::Sums::key`]).
    pub fn key(&self) -> u64 {
        self.key
    }

    /// Weight times albedo met, the key of an aperture without end ([`super::sums::Sums::contribution`]).
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

/// A start's part of a node's key and contribution.
fn weigh(start: &Start, weight: f32, radius: f64) -> [u64; 2] {
    let key = |weight, near| key_of(weight, start.albedo, near);
    [
        key(weight * DIRECT_WEIGHT, f64::from(start.distance) / radius),
        key(weight, 0.0),
    ]
}

struct Builder<'a> {
    sides: &'a [Facet],
    /// Of a path.
    weight: f32,
}

impl Builder<'_> {
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
        let sums = starts.iter().map(|s| weigh(s, self.weight, radius));
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
        let [key, contribution] = weigh(&start, self.weight, node.radius);
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
        let [key, contribution] = weigh(start, self.weight, node.radius);
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
    let normal = -Vec3::from(light.transform.matrix3.z_axis).normalize();
    Some(VirtualLight {
        shape,
        position: light.transform.translation.into(),
        normal,
        surface: normal,
        flux: light.intensity,
        direct: true,
    })
}

#[cfg(test)]
mod tests;

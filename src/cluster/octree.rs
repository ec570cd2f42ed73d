//! The octree over all VPLs (IBGI section 4.1): a fixed grid, integer sums, one VPL added or removed at a time.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::cell::{Cell, MAX_LEVEL, grid, octant};
use super::sums::{FluxScale, Sums, terms};
use crate::transport::Vpl;
use revise::{Revision, Sought};

/// A node with more VPLs than this has children, down to [`MAX_LEVEL`].
pub const LEAF_CAPACITY: usize = 16;

/// A node: a leaf with its VPLs in key order, or up to eight parts.
#[derive(Clone, Debug)]
pub struct Node {
    sums: Sums,
    content: Content,
    /// As [`Node::version`] says.
    version: u64,
}

impl PartialEq for Node {
    /// When it came to be so does not matter.
    fn eq(&self, other: &Self) -> bool {
        self.sums == other.sums && self.content == other.content
    }
}

/// What all nodes of a tree share.
#[derive(Clone, Copy, Debug)]
struct Shared {
    scale: FluxScale,
    version: u64,
}

#[derive(Clone, Debug, PartialEq)]
enum Content {
    Leaf(Vec<Vpl>),
    Inner(Box<[Option<Node>; 8]>),
}

impl Node {
    /// Its sums.
    pub fn sums(&self) -> &Sums {
        &self.sums
    }

    /// The tree's version in which a VPL below was last added, removed or given another flux; that a VPL's scatter changed
    /// does not count.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Its parts with their octants; none for a leaf.
    pub fn children(&self) -> impl Iterator<Item = (usize, &Node)> {
        let parts = match &self.content {
            Content::Leaf(_) => None,
            Content::Inner(parts) => Some(parts),
        };
        parts
            .into_iter()
            .flat_map(|p| p.iter().enumerate())
            .filter_map(|(i, c)| Some((i, c.as_ref()?)))
    }

    /// Has no parts.
    pub fn is_leaf(&self) -> bool {
        matches!(self.content, Content::Leaf(_))
    }

    /// All VPLs below, in key order.
    pub fn vpls(&self) -> Vec<Vpl> {
        let mut all = Vec::with_capacity(self.sums.count as usize);
        self.collect(&mut all);
        all.sort_unstable_by_key(|v| v.key);
        all
    }

    fn collect(&self, all: &mut Vec<Vpl>) {
        match &self.content {
            Content::Leaf(vpls) => all.extend_from_slice(vpls),
            Content::Inner(parts) => parts.iter().flatten().for_each(|c| c.collect(all)),
        }
    }

    fn empty() -> Self {
        Self {
            sums: Sums::default(),
            content: Content::Leaf(Vec::new()),
            version: 0,
        }
    }

    /// Over VPLs in key order.
    fn build(vpls: Vec<Vpl>, shared: &Shared, level: u8) -> Self {
        let mut sums = Sums::default();
        vpls.iter()
            .for_each(|v| sums.add(&terms(v, &shared.scale, level)));
        let version = shared.version;
        if vpls.len() <= LEAF_CAPACITY || level == MAX_LEVEL {
            return Self {
                sums,
                content: Content::Leaf(vpls),
                version,
            };
        }
        let parallel = vpls.len() > 4096;
        let mut parts: [Vec<Vpl>; 8] = Default::default();
        for vpl in vpls {
            parts[octant(grid(vpl.position), level + 1)].push(vpl);
        }
        let make =
            |part: Vec<Vpl>| (!part.is_empty()).then(|| Self::build(part, shared, level + 1));
        let nodes: Vec<Option<Node>> = if parallel {
            parts.into_par_iter().map(make).collect()
        } else {
            parts.into_iter().map(make).collect()
        };
        let mut nodes = nodes.into_iter();
        let content = Content::Inner(Box::new(std::array::from_fn(|_| nodes.next().flatten())));
        Self {
            sums,
            content,
            version,
        }
    }

    fn add(&mut self, vpl: &Vpl, shared: &Shared, level: u8) {
        self.sums.add(&terms(vpl, &shared.scale, level));
        self.version = shared.version;
        match &mut self.content {
            Content::Inner(parts) => {
                let part = &mut parts[octant(grid(vpl.position), level + 1)];
                part.get_or_insert_with(Node::empty)
                    .add(vpl, shared, level + 1);
            }
            Content::Leaf(vpls) => {
                let place = vpls.partition_point(|v| v.key < vpl.key);
                debug_assert!(
                    vpls.get(place).is_none_or(|v| v.key != vpl.key),
                    "{:?} twice",
                    vpl.key
                );
                vpls.insert(place, *vpl);
                if vpls.len() > LEAF_CAPACITY && level < MAX_LEVEL {
                    *self = Self::build(std::mem::take(vpls), shared, level);
                }
            }
        }
    }

    /// False, and nothing changed, if the VPL is not here.
    fn remove(&mut self, vpl: &Vpl, shared: &Shared, level: u8) -> bool {
        match &mut self.content {
            Content::Leaf(vpls) => {
                let Ok(place) = vpls.binary_search_by_key(&vpl.key, |v| v.key) else {
                    return false;
                };
                if vpls[place] != *vpl {
                    return false;
                }
                vpls.remove(place);
            }
            Content::Inner(parts) => {
                let part = &mut parts[octant(grid(vpl.position), level + 1)];
                let Some(node) = part else { return false };
                if !node.remove(vpl, shared, level + 1) {
                    return false;
                }
                if node.sums.count == 0 {
                    *part = None;
                }
            }
        }
        self.sums.remove(&terms(vpl, &shared.scale, level));
        self.version = shared.version;
        if !self.is_leaf() && self.sums.count as usize <= LEAF_CAPACITY {
            self.content = Content::Leaf(self.vpls());
        }
        true
    }
}

/// The tree over all VPLs of all lights and bounces: a pure function of their set.
#[derive(Clone, Debug)]
pub struct Octree {
    shared: Shared,
    roots: BTreeMap<[i64; 3], Node>,
}

impl PartialEq for Octree {
    /// The history of a tree does not matter.
    fn eq(&self, other: &Self) -> bool {
        self.shared.scale == other.shared.scale && self.roots == other.roots
    }
}

impl Octree {
    /// An empty tree.
    pub fn new(scale: FluxScale) -> Self {
        Self {
            shared: Shared { scale, version: 0 },
            roots: BTreeMap::new(),
        }
    }

    /// Equal to adding the VPLs one by one, but faster.
    pub fn build<'a>(scale: FluxScale, vpls: impl IntoIterator<Item = &'a Vpl>) -> Self {
        let mut parts: BTreeMap<[i64; 3], Vec<Vpl>> = BTreeMap::new();
        for vpl in vpls {
            parts
                .entry(Cell::at(vpl.position, 0).index)
                .or_default()
                .push(*vpl);
        }
        let shared = Shared { scale, version: 0 };
        let roots = parts
            .into_iter()
            .map(|(index, mut vpls)| {
                if !vpls.is_sorted_by_key(|v| v.key) {
                    vpls.par_sort_unstable_by_key(|v| v.key);
                }
                (index, Node::build(vpls, &shared, 0))
            })
            .collect();
        Self { shared, roots }
    }

    /// The fixed point that all sums are in.
    pub fn scale(&self) -> &FluxScale {
        &self.shared.scale
    }

    /// The number of the present version.
    pub fn version(&self) -> u64 {
        self.shared.version
    }

    /// Begins a new version: see [`Node::version`].
    pub fn begin_version(&mut self) {
        self.shared.version += 1;
    }

    /// Adds one VPL. Its key must not be in the tree.
    pub fn add(&mut self, vpl: &Vpl) {
        let root = self.roots.entry(Cell::at(vpl.position, 0).index);
        root.or_insert_with(Node::empty).add(vpl, &self.shared, 0);
    }

    /// Removes one VPL, as it was added; false if it is not in the tree.
    pub fn remove(&mut self, vpl: &Vpl) -> bool {
        let index = Cell::at(vpl.position, 0).index;
        let Some(root) = self.roots.get_mut(&index) else {
            return false;
        };
        let removed = root.remove(vpl, &self.shared, 0);
        if root.sums.count == 0 {
            self.roots.remove(&index);
        }
        removed
    }

    /// Replaces VPLs by others that differ in their flux or their scatter alone; returns how many of them are in the tree.
    pub fn revise(&mut self, pairs: &[[Vpl; 2]]) -> usize {
        let mut sought: BTreeMap<[i64; 3], Vec<Sought>> = BTreeMap::new();
        for (pair, [old, _]) in pairs.iter().enumerate() {
            let grid = grid(old.position);
            let root = sought.entry(Cell::at(old.position, 0).index);
            root.or_default().push(Sought { grid, pair });
        }
        let by = Revision {
            pairs,
            shared: self.shared,
        };
        let roots = sought.into_iter();
        let revised = roots.filter_map(|(index, sought)| {
            Some(self.roots.get_mut(&index)?.revise(sought, &by, 0).found)
        });
        revised.sum()
    }

    /// The root cells that hold VPLs.
    pub fn roots(&self) -> impl Iterator<Item = (Cell, &Node)> {
        self.roots
            .iter()
            .map(|(&index, node)| (Cell { level: 0, index }, node))
    }

    /// The node of a cell, if it exists.
    pub fn node(&self, cell: &Cell) -> Option<&Node> {
        let root_shift = u32::from(cell.level);
        let mut node = self.roots.get(&cell.index.map(|i| i >> root_shift))?;
        for level in 1..=cell.level {
            let shift = u32::from(cell.level - level);
            let octant: usize = (0..3)
                .map(|a| ((cell.index[a] >> shift & 1) as usize) << a)
                .sum();
            match &node.content {
                Content::Leaf(_) => return None,
                Content::Inner(parts) => node = parts[octant].as_ref()?,
            }
        }
        Some(node)
    }

    /// The sums over all VPLs.
    pub fn total(&self) -> Sums {
        let mut total = Sums::default();
        self.roots.values().for_each(|r| total.add(&r.sums));
        total
    }
}

mod revise;
#[cfg(test)]
mod tests;

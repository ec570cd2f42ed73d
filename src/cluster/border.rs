//! The border step (IBGI section 4.1, "Border Handling"): VPLs left over beside a cell's face join the polygon that goes on behind it.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use rayon::prelude::*;

use super::cell::{Cell, Place};
use super::similarity::{Groups, SimilaritySettings};
use crate::transport::Vpl;

/// How near to the face a VPL must be, in sizes of the cell behind it.
const REACH: f32 = 0.1;

/// What crosses a selected cell's faces. What crosses between two cells depends on these two alone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Border {
    /// By the cell that they went to: indices into [`Groups::vpls`].
    pub to: BTreeMap<Cell, Vec<u32>>,
    /// By the cell that they came from, with the number of the plane that they join.
    pub from: BTreeMap<Cell, Vec<(u32, Vpl)>>,
}

impl Border {
    /// Indices of the VPLs that left, ascending.
    pub fn left(&self) -> Vec<u32> {
        let mut left: Vec<u32> = self.to.values().flatten().copied().collect();
        left.sort_unstable();
        left
    }

    /// The VPLs that joined a plane.
    pub fn joined(&self, plane: usize) -> impl Iterator<Item = &Vpl> {
        let all = self.from.values().flatten();
        all.filter(move |(p, _)| *p as usize == plane)
            .map(|(_, vpl)| vpl)
    }

    /// Fingerprints of the VPLs that are a cell's after the border step, ascending. A path's VPL that moved is another.
    pub fn holds(&self, groups: &Groups) -> Vec<u64> {
        let left = self.left();
        let own = (0..).zip(&groups.vpls);
        let stays = own.filter(|(i, _)| left.binary_search(i).is_err());
        let joined = self.from.values().flatten().map(|(_, vpl)| vpl);
        let mut all: Vec<u64> = stays
            .map(|(_, vpl)| vpl)
            .chain(joined)
            .map(fingerprint)
            .collect();
        all.sort_unstable();
        all
    }
}

fn fingerprint(vpl: &Vpl) -> u64 {
    let mut hasher = DefaultHasher::new();
    vpl.key.hash(&mut hasher);
    vpl.position.to_array().map(f32::to_bits).hash(&mut hasher);
    hasher.finish()
}

/// A VPL that belongs to no plane of its cell, and what lies beyond the face that is nearest to it.
#[derive(Clone, Copy, Debug)]
pub struct Stray {
    /// Into [`Groups::vpls`].
    pub index: u32,
    /// From the face, metres.
    pub distance: f32,
    /// Just behind the face.
    pub beyond: Place,
}

/// The strays of a cell.
pub fn strays(groups: &Groups) -> Vec<Stray> {
    let [lo, hi] = groups.cell.bounds();
    let step = groups.cell.size() * 1e-3;
    let stray = |&index: &u32| {
        let position = groups.vpls[index as usize].position;
        let distances = (0..6).map(|face| match face % 2 {
            0 => position[face / 2] - lo[face / 2],
            _ => hi[face / 2] - position[face / 2],
        });
        let (face, distance) = distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1))?;
        let mut beyond = position;
        beyond[face / 2] = match face % 2 {
            0 => lo[face / 2] - step,
            _ => hi[face / 2] + step,
        };
        Some(Stray {
            index,
            distance: distance.max(0.0),
            beyond: Place::at(beyond),
        })
    };
    groups.rest.iter().filter_map(stray).collect()
}

/// VPLs of one cell that join planes of another: index in the first, number of the plane in the second.
pub type Crossed = Vec<(u32, u32)>;

/// Which strays of a cell go to another selected cell, and to which of its planes: those in whose plane it has a polygon.
pub fn crossing(
    from: &Groups,
    strays: &[Stray],
    to: &Groups,
    settings: &SimilaritySettings,
) -> Crossed {
    let size = to.cell.size();
    let places = to.cell.places();
    strays
        .iter()
        .filter(|s| s.distance <= REACH * size && places.contains(&s.beyond))
        .filter_map(|s| {
            let vpl = &from.vpls[s.index as usize];
            let plane = to.planes.iter().position(|p| p.fits(vpl, size, settings))?;
            Some((s.index, plane as u32))
        })
        .collect()
}

/// The border step over all selected cells at once.
pub fn join(
    groups: Vec<(Cell, Groups)>,
    settings: &SimilaritySettings,
) -> BTreeMap<Cell, (Groups, Border)> {
    let groups: BTreeMap<Cell, Groups> = groups.into_iter().collect();
    let cells: Vec<&Groups> = groups.values().collect();
    let moves: Vec<(Cell, Cell, Crossed)> = cells
        .par_iter()
        .flat_map_iter(|from| {
            let mut beyond: BTreeMap<Cell, Vec<Stray>> = BTreeMap::new();
            for stray in strays(from) {
                let holder = stray.beyond.cells().find(|c| groups.contains_key(c));
                if let Some(cell) = holder.filter(|c| *c != from.cell) {
                    beyond.entry(cell).or_default().push(stray);
                }
            }
            let crossed = beyond.into_iter().map(|(cell, strays)| {
                let moved = crossing(from, &strays, &groups[&cell], settings);
                (from.cell, cell, moved)
            });
            crossed.collect::<Vec<_>>()
        })
        .filter(|(.., moved)| !moved.is_empty())
        .collect();
    let mut borders: BTreeMap<Cell, Border> = BTreeMap::new();
    for (from, to, moved) in moves {
        let vpl = |i: u32| groups[&from].vpls[i as usize];
        let joined = moved.iter().map(|&(i, plane)| (plane, vpl(i))).collect();
        let left = moved.iter().map(|&(i, _)| i).collect();
        borders.entry(from).or_default().to.insert(to, left);
        borders.entry(to).or_default().from.insert(from, joined);
    }
    let with_border = |(cell, groups)| (cell, (groups, borders.remove(&cell).unwrap_or_default()));
    groups.into_iter().map(with_border).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::sampling::Sequence;
    use crate::transport::{Scatter, VplKey};
    use glam::Vec3;

    fn floor_vpl(path: u32, position: Vec3) -> Vpl {
        let key = VplKey {
            light: 0,
            path,
            bounce: 0,
        };
        let scatter = Scatter {
            distance: 1.0,
            albedo: 0.5,
            ..Default::default()
        };
        Vpl {
            key,
            position,
            normal: Vec3::Y,
            share: Vec3::ONE,
            weight: 1.0,
            flux: Vec3::ONE,
            object: 0,
            scatter,
        }
    }

    #[test]
    fn strays_beside_a_face_join_the_polygon_behind_it() {
        let cell = Cell::at(Vec3::ONE, 10);
        let [lo, hi] = cell.bounds();
        let beside = Cell {
            index: [cell.index[0] + 1, cell.index[1], cell.index[2]],
            ..cell
        };
        let sequence = Sequence::new(1, 0);
        let floor = (0..60).map(|i| {
            let [u, v, ..] = sequence.sample(i, 0);
            floor_vpl(i, Vec3::new(lo.x + u, lo.y + 0.3, lo.z + v))
        });
        let settings = SimilaritySettings::default();
        // Over the face by a little, by far, and by a little on another height.
        let strays = [(0.03, 0.3), (0.6, 0.3), (0.03, 0.5)]
            .iter()
            .zip(60..)
            .map(|(&(dx, dy), i)| floor_vpl(i, Vec3::new(hi.x + dx, lo.y + dy, lo.z + 0.5)));
        let groups = vec![
            (cell, Groups::new(cell, floor.collect(), &settings)),
            (beside, Groups::new(beside, strays.collect(), &settings)),
        ];
        let joined = join(groups, &settings);
        let (_, border) = &joined[&cell];
        assert_eq!(
            border.joined(0).map(|v| v.key.path).collect::<Vec<_>>(),
            [60]
        );
        assert_eq!(joined[&beside].1.left(), [0]);
        let holds = |c: &Cell| joined[c].1.holds(&joined[c].0).len();
        assert_eq!([holds(&cell), holds(&beside)], [61, 2]);
        let crossed = fingerprint(&joined[&beside].0.vpls[0]);
        assert!(joined[&cell].1.holds(&joined[&cell].0).contains(&crossed));
    }
}

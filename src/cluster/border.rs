//! The border step (IBGI section 4.1, "Border Handling"): VPLs left over beside a cell's face join the polygon that goes on behind it.

use std::collections::BTreeMap;

use glam::Vec3;
use rayon::prelude::*;

use super::octree::Cell;
use super::similarity::{Groups, SimilaritySettings};

/// How near to the face a VPL must be, in sizes of the cell behind it.
const REACH: f32 = 0.1;

/// Moves every VPL that belongs to no plane of its cell, and lies near a face behind which a selected cell has a polygon
/// in the VPL's plane, to that polygon. A pure function of the cells, which are tried in the order of the faces.
pub fn join(groups: Vec<(Cell, Groups)>, settings: &SimilaritySettings) -> BTreeMap<Cell, Groups> {
    let mut groups: BTreeMap<Cell, Groups> = groups.into_iter().collect();
    let deepest = groups.keys().map(|c| c.level).max().unwrap_or(0);
    let cells: Vec<(&Cell, &Groups)> = groups.iter().collect();
    let moves: Vec<(Cell, u32, Cell, usize)> = cells
        .par_iter()
        .flat_map_iter(|&(cell, group)| {
            let target = |&i: &u32| {
                let vpl = &group.vpls[i as usize];
                neighbours(&groups, cell, deepest, vpl.position).find_map(|(other, distance)| {
                    let near = distance <= REACH * other.size();
                    let fits = |g: &Groups| {
                        g.planes
                            .iter()
                            .position(|p| p.fits(vpl, other.size(), settings))
                    };
                    near.then(|| fits(&groups[&other]))
                        .flatten()
                        .map(|plane| (*cell, i, other, plane))
                })
            };
            group.rest.iter().filter_map(target).collect::<Vec<_>>()
        })
        .collect();
    for (from, i, to, plane) in moves {
        let Some(source) = groups.get_mut(&from) else {
            continue;
        };
        source.rest.retain(|&r| r != i);
        let vpl = source.vpls[i as usize];
        if let Some(target) = groups.get_mut(&to) {
            target.planes[plane].joined.push(vpl);
        }
    }
    groups
}

/// The selected cells behind the faces of a cell, as seen from a point of it, with the point's distance from the face.
fn neighbours<'a>(
    groups: &'a BTreeMap<Cell, Groups>,
    cell: &Cell,
    deepest: u8,
    position: Vec3,
) -> impl Iterator<Item = (Cell, f32)> + 'a {
    let [lo, hi] = cell.bounds();
    let size = cell.size();
    let cell = *cell;
    (0..6).filter_map(move |face| {
        let (axis, upper) = (face / 2, face % 2 == 1);
        let distance = if upper {
            hi[axis] - position[axis]
        } else {
            position[axis] - lo[axis]
        };
        // A neighbour's face is shared: one more than eight times larger is not worth looking for.
        if distance > REACH * size * 8.0 {
            return None;
        }
        let mut across = position;
        across[axis] = if upper {
            hi[axis] + size * 1e-3
        } else {
            lo[axis] - size * 1e-3
        };
        // The selected cell that holds the point, of whatever level.
        let found = std::iter::successors(Some(Cell::at(across, deepest)), Cell::parent)
            .find(|c| groups.contains_key(c))?;
        (found != cell).then_some((found, distance.max(0.0)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::sampling::Sequence;
    use crate::transport::{Scatter, Vpl, VplKey};

    fn floor_vpl(path: u32, position: Vec3) -> Vpl {
        let key = VplKey {
            light: 0,
            path,
            bounce: 0,
        };
        let scatter = Scatter {
            distance: 1.0,
            albedo: 0.5,
        };
        Vpl {
            key,
            position,
            normal: Vec3::Y,
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
        assert_eq!(
            joined[&cell].planes[0]
                .joined
                .iter()
                .map(|v| v.key.path)
                .collect::<Vec<_>>(),
            [60]
        );
        assert_eq!(joined[&beside].rest, [1, 2]);
    }
}

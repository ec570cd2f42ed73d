//! The cells of the octree: one fixed grid over the world, whatever is in it, and the order of its places.

use std::ops::Range;

use glam::{DVec3, Vec3};

/// Root cells are 2^10 m wide.
pub(super) const ROOT_BITS: u32 = 10;
/// Positions are kept in 2^-20 m.
const FRACTION_BITS: u32 = 20;
/// Cells of the deepest level are 2^-14 m (61 µm) wide.
pub const MAX_LEVEL: u8 = 24;
/// A cell of the world's grid: level 0 cells are 1024 m wide, and each level halves them. No cell depends on a scene's
/// bounds. The grid lies a third of a root cell off the origin, so that walls at round coordinates never lie on a cell's face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Cell {
    /// 0 (root) to [`MAX_LEVEL`].
    pub level: u8,
    /// Index along each axis, in cells of this level.
    pub index: [i64; 3],
}

impl Cell {
    /// The cell of a level that holds a point.
    pub fn at(position: Vec3, level: u8) -> Self {
        let shift = ROOT_BITS + FRACTION_BITS - u32::from(level);
        Self {
            level,
            index: grid(position).map(|g| g >> shift),
        }
    }

    /// Edge length, metres.
    pub fn size(&self) -> f32 {
        (f64::from(ROOT_BITS) - f64::from(self.level)).exp2() as f32
    }

    /// Lower and upper corner, metres.
    pub fn bounds(&self) -> [Vec3; 2] {
        let size = (f64::from(ROOT_BITS) - f64::from(self.level)).exp2();
        let lo =
            DVec3::from_array(self.index.map(|i| i as f64)) * size - DVec3::splat(grid_offset());
        [lo.as_vec3(), (lo + size).as_vec3()]
    }

    /// Centre, metres.
    pub fn center(&self) -> Vec3 {
        let [lo, hi] = self.bounds();
        (lo + hi) * 0.5
    }

    /// The cell that this one is an eighth of.
    pub fn parent(&self) -> Option<Self> {
        (self.level > 0).then(|| Self {
            level: self.level - 1,
            index: self.index.map(|i| i >> 1),
        })
    }

    /// One of the eight parts: bit `a` of `octant` chooses the upper half along axis `a`.
    pub fn child(&self, octant: usize) -> Self {
        Self {
            level: self.level + 1,
            index: std::array::from_fn(|a| self.index[a] * 2 + (octant >> a & 1) as i64),
        }
    }
}

/// A place in the order in which the parts of a cell follow each other without gap (Morton order): a cell's places are a
/// range, so a sorted list of cells that do not overlap is searched by place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place([i64; 3], u128);

impl Place {
    /// Of a point.
    pub fn at(position: Vec3) -> Self {
        Cell::at(position, MAX_LEVEL).places().start
    }

    /// The cells that hold it, from the smallest on.
    pub fn cells(&self) -> impl Iterator<Item = Cell> + use<> {
        let Self(root, bits) = *self;
        let index = std::array::from_fn(|axis| {
            let bit = |level: u8| (bits >> (3 * u32::from(level) + axis as u32) & 1) as i64;
            let low: i64 = (0..MAX_LEVEL).map(|level| bit(level) << level).sum();
            root[axis] << MAX_LEVEL | low
        });
        let smallest = Cell {
            level: MAX_LEVEL,
            index,
        };
        std::iter::successors(Some(smallest), Cell::parent)
    }
}

impl Cell {
    /// All places in the cell.
    pub fn places(&self) -> Range<Place> {
        let below = u32::from(MAX_LEVEL - self.level);
        let index = self.index.map(|i| i << below);
        let root = index.map(|i| i >> MAX_LEVEL);
        let low = 1 << (MAX_LEVEL / 2);
        let half = |shift: u32| -> u128 {
            (0..3)
                .map(|a| u128::from(spread((index[a] >> shift & (low - 1)) as u64)) << a)
                .sum()
        };
        let half_bits = u32::from(MAX_LEVEL / 2);
        let start = half(half_bits) << (3 * half_bits) | half(0);
        Place(root, start)..Place(root, start + (1 << (3 * below)))
    }

    /// The cell of the same size on the other side of a face: -X, +X, -Y, +Y, -Z, +Z.
    pub fn across(&self, face: usize) -> Self {
        let mut index = self.index;
        index[face / 2] += [-1, 1][face % 2];
        Self { index, ..*self }
    }
}

/// Spreads up to 21 bits out to every third one.
fn spread(x: u64) -> u64 {
    [
        (32, 0x001f_0000_0000_ffff),
        (16, 0x001f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ]
    .iter()
    .fold(x, |x, (shift, mask)| (x | x << shift) & mask)
}

const fn grid_offset() -> f64 {
    (1u64 << ROOT_BITS) as f64 / 3.0
}

pub(super) fn grid(position: Vec3) -> [i64; 3] {
    const UNITS: f64 = (1u64 << FRACTION_BITS) as f64;
    position.to_array().map(|x| {
        let x = (f64::from(x) + grid_offset()) * UNITS;
        // Down, not towards zero; as `floor`, without a call.
        let whole = x as i64;
        whole - i64::from(whole as f64 > x)
    })
}

/// Which of a cell's children at `level` holds the point.
pub(super) fn octant(grid: [i64; 3], level: u8) -> usize {
    let shift = ROOT_BITS + FRACTION_BITS - u32::from(level);
    (0..3).map(|a| ((grid[a] >> shift & 1) as usize) << a).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_nest_and_walls_at_round_coordinates_lie_inside() {
        for (p, level) in [
            (Vec3::new(1.0, -2.5, 0.0), 12),
            (Vec3::new(-400.0, 700.0, 0.25), 3),
        ] {
            let cell = Cell::at(p, level);
            assert_eq!(Cell::at(p, level - 1), cell.parent().expect("a parent"));
            assert!(
                (0..8)
                    .map(|o| cell.child(o))
                    .any(|c| c == Cell::at(p, level + 1))
            );
            let [lo, hi] = cell.bounds();
            assert!(lo.cmple(p).all() && hi.cmpgt(p).all());
            assert!(((hi - lo) - cell.size()).abs().max_element() < 1e-3);
        }
        for level in 0..=16 {
            let cell = Cell::at(Vec3::ZERO, level);
            let [lo, hi] = cell.bounds();
            assert!((-lo).min(hi).min_element() > cell.size() * 0.3);
        }
    }

    #[test]
    fn places_are_in_the_order_of_parts() {
        for (p, level) in [
            (Vec3::new(1.0, -2.5, 0.0), 0),
            (Vec3::new(-400.0, 700.0, 0.25), 9),
            (Vec3::new(3.0, 2.0, 1.0), 11),
            (Vec3::new(3.0, 2.0, 1.0), MAX_LEVEL - 1),
        ] {
            let cell = Cell::at(p, level);
            let mut end = cell.places().start;
            for part in (0..8).map(|o| cell.child(o)) {
                assert_eq!(part.places().start, end);
                end = part.places().end;
            }
            assert_eq!(end, cell.places().end);
            assert!(cell.places().contains(&Place::at(p)));
            let smallest = Place::at(p).cells().next();
            assert_eq!(smallest, Some(Cell::at(p, MAX_LEVEL)));
            for face in 0..6 {
                let beside = cell.across(face);
                let center = cell.center().distance(beside.center());
                assert!((center / cell.size() - 1.0).abs() < 1e-3 || level > 20);
                assert_eq!(beside.across(face ^ 1), cell);
                assert!(!beside.places().contains(&Place::at(p)));
            }
        }
    }
}

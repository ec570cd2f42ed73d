//! How much of the light that is held is out of date, cell by cell (IBGI section 4.2): what to update first.

use std::collections::BTreeMap;

use glam::Vec3;

use super::cell::{Cell, MAX_LEVEL, Place};
use super::sums::FluxScale;
use super::{CellId, Clusters};
use crate::transport::Differences;
use crate::transport::emission::mean;
use crate::transport::{Emission, Vpl};

/// Invalid radiant flux by cell.
///
/// VPLs that leave a cell and others that come to it count as their difference: they may cancel each other out. VPLs whose light
/// arrives elsewhere than before count fully, and so do the starts of paths and lights that moved.
#[derive(Clone, Debug, PartialEq)]
pub struct Ledger {
    scale: FluxScale,
    /// By the first place and the level of a cell, so that a cell's parts follow it.
    octree: BTreeMap<(Place, u8), Invalid>,
    /// By light and way; lumens.
    apertures: BTreeMap<(u32, u64), f64>,
}

/// In units of [`FluxScale`], so that what cancels leaves nothing behind.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Invalid {
    differential: [i64; 3],
    absolute: [i64; 3],
}

impl Invalid {
    fn add(&mut self, other: &Self) {
        for c in 0..3 {
            self.differential[c] += other.differential[c];
            self.absolute[c] += other.absolute[c];
        }
    }

    /// Lumens, mean over RGB.
    fn flux(&self, scale: &FluxScale) -> f64 {
        let units = std::array::from_fn(|c| self.differential[c].abs() + self.absolute[c]);
        f64::from(mean(scale.lumens(units)))
    }
}

impl Ledger {
    /// Nothing is invalid.
    pub fn new(clusters: &Clusters) -> Self {
        Self {
            scale: *clusters.octree.scale(),
            octree: BTreeMap::new(),
            apertures: BTreeMap::new(),
        }
    }

    /// Takes in what validation changed, for the cells that are held; light in none of them is noted where it is. `clusters` are
    /// those after [`Clusters::apply`].
    pub fn note<T>(
        &mut self,
        clusters: &Clusters,
        held: &BTreeMap<CellId, T>,
        differences: &Differences,
    ) {
        let scale = self.scale;
        let mut octree = |vpl: &Vpl, how: &dyn Fn(&mut Invalid, [i64; 3])| {
            let cell = holder(vpl.position, held);
            let entry = self.octree.entry((cell.places().start, cell.level));
            how(entry.or_default(), scale.units(vpl.flux));
        };
        for vpl in &differences.removed {
            octree(vpl, &|invalid, units| {
                (0..3).for_each(|c| invalid.differential[c] -= units[c])
            });
        }
        for vpl in &differences.added {
            octree(vpl, &|invalid, units| {
                (0..3).for_each(|c| invalid.differential[c] += units[c])
            });
        }
        for [old, new] in &differences.revised {
            let before = scale.units(old.flux);
            octree(new, &|invalid, units| {
                (0..3).for_each(|c| invalid.differential[c] += units[c] - before[c]);
                if old.scatter != new.scatter {
                    (0..3).for_each(|c| invalid.absolute[c] += units[c]);
                }
            });
        }
        self.octree.retain(|_, i| *i != Invalid::default());

        let relit: BTreeMap<u32, f64> = differences
            .lights
            .iter()
            .map(|l| {
                let [old, new] = l.flux.map(|f| f64::from(mean(f)));
                let differ = (l.flux[1] - l.flux[0]).abs();
                let dimmed = f64::from(mean(differ));
                (l.light, if l.moved { old.max(new) } else { dimmed })
            })
            .collect();
        for (&light, &flux) in &relit {
            let mut cells: Vec<u64> = held
                .range(aperture(light, 0)..=aperture(light, u64::MAX))
                .filter_map(|(id, _)| match id {
                    CellId::Aperture { path, .. } => Some(*path),
                    CellId::Octree(_) => None,
                })
                .collect();
            if cells.is_empty() {
                cells.push(1);
            }
            for path in cells {
                *self.apertures.entry((light, path)).or_default() += flux * share(path);
            }
        }
        for change in &differences.emissions {
            if relit.contains_key(&change.light) {
                continue;
            }
            let way = |e: &Option<Emission>| Some(clusters.locate(change.light, e.as_ref()?));
            let leaf = way(&change.new).or_else(|| way(&change.old)).unwrap_or(1);
            let holder = std::iter::successors(Some(leaf), |w| (*w > 1).then_some(w >> 1))
                .find(|&path| held.contains_key(&aperture(change.light, path)));
            let entry = (change.light, holder.unwrap_or(leaf));
            *self.apertures.entry(entry).or_default() += scale.flux_per_path();
        }
    }

    /// The invalid flux of a cell with all its parts, in lumens (mean over RGB). A part of an aperture also has its share of
    /// what was noted for larger parts.
    pub fn flux(&self, cell: &CellId) -> f64 {
        match *cell {
            CellId::Octree(cell) => {
                let mut sum = Invalid::default();
                self.inside(&cell).for_each(|(_, i)| sum.add(i));
                sum.flux(&self.scale)
            }
            CellId::Aperture { light, path } => self
                .meeting(light, path)
                .iter()
                .map(|&(other, flux)| flux * overlap(other, path))
                .sum(),
        }
    }

    /// The cell is up to date: forgets its invalid flux, and returns it.
    pub fn take(&mut self, cell: &CellId) -> f64 {
        let flux = self.flux(cell);
        match *cell {
            CellId::Octree(cell) => {
                let keys: Vec<_> = self.inside(&cell).map(|(key, _)| *key).collect();
                keys.iter().for_each(|key| {
                    self.octree.remove(key);
                });
            }
            CellId::Aperture { light, path } => {
                // What larger parts have is left to the other halves on the way.
                for step in (0..63 - path.leading_zeros()).rev() {
                    let (larger, half) = (path >> (step + 1), path >> step);
                    if let Some(flux) = self.apertures.remove(&(light, larger)) {
                        for half in [half, half ^ 1] {
                            *self.apertures.entry((light, half)).or_default() += flux / 2.0;
                        }
                    }
                }
                for (other, _) in self.meeting(light, path) {
                    self.apertures.remove(&(light, other));
                }
            }
        }
        flux
    }

    /// The invalid flux of all cells, lumens.
    pub fn total(&self) -> f64 {
        let octree: f64 = self.octree.values().map(|i| i.flux(&self.scale)).sum();
        octree + self.apertures.values().sum::<f64>()
    }

    fn inside(&self, cell: &Cell) -> impl Iterator<Item = (&(Place, u8), &Invalid)> {
        let places = cell.places();
        self.octree
            .range((places.start, cell.level)..(places.end, 0))
    }

    /// What is noted for a part of an aperture, its parts, and the parts that it is one of.
    fn meeting(&self, light: u32, path: u64) -> Vec<(u64, f64)> {
        let mut all = self.apertures.range((light, 0)..=(light, u64::MAX));
        // Longer ways are larger numbers.
        let Some((&(_, last), _)) = all.next_back() else {
            return Vec::new();
        };
        let above = std::iter::successors(Some(path >> 1), |way| Some(way >> 1));
        let above = above.take_while(|way| *way > 0);
        let above = above.filter_map(|way| Some((way, *self.apertures.get(&(light, way))?)));
        let mut meeting: Vec<_> = above.collect();
        for below in 0..=path.leading_zeros() {
            let (first, end) = (path << below, (path << below) + ((1 << below) - 1));
            if first > last {
                break;
            }
            let parts = self.apertures.range((light, first)..=(light, end));
            meeting.extend(parts.map(|(&(_, way), &flux)| (way, flux)));
        }
        meeting
    }
}

fn aperture(light: u32, path: u64) -> CellId {
    CellId::Aperture { light, path }
}

/// The held cell around a point; the smallest cell there if none is held.
fn holder<T>(position: Vec3, held: &BTreeMap<CellId, T>) -> Cell {
    let smallest = Cell::at(position, MAX_LEVEL);
    (0..=MAX_LEVEL)
        .map(|level| Cell {
            level,
            index: smallest.index.map(|i| i >> (MAX_LEVEL - level)),
        })
        .find(|cell| held.contains_key(&CellId::Octree(*cell)))
        .unwrap_or(smallest)
}

/// About how much of an aperture's light a part has that is reached by halving.
fn share(path: u64) -> f64 {
    (-f64::from(63 - path.leading_zeros())).exp2()
}

/// How much of one part of an aperture lies in another.
fn overlap(part: u64, whole: u64) -> f64 {
    let (p, w) = (part.leading_zeros(), whole.leading_zeros());
    if p <= w {
        f64::from(u8::from(part >> (w - p) == whole))
    } else if whole >> (p - w) == part {
        share(whole) / share(part)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::{Budget, SimilaritySettings};
    use crate::scene::edit::Change;
    use crate::transport::Validator;
    use crate::transport::bvh::SceneBvh;
    use crate::transport::paths::PathSettings;
    use crate::transport::testing::cornell;
    use glam::Affine3A;

    #[test]
    fn flux_is_noted_where_it_is_held_and_cancels() {
        let scene = cornell();
        let bvh = SceneBvh::build(&scene);
        let settings = PathSettings::for_paths(&scene, 3000);
        let mut validator = Validator::new(&scene, &bvh, &settings);
        let similarity = SimilaritySettings::default();
        let mut clusters = Clusters::new(&scene, validator.paths(), &settings, similarity);
        let mut ledger = Ledger::new(&clusters);
        // Some cells are not held.
        let cells = clusters.select(Budget::Cells(90)).cells;
        let held: BTreeMap<CellId, ()> =
            cells.iter().skip(3).step_by(2).map(|c| (*c, ())).collect();
        let mut edited = scene.clone();
        let to = Affine3A::from_translation(Vec3::new(-0.2, 0.0, 0.1));
        edited.objects[3].transform = to;
        edited.materials[0].base_color *= 0.9;
        let change = Change::between(&scene, &edited);
        validator.invalidate(&edited, &change);
        let moved = bvh.moved(&edited, &change.objects);
        let mut all = Differences::default();
        while !validator.is_valid() {
            let d = validator.step(&edited, &moved, 400);
            clusters.apply(&edited, validator.paths(), &d);
            ledger.note(&clusters, &held, &d);
            all.removed.extend(d.removed);
            all.added.extend(d.added);
            all.revised.extend(d.revised);
            all.emissions.extend(d.emissions);
        }
        assert!(!all.revised.is_empty() && !all.emissions.is_empty());
        let mut total = 0.0;
        let octree = held.keys().filter_map(|id| match id {
            CellId::Octree(cell) => Some(*cell),
            CellId::Aperture { .. } => None,
        });
        let units = |vpls: &mut dyn Iterator<Item = &Vpl>, cell: &Cell| {
            vpls.filter(|v| Cell::at(v.position, cell.level) == *cell)
                .map(|v| v.flux.as_dvec3())
                .sum::<glam::DVec3>()
        };
        for cell in octree {
            let differential =
                units(&mut all.added.iter(), &cell) - units(&mut all.removed.iter(), &cell);
            let absolute = units(&mut all.revised.iter().map(|[v, _]| v), &cell);
            let expected = (differential.abs() + absolute).element_sum() / 3.0;
            let found = ledger.flux(&CellId::Octree(cell));
            assert!((found - expected).abs() < 1e-5 * settings.flux_per_path.max(expected));
            total += found;
        }
        let direct = all.emissions.len() as f64 * settings.flux_per_path;
        let root = aperture(11, 1);
        assert!((ledger.flux(&root) / direct - 1.0).abs() < 1e-9);
        assert!(ledger.total() > total + direct, "the rest is noted too");
        // What is not held is found by any cell around it.
        let whole = CellId::Octree(Cell::at(Vec3::ZERO, 0));
        let taken: f64 = held.keys().map(|id| ledger.take(id)).sum();
        assert!(taken >= total && ledger.flux(&whole) > 0.0);
        assert!(held.keys().all(|id| ledger.flux(id) == 0.0));
        let rest = ledger.take(&whole) + ledger.take(&root);
        assert!(rest > 0.0 && ledger.total() == 0.0);

        // There and back again: only what is absolute stays.
        let back = Differences {
            removed: all.added.clone(),
            added: all.removed.clone(),
            ..Default::default()
        };
        let there = Differences {
            removed: all.removed,
            added: all.added,
            ..Default::default()
        };
        ledger.note(&clusters, &held, &there);
        assert!(ledger.total() > 0.0);
        ledger.note(&clusters, &held, &back);
        assert_eq!(ledger, Ledger::new(&clusters));
    }

    #[test]
    fn parts_of_apertures_share_what_is_noted_for_the_whole() {
        assert_eq!(
            (overlap(1, 1), overlap(0b101, 1), overlap(1, 0b101)),
            (1.0, 1.0, 0.25)
        );
        assert_eq!((overlap(0b101, 0b11), overlap(0b11, 0b101)), (0.0, 0.0));
        let scene = cornell();
        let bvh = SceneBvh::build(&scene);
        let settings = PathSettings::for_paths(&scene, 3000);
        let mut validator = Validator::new(&scene, &bvh, &settings);
        let similarity = SimilaritySettings::default();
        let mut clusters = Clusters::new(&scene, validator.paths(), &settings, similarity);
        let mut edited = scene.clone();
        edited.materials[5].emission *= 0.75;
        validator.invalidate(&edited, &Change::between(&scene, &edited));
        let d = validator.step(&edited, &bvh, 0);
        assert!(!d.lights[0].moved && d.paths == 0);
        clusters.apply(&edited, validator.paths(), &d);
        let quarter = f64::from(mean(d.lights[0].flux[0])) / 4.0;
        let parts = [0b10, 0b110, 0b111].map(|path| aperture(11, path));
        for held in [&parts[..], &[]] {
            let mut ledger = Ledger::new(&clusters);
            let held = held.iter().map(|c| (*c, ())).collect();
            ledger.note(&clusters, &held, &d);
            assert!((ledger.total() / quarter - 1.0).abs() < 1e-5);
            assert!((ledger.take(&parts[0]) / quarter - 0.5).abs() < 1e-5);
            assert!((ledger.flux(&parts[1]) / quarter - 0.25).abs() < 1e-5);
            assert_eq!(ledger.flux(&parts[0]), 0.0);
        }
    }
}

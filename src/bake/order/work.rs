//! What updates take, so that what shows can be weighed against it. In evaluations of an indirect light: its depth map drawn, and its
//! light added to the whole map. Measured on Mesa's CPU driver, with depth maps kept.

use super::estimate::covered;
use crate::bake::device::records::{Parts, Region};
use crate::cluster::VirtualLight;

/// Of an evaluation, what drawing takes.
const DRAW: f64 = 0.6;
/// What a direct light takes of an indirect one: its maps are finer, and its shadows softer.
const DIRECT: f64 = 4.0;
/// What following a light to another scene takes at least, though it is limited to the shadows of what changed: culling, and a map
/// that begins as another.
const LIMITED: f64 = 0.15;
/// What it takes besides where everything is in these shadows: what changed is drawn alone, where something only came.
const FOLLOWED: f64 = 0.6;
/// What of the evaluation is left in parts of the map, with a third of it seen. Together they take a little more.
const PARTS: [f64; 2] = [0.4, 0.7];

/// What an update takes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::bake) struct Work {
    /// Depth maps: once for both parts of the map, the first time.
    draw: f64,
    /// What goes through the map.
    evaluate: f64,
}

impl Work {
    /// So much of going through the map.
    #[cfg(test)]
    pub fn of(evaluate: f64) -> Self {
        Self {
            draw: 0.0,
            evaluate,
        }
    }

    /// Adding a light.
    pub fn add(light: &VirtualLight) -> Self {
        let all = if light.direct { DIRECT } else { 1.0 };
        Self {
            draw: DRAW * all,
            evaluate: (1.0 - DRAW) * all,
        }
    }

    /// Adding a light that sees what one that leaves sees: of its depth map only what changed is drawn.
    pub fn replace(light: &VirtualLight) -> Self {
        Self {
            draw: LIMITED,
            ..Self::add(light)
        }
    }

    /// Taking a light away again.
    pub fn subtract(light: &VirtualLight) -> Self {
        Self {
            draw: 0.0,
            ..Self::add(light)
        }
    }

    /// Giving a light another flux, by one evaluation.
    pub fn dim(light: &VirtualLight) -> Self {
        Self::subtract(light)
    }

    /// Following a light to another scene, that differs in these boxes.
    pub fn follow(light: &VirtualLight, regions: &[Region]) -> Self {
        let part = regions.iter().map(|r| covered(light, r)).sum::<f64>();
        let all = if light.direct { DIRECT } else { 1.0 };
        Self {
            draw: 0.0,
            evaluate: all * (LIMITED + FOLLOWED * part.min(1.0)),
        }
    }

    /// In some parts of the map.
    pub fn within(&self, parts: Parts) -> f64 {
        match parts {
            Parts::SEEN => self.draw + PARTS[0] * self.evaluate,
            Parts::REST => PARTS[1] * self.evaluate,
            _ => self.draw + self.evaluate,
        }
        .max(LIMITED * PARTS[0])
    }
}

impl std::iter::Sum for Work {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |sum, one| Self {
            draw: sum.draw + one.draw,
            evaluate: sum.evaluate + one.evaluate,
        })
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::cluster::Shape;

    #[test]
    fn a_map_is_drawn_once_for_both_parts_and_not_for_what_goes() {
        let light = VirtualLight {
            shape: Shape::Disk { area: 0.1 },
            position: Vec3::ZERO,
            normal: Vec3::Y,
            surface: Vec3::Y,
            flux: Vec3::ONE,
            direct: false,
        };
        let add = Work::add(&light);
        assert_eq!(add.within(Parts::ALL), 1.0);
        let [seen, rest] = Parts::EACH.map(|parts| add.within(parts));
        assert!(seen < 1.0 && rest < seen && seen + rest < 1.1);
        let subtract = Work::subtract(&light).within(Parts::ALL);
        assert!(subtract < 0.5);
        let replace = Work::replace(&light).within(Parts::ALL);
        assert!(subtract < replace && replace < 0.6);
        let nothing = Work::follow(&light, &[]).within(Parts::ALL);
        assert!(nothing < subtract && nothing > 0.0);
    }
}

//! Lines, points and shapes in colours.

use glam::Vec3;

use super::super::legend::{round_down, round_up, turbo};
use super::super::look::Overlay;
use super::super::marker::{Corner, Stroke};
use super::super::panels::edges;
use crate::scene::Bounds;

/// A colour as marks have it: encoded, alpha multiplied in.
pub(super) fn ink(color: [f32; 3], alpha: f32) -> u32 {
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    let [r, g, b] = color.map(|v| byte(v * alpha));
    u32::from_le_bytes([r, g, b, byte(alpha)])
}

/// False colours for values over decades.
pub(super) struct Scale(pub(super) [f32; 2]);

impl Scale {
    /// Over most of the values, in round numbers.
    pub(super) fn over(values: impl Iterator<Item = f32>) -> Option<Self> {
        let mut sorted: Vec<f32> = values.filter(|v| *v > 0.0).collect();
        sorted.sort_unstable_by(f32::total_cmp);
        let at = |share: f32| sorted.get((sorted.len().saturating_sub(1) as f32 * share) as usize);
        let (low, high) = (round_down(*at(0.02)?), round_up(*at(0.98)?));
        Some(Self([low.min(high / 10.0), high]))
    }

    pub(super) fn color(&self, value: f32) -> [f32; 3] {
        let [low, high] = self.0;
        let share = (value.max(f32::MIN_POSITIVE) / low).log2() / (high / low).log2();
        turbo(share.clamp(0.0, 1.0))
    }
}

#[derive(Default)]
pub(super) struct Pencil {
    pub(super) strokes: Vec<Stroke>,
    /// Of shapes that hide each other.
    pub(super) solid: Vec<Corner>,
    /// Of shapes that do not.
    pub(super) veils: Vec<Corner>,
    pub(super) scales: Vec<(Overlay, [f32; 2])>,
}

impl Pencil {
    pub(super) fn line(&mut self, from: Vec3, to: Vec3, color: u32, width: f32) {
        self.strokes.push(Stroke {
            from: from.to_array(),
            to: to.to_array(),
            color,
            width,
        });
    }

    pub(super) fn point(&mut self, at: Vec3, color: u32, width: f32) {
        self.line(at, at, color, width);
    }

    /// A convex polygon with an outline.
    pub(super) fn polygon(&mut self, outline: &[Vec3], fill: u32, edge: u32) {
        let corner = |position: &Vec3| Corner {
            position: position.to_array(),
            color: fill,
        };
        if let [first, rest @ ..] = outline {
            for pair in rest.windows(2) {
                let triangle = [first, &pair[0], &pair[1]];
                self.solid.extend(triangle.map(corner));
            }
        }
        for (i, from) in outline.iter().enumerate() {
            self.line(*from, outline[(i + 1) % outline.len()], edge, 1.0);
        }
    }

    pub(super) fn frame(&mut self, bounds: &Bounds, color: u32, width: f32) {
        for (a, b) in edges(bounds) {
            self.line(a, b, color, width);
        }
    }

    /// The six sides of a box.
    pub(super) fn walls(&mut self, bounds: &Bounds, color: u32) {
        let at = |axis: usize, [a, b, c]: [bool; 3]| {
            let pick = |high: bool, i: usize| match high {
                true => bounds.max[i],
                false => bounds.min[i],
            };
            let mut point = Vec3::ZERO;
            for (k, high) in [a, b, c].into_iter().enumerate() {
                let i = (axis + k) % 3;
                point[i] = pick(high, i);
            }
            point.to_array()
        };
        for axis in 0..3 {
            for side in [false, true] {
                let corner = |b, c| Corner {
                    position: at(axis, [side, b, c]),
                    color,
                };
                let [a, b, c, d] = [
                    corner(false, false),
                    corner(true, false),
                    corner(true, true),
                    corner(false, true),
                ];
                self.veils.extend([a, b, c, a, c, d]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_span_most_values_and_at_least_a_decade() {
        let Scale([low, high]) = Scale::over((1..=100).map(|i| i as f32 * 0.01)).unwrap();
        assert_eq!([low, high], [0.02, 1.0]);
        let Scale([low, high]) = Scale::over([3.0; 5].into_iter()).unwrap();
        assert!((low - 0.5).abs() < 1e-6 && high == 5.0, "{low} {high}");
        assert!(Scale::over([0.0].into_iter()).is_none());
        let scale = Scale([1.0, 100.0]);
        assert_eq!(scale.color(0.1), scale.color(1.0));
        assert_ne!(scale.color(10.0), scale.color(1.0));
    }

    #[test]
    fn walls_enclose_their_box() {
        let bounds = Bounds {
            min: Vec3::ZERO,
            max: Vec3::new(1.0, 2.0, 3.0),
        };
        let mut pencil = Pencil::default();
        pencil.walls(&bounds, 0);
        let area: f32 = pencil
            .veils
            .chunks_exact(3)
            .map(|t| {
                let [a, b, c] = [0, 1, 2].map(|i| Vec3::from(t[i].position));
                0.5 * (b - a).cross(c - a).length()
            })
            .sum();
        assert!((area - 22.0).abs() < 1e-4, "{area}");
    }
}

//! Walls with rectangular and arched openings.

use glam::{Affine3A, Mat3, Vec3};

use super::{
    shape::Shape,
    turning::{cos, sin},
};

/// An opening in a [`wall`]: lower left and upper right corner; arched ones end in a half circle.
#[derive(Clone, Copy)]
pub(super) struct Opening {
    pub low: [f32; 2],
    pub high: [f32; 2],
    pub arched: bool,
}

/// A wall in the plane z = 0 from (0, 0) to (`width`, `height`), facing +Z, with openings whose reveals go `depth` deep
/// (towards -Z); one that starts on the ground has no sill. `back` gives the height of its rear face at z = -`depth`, if it has one.
pub(super) fn wall(
    width: f32,
    height: f32,
    depth: f32,
    openings: &[Opening],
    back: Option<f32>,
) -> Shape {
    /// Masonry between the top of an arch and where plain wall goes on.
    const CROWN: f32 = 0.1;
    const STEPS: u32 = 12;
    let mut shape = face(width, height, openings, CROWN);
    for o in openings {
        let arch = arch_points(o, STEPS);
        let spring = if o.arched {
            o.high[1] - (o.high[0] - o.low[0]) / 2.0
        } else {
            o.high[1]
        };
        let point = |p: [f32; 2], z: f32| Vec3::new(p[0], p[1], z);
        let mut outline = vec![
            [o.low[0], spring],
            o.low,
            [o.high[0], o.low[1]],
            [o.high[0], spring],
        ];
        if o.arched {
            outline.extend(arch.iter().rev().skip(1).take(arch.len() - 2).copied());
        }
        for i in 0..outline.len() {
            let (a, b) = (outline[i], outline[(i + 1) % outline.len()]);
            if a[1].max(b[1]) <= 0.0 {
                continue;
            }
            shape.polygon(&[
                point(a, 0.0),
                point(b, 0.0),
                point(b, -depth),
                point(a, -depth),
            ]);
        }
    }
    if let Some(height) = back {
        let mirrored: Vec<Opening> = openings
            .iter()
            .map(|o| Opening {
                low: [width - o.high[0], o.low[1]],
                high: [width - o.low[0], o.high[1]],
                arched: o.arched,
            })
            .collect();
        let turn = Affine3A::from_translation(Vec3::new(width, 0.0, -depth))
            * Affine3A::from_mat3(Mat3::from_cols(Vec3::NEG_X, Vec3::Y, Vec3::NEG_Z));
        shape.append(&face(width, height, &mirrored, CROWN).transformed(turn));
    }
    shape
}

/// The front face of a wall around its openings.
fn face(width: f32, height: f32, openings: &[Opening], crown: f32) -> Shape {
    let mut shape = Shape::default();
    let top = |o: &Opening| {
        if o.arched {
            o.high[1] + crown
        } else {
            o.high[1]
        }
    };
    let cuts = |limit: f32, values: Vec<f32>| {
        let mut cuts = values;
        cuts.extend([0.0, limit]);
        cuts.sort_by(f32::total_cmp);
        cuts.dedup_by(|a, b| (*a - *b).abs() < 1e-4);
        cuts
    };
    let us = cuts(
        width,
        openings
            .iter()
            .flat_map(|o| [o.low[0], o.high[0]])
            .collect(),
    );
    let vs = cuts(
        height,
        openings.iter().flat_map(|o| [o.low[1], top(o)]).collect(),
    );
    for u in us.windows(2) {
        for v in vs.windows(2) {
            let middle = [(u[0] + u[1]) / 2.0, (v[0] + v[1]) / 2.0];
            let open = |o: &Opening| {
                (o.low[0]..o.high[0]).contains(&middle[0])
                    && (o.low[1]..top(o)).contains(&middle[1])
            };
            if !openings.iter().any(open) {
                shape.rectangle(
                    Vec3::new(u[0], v[0], 0.0),
                    Vec3::X * (u[1] - u[0]),
                    Vec3::Y * (v[1] - v[0]),
                );
            }
        }
    }
    for o in openings.iter().filter(|o| o.arched) {
        for p in arch_points(o, 12).windows(2) {
            let ceiling = top(o);
            shape.polygon(
                &[
                    [p[0][0], p[0][1]],
                    [p[1][0], p[1][1]],
                    [p[1][0], ceiling],
                    [p[0][0], ceiling],
                ]
                .map(|[x, y]| Vec3::new(x, y, 0.0)),
            );
        }
    }
    shape
}

/// The half circle on top of an opening, from left to right.
fn arch_points(o: &Opening, steps: u32) -> Vec<[f32; 2]> {
    let radius = (o.high[0] - o.low[0]) / 2.0;
    let (center, spring) = (o.low[0] + radius, o.high[1] - radius);
    let point = |k: u32| match k {
        0 => [o.low[0], spring],
        k if k == steps => [o.high[0], spring],
        k => {
            let angle = std::f32::consts::PI * (1.0 - k as f32 / steps as f32);
            [center + radius * cos(angle), spring + radius * sin(angle)]
        }
    };
    (0..=steps).map(point).collect()
}

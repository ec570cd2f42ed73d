//! What an update asks of a depth map: for each face a rectangle around what changed. Both versions of a light see the same
//! beside it, so that nothing need be drawn there.

use glam::Vec3;

use crate::bake::device::shared::{BLOCKS, FACES};

/// A rectangle of a face, all of it 256 cells wide and high: first column, first row, last column, last row, a byte each from
/// the lowest; of nothing where a last one is less than a first. Of hemicubes, whole blocks, so that these tell what is hidden.
pub(in crate::bake) type Asked = u32;

/// All of a face.
pub(in crate::bake) const ALL: Asked = 0xffff_0000;
const NOTHING: Asked = 0x0000_ffff;

/// Wider than this, radians, everything is asked for.
const WIDEST: f32 = 0.5;

/// A box that something differs in, as a view sees it.
pub(super) struct Seen {
    /// From the view's origin.
    pub center: Vec3,
    /// Half the box.
    pub extent: Vec3,
    /// How far beside it lookups may lie that it makes a difference to, radians.
    pub margin: f32,
}

/// What is asked of the faces of a hemicube with the axes x, y and the pole z.
pub(super) fn of_hemicube([x, y, z]: [Vec3; 3], boxes: &[Seen]) -> [Asked; FACES as usize] {
    // As glsl/view.glsl has them.
    let faces = [(x, y, z), (y, z, x), (y, z, -x), (x, z, y), (x, z, -y)];
    std::array::from_fn(|face| {
        let (u, v, w) = faces[face];
        let horizon = if face == 0 { -1.0 } else { 0.0 };
        let all = boxes.iter().map(|b| of_face(u, v, w, horizon, b));
        all.fold(NOTHING, join)
    })
}

/// What is asked of an orthographic map 2 wide and high: a rectangle by its spans along both axes.
pub(super) fn of_map(spans: [(f32, f32); 2]) -> [Asked; FACES as usize] {
    let [s, t] = spans;
    let mut out = [NOTHING; FACES as usize];
    out[0] = pack(cells(s, -1.0), cells(t, -1.0));
    out
}

/// `horizon`: where the face's rows begin.
fn of_face(u: Vec3, v: Vec3, w: Vec3, horizon: f32, seen: &Seen) -> Asked {
    let nearest = (seen.center.abs() - seen.extent).max(Vec3::ZERO).length();
    let far = seen.center.length() + seen.extent.length();
    // Of what lies about the origin nothing is beside; nor is anything of what fills a view.
    if seen.margin.is_nan() || seen.margin > WIDEST || nearest <= 1e-3 * far {
        return ALL;
    }
    let corner = |i: usize| {
        let side = |bit: usize| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
        let at = seen.center + seen.extent * Vec3::new(side(0), side(1), side(2));
        Vec3::new(u.dot(at), v.dot(at), w.dot(at))
    };
    // What matters to the face makes an angle of less than 88 degrees with its axis.
    let plane = 0.02 * nearest;
    let mut spans = [(f32::INFINITY, f32::NEG_INFINITY); 2];
    let mut hold = |at: Vec3| {
        for (span, value) in spans.iter_mut().zip([at.x / at.z, at.y / at.z]) {
            *span = (span.0.min(value), span.1.max(value));
        }
    };
    for (i, bit) in (0..8).flat_map(|i| (0..3).map(move |bit| (i, bit))) {
        let (a, b) = (corner(i), corner(i | 1 << bit));
        if a.z >= plane {
            hold(a);
        }
        if (a.z - plane) * (b.z - plane) < 0.0 {
            hold(a.lerp(b, (plane - a.z) / (b.z - a.z)));
        }
    }
    if spans[0].0 > spans[0].1 {
        return NOTHING;
    }
    // Turned by the margin, a direction inside the face turns by no more than this about either of its axes.
    let turn = (2f32.sqrt() * seen.margin.sin()).asin();
    let most = std::f32::consts::FRAC_PI_2 - 1e-3;
    let widened = spans.map(|(low, high)| {
        (
            (low.atan() - turn).max(-most).tan(),
            (high.atan() + turn).min(most).tan(),
        )
    });
    let wide = 256 / BLOCKS;
    let high = if horizon < 0.0 { wide } else { 2 * wide };
    let blocks = |(first, last): (u32, u32), of: u32| {
        if first > last {
            (first, last)
        } else {
            (first / of * of, last / of * of + of - 1)
        }
    };
    pack(
        blocks(cells(widened[0], -1.0), wide),
        blocks(cells(widened[1], horizon), high),
    )
}

/// First and last of the cells between `from` and 1 that a span touches; (255, 0) if it touches none.
fn cells((low, high): (f32, f32), from: f32) -> (u32, u32) {
    if low > high || low > 1.0 || high < from {
        return (255, 0);
    }
    let cell = |at: f32, slack: f32| {
        let at = (at - from) / (1.0 - from) * 256.0 + slack;
        at.clamp(0.0, 255.0) as u32
    };
    (cell(low, -0.05), cell(high, 0.05))
}

fn pack((first, last): (u32, u32), (top, bottom): (u32, u32)) -> Asked {
    if first > last || top > bottom {
        return NOTHING;
    }
    first | top << 8 | last << 16 | bottom << 24
}

/// The rectangle around both.
fn join(a: Asked, b: Asked) -> Asked {
    let [a, b] = [a, b].map(u32::to_le_bytes);
    u32::from_le_bytes([
        a[0].min(b[0]),
        a[1].min(b[1]),
        a[2].max(b[2]),
        a[3].max(b[3]),
    ])
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn vector() -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(-1f32..1.0).prop_map(Vec3::from)
    }

    /// Where the shaders look a direction up: face, s, t. None below the horizon.
    fn lookup([x, y, z]: [Vec3; 3], way: Vec3) -> Option<(usize, f32, f32)> {
        let local = Vec3::new(x.dot(way), y.dot(way), z.dot(way));
        let a = local.abs();
        if local.z < 0.0 {
            None
        } else if local.z >= a.x.max(a.y) {
            Some((0, local.x / local.z, local.y / local.z))
        } else if a.x >= a.y {
            let face = if local.x < 0.0 { 2 } else { 1 };
            Some((face, local.y / a.x, local.z / a.x))
        } else {
            let face = if local.y < 0.0 { 4 } else { 3 };
            Some((face, local.x / a.y, local.z / a.y))
        }
    }

    fn holds(asked: Asked, s: f32, t: f32, from: f32) -> bool {
        let [first, top, last, bottom] = asked.to_le_bytes().map(f32::from);
        let column = (s + 1.0) * 128.0;
        let row = (t - from) / (1.0 - from) * 256.0;
        (first..=last + 1.0).contains(&column) && (top..=bottom + 1.0).contains(&row)
    }

    proptest! {
        /// Every direction into a box, or beside it by its margin, is asked for.
        #[test]
        fn what_looks_into_a_box_is_asked_for(
            pole in vector(),
            boxes in prop::collection::vec((vector(), vector(), 0f32..0.5), 1..3),
            inside in prop::collection::vec((vector(), vector()), 40),
        ) {
            let z = pole.normalize_or(Vec3::Y);
            let (x, y) = z.any_orthonormal_pair();
            let boxes: Vec<Seen> = boxes
                .into_iter()
                .map(|(center, extent, margin)| Seen { center: 3.0 * center, extent: extent.abs(), margin })
                .collect();
            let asked = of_hemicube([x, y, z], &boxes);
            for (at, axis) in &inside {
                for seen in &boxes {
                    let way = (seen.center + *at * seen.extent).normalize_or(z);
                    let axis = way.cross(*axis).normalize_or(way.any_orthonormal_vector());
                    let way = glam::Quat::from_axis_angle(axis, seen.margin) * way;
                    if let Some((face, s, t)) = lookup([x, y, z], way) {
                        let from = if face == 0 { -1.0 } else { 0.0 };
                        prop_assert!(holds(asked[face], s, t, from), "face {face}: {s} {t} {:x}", asked[face]);
                    }
                }
            }
        }
    }

    #[test]
    fn what_lies_beside_a_box_is_not_asked_for() {
        let seen = Seen {
            center: Vec3::new(0.0, 0.0, 4.0),
            extent: Vec3::splat(0.4),
            margin: 0.0,
        };
        let [top, sides @ ..] = of_hemicube([Vec3::X, Vec3::Y, Vec3::Z], &[seen]);
        // A ninth of the way to the edge: cells 113 to 142, in whole blocks of 8.
        assert_eq!(top.to_le_bytes(), [112, 112, 143, 143]);
        assert_eq!(sides, [NOTHING; 4]);
        assert_eq!(
            of_map([(-0.5, 0.25), (0.9, 3.0)])[0].to_le_bytes(),
            [63, 243, 160, 255]
        );
    }
}

//! Virtual lights as the shaders read them, and the views that their shadows are looked up in.

use bytemuck::Zeroable;
use glam::Vec3;

use super::asked::{self, Asked, Seen};
use super::{Light, Region, View};
use super::{Parts, Version};
use crate::bake::device::shared::*;
use crate::cluster::{Shape, VirtualLight};
use crate::gpu::Address;
use crate::scene::Bounds;

/// Resolutions of depth maps, pixels along an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::bake) struct ShadowSizes {
    pub indirect: u32,
    pub direct: u32,
    pub sun: u32,
}

/// Bytes of a hemicube of so many pixels along the edge of its top face, and of what hides in its blocks.
pub(in crate::bake) fn hemicube_bytes(size: u32) -> u64 {
    3 * parallel_bytes(size) + 4 * u64::from(VIEW_BLOCKS)
}

/// Bytes of an orthographic map.
pub(in crate::bake) fn parallel_bytes(size: u32) -> u64 {
    4 * u64::from(size) * u64::from(size)
}

impl ShadowSizes {
    /// Pixels along the edge of a light's maps.
    pub(in crate::bake) fn of(&self, light: &VirtualLight) -> u32 {
        match light.shape {
            Shape::Directional { .. } => self.sun,
            _ if light.direct => self.direct,
            _ => self.indirect,
        }
    }
}

/// The scene that a light shines in, as far as its record depends on it.
#[derive(Clone, Copy, Debug)]
pub(in crate::bake) struct Surroundings<'a> {
    pub version: Version,
    /// The version that a difference takes the light away from; the same where the whole light comes or goes.
    pub other: Version,
    /// The version whose map its own begins as: that other one, or that of a light that leaves; its own, where it begins with nothing.
    pub begins: Version,
    /// Of the map, which the light is to reach.
    pub parts: Parts,
    /// What of its views, and of those in the other version, was kept (`KEPT_*`).
    pub kept: [u32; 2],
    /// Where the two differ, receivers whose lookups do included.
    pub regions: &'a [Region],
    /// Where the boxes of what light passes otherwise begin in the batch's list, and how many these are.
    pub first_occluder: u32,
    pub occluders: u32,
    /// Of the whole scene in `version`.
    pub bounds: &'a Bounds,
    /// Percentage-closer soft shadows.
    pub soft: bool,
    /// How far receivers may be moved out of an emitter's plane before they are looked up (VPL13 fig. 8), metres.
    pub moved: f32,
}

/// How far from a receiver's direction a pixel's own ray is at most that the receiver is looked up in, in pixels of 2 / size (the
/// shader's `lookup`): 0.3 for lifting it, 0.75 along either axis for pushing it away from what stands beside it, half a
/// pixel's diagonal, and a little.
const LOOKUP: f32 = 2.2;
/// How far from its own ray a receiver is looked up for a soft shadow, in radii of the emitter: its widest tap at the widest
/// penumbra (the shader's `soft_visibility`: 2 * 0.79), and a little.
const WIDEST_TAP: f32 = 1.7;

/// Of a pixel: how coarse occluders may be.
const COARSE: f32 = 0.5;

/// Appends the views of `light` and returns its record. Where their depth maps are is found out
/// later. `sign`: of whole lights; a difference adds the light as it shines in its version and subtracts it as it shines in the other.
pub(in crate::bake) fn record(
    light: &VirtualLight,
    sign: i32,
    sizes: &ShadowSizes,
    around: &Surroundings,
    views: &mut Vec<View>,
) -> Light {
    let size = sizes.of(light);
    let first_view = views.len();
    let mut out = Light {
        position: light.position.to_array(),
        normal: light.normal.to_array(),
        flux: light.flux.to_array(),
        sign,
        view: first_view as u32,
        other_view: first_view as u32,
        version: around.version,
        other: around.other,
        parts: around.parts.bits(),
        first_region: around.first_occluder,
        regions: around.occluders,
        origin: light.position.to_array(),
        // A pixel of a hemicube spans up to 2 / size of the distance.
        blur_slope: LOOKUP * 2.0 / size as f32,
        ..Light::zeroed()
    };
    let whole = around.version == around.begins;
    let boxes = if whole {
        Vec::new()
    } else {
        seen(light, around, LOOKUP * 2.0 / size as f32)
    };
    let mut hemicube = |pole: Vec3, cos_cone: f32| {
        let (x, y) = pole.any_orthonormal_pair();
        views.push(View {
            origin: light.position.to_array(),
            x: x.to_array(),
            y: y.to_array(),
            z: pole.to_array(),
            depth: Address::default(),
            size,
            kind: VIEW_HEMICUBE,
            cos_cone,
            coarse: if light.direct { 0.0 } else { coarse(size) },
            version: around.version,
            other: around.begins,
            base: 0,
            kept: around.kept[0],
            asked: if whole {
                [asked::ALL; FACES as usize]
            } else {
                asked::of_hemicube([x, y, pole], &boxes)
            },
        });
    };
    match &light.shape {
        Shape::Polygon { vertices } => {
            out.kind = LIGHT_POLYGON;
            out.vertices = vertices.len() as u32;
            for (to, from) in out.vertex.iter_mut().zip(vertices) {
                *to = from.to_array();
            }
            out.area = polygon_area(vertices);
            let center = vertices.iter().sum::<Vec3>() / vertices.len() as f32;
            out.position = center.to_array();
            out.radius = radius(light);
            hemicube(light.surface, 0.0);
        }
        Shape::Disk { area } => {
            out.kind = LIGHT_DISK;
            out.area = *area;
            hemicube(light.surface, 0.0);
        }
        Shape::Point => {
            out.kind = LIGHT_POINT;
            out.spot_offset = 1.0;
            hemicube(Vec3::Z, 0.0);
            hemicube(Vec3::NEG_Z, 0.0);
        }
        Shape::Spot { inner, outer } => {
            out.kind = LIGHT_SPOT;
            out.spot_scale = 1.0 / (inner.cos() - outer.cos()).max(1e-3);
            out.spot_offset = -outer.cos() * out.spot_scale;
            hemicube(light.normal, outer.cos());
        }
        Shape::Directional { .. } => {
            out.kind = LIGHT_DIRECTIONAL;
            let (view, pixel) = parallel_view(light.normal, size, around);
            views.push(view);
            out.blur = LOOKUP * pixel;
            out.blur_slope = 0.0;
        }
    }
    if around.soft {
        out.blur += 2.0 * out.radius;
    }
    if !whole {
        let second = views.len();
        if around.version != around.other {
            out.other_view = second as u32;
        }
        views.extend_from_within(first_view..);
        let (own, others) = views[first_view..].split_at_mut(second - first_view);
        let apart = own.len() as i32;
        for (view, other) in own.iter_mut().zip(others) {
            if matches!(view.kept, KEPT_BESIDE | KEPT_BOTH) {
                view.base = apart;
            }
            std::mem::swap(&mut other.version, &mut other.other);
            other.kept = around.kept[1];
            if other.kept != KEPT_ALL {
                other.base = -apart;
            }
        }
    }
    out
}

/// How coarse what an indirect light's hemicube shows may be, per metre of distance: a share of a pixel, which spans 2 / size in
/// the middle of a face. See the measurements in benches/README.md.
pub(in crate::bake) fn coarse(size: u32) -> f32 {
    COARSE * 2.0 / size as f32
}

/// The radius of a polygon's circumcircle around its centre; other lights cast the shadows of points.
fn radius(light: &VirtualLight) -> f32 {
    match &light.shape {
        Shape::Polygon { vertices } => {
            let center = vertices.iter().sum::<Vec3>() / vertices.len() as f32;
            let far = vertices.iter().map(|v| v.distance(center));
            far.fold(0.0, f32::max)
        }
        _ => 0.0,
    }
}

/// How far receivers in a region may be moved before they are looked up: those within half a texel of an emitter's plane are.
fn moved(light: &VirtualLight, around: &Surroundings, region: &Region) -> f32 {
    let center = match &light.shape {
        Shape::Polygon { vertices } => vertices.iter().sum::<Vec3>() / vertices.len() as f32,
        Shape::Disk { .. } => light.position,
        _ => return 0.0,
    };
    let way = Vec3::from(region.center) - center;
    let reach = light.normal.abs().dot(Vec3::from(region.extent));
    // Half a texel is an eighth of the furthest move.
    let near = light.normal.dot(way).abs() <= reach + around.moved / 4.0 + 1e-4 * way.length();
    if near { around.moved } else { 0.0 }
}

/// Boxes from a light that hold all lookups that can see the regions, or are of receivers in them; of receivers with several
/// taps all, if one can. `margin`: of a lookup, radians.
///
/// What changed is no nearer than its region, and hides nothing of what is nearer than half of that (the shader's
/// `soft_visibility`). So the taps of a receiver to which a region matters lie no further from each other than twice the widest
/// tap's angle at half the region's distance.
fn seen(light: &VirtualLight, around: &Surroundings, margin: f32) -> Vec<Seen> {
    let radius = if around.soft { radius(light) } else { 0.0 };
    let regions = around.regions.iter().map(|r| {
        let center = Vec3::from(r.center) - light.position;
        let extent = Vec3::from(r.extent) + moved(light, around, r);
        let nearest = (center.abs() - extent).max(Vec3::ZERO).length();
        let taps = if nearest > 0.0 {
            2.0 * (WIDEST_TAP * radius / (0.5 * nearest)).atan()
        } else {
            f32::INFINITY
        };
        // From what is seen to the receiver, and from there to its other taps.
        let margin = if around.soft {
            2.0 * margin + taps
        } else {
            margin
        };
        Seen {
            center,
            extent,
            margin,
        }
    });
    regions.collect()
}

/// Whether nothing in the regions can receive a light's light or be seen in its views: all of them lie behind its surface, or
/// outside of its cone, by more than its lookups reach. `epsilon`: half a texel, metres.
pub(in crate::bake) fn misses(
    light: &VirtualLight,
    sizes: &ShadowSizes,
    regions: &[Region],
    epsilon: f32,
) -> bool {
    let size = sizes.of(light);
    let slack = 2.0 * epsilon;
    // Receivers are moved out of the emitter's plane, which need not be the surface's.
    let moved = if light.surface == light.normal {
        0.0
    } else {
        8.0 * epsilon
    };
    // The view looks from the position, a polygon's plane is its vertices'.
    let behind = |from: Vec3| {
        regions.iter().all(|r| {
            let reach = light.surface.abs().dot(Vec3::from(r.extent)) + slack + moved;
            let away = light.surface.dot(Vec3::from(r.center) - from);
            away + reach + 1e-4 * from.distance(Vec3::from(r.center)) < 0.0
        })
    };
    match &light.shape {
        Shape::Polygon { vertices } => {
            behind(light.position) && vertices.iter().all(|v| behind(*v))
        }
        Shape::Disk { .. } => behind(light.position),
        Shape::Spot { outer, .. } => regions.iter().all(|r| {
            let way = Vec3::from(r.center) - light.position;
            let sphere = Vec3::from(r.extent).length() + slack;
            let margin = 2.0 * LOOKUP * 2.0 / size as f32 + 1e-3;
            sphere < way.length()
                && way.angle_between(light.normal) > outer + (sphere / way.length()).asin() + margin
        }),
        Shape::Point | Shape::Directional { .. } => false,
    }
}

/// What is asked of an orthographic map: the regions, and a few pixels beside them.
fn rectangle(
    origin: Vec3,
    axes: [Vec3; 2],
    around: &Surroundings,
    size: u32,
) -> [Asked; FACES as usize] {
    if around.version == around.begins {
        return [asked::ALL; FACES as usize];
    }
    let margin = 4.0 * LOOKUP / size as f32;
    asked::of_map(axes.map(|axis| {
        around
            .regions
            .iter()
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), r| {
                let at = axis.dot(Vec3::from(r.center) - origin);
                let half = axis.abs().dot(Vec3::from(r.extent)) + margin;
                (low.min(at - half), high.max(at + half))
            })
    }))
}

/// A square map over the whole scene, looking along `direction`, and the larger edge of its pixels in metres; the stored
/// value grows towards the light.
fn parallel_view(direction: Vec3, size: u32, around: &Surroundings) -> (View, f32) {
    let z = -direction;
    let (x, y) = z.any_orthonormal_pair();
    let half = around.bounds.size() * 0.5005 + Vec3::splat(1e-4);
    let reach = |axis: Vec3| axis.abs().dot(half);
    let origin = around.bounds.center() - z * reach(z);
    let view = View {
        origin: origin.to_array(),
        x: (x / reach(x)).to_array(),
        y: (y / reach(y)).to_array(),
        z: (z / (2.0 * reach(z))).to_array(),
        depth: Address::default(),
        size,
        kind: VIEW_ORTHOGRAPHIC,
        cos_cone: -1.0,
        coarse: 0.0,
        version: around.version,
        other: around.begins,
        base: 0,
        kept: around.kept[0],
        asked: rectangle(origin, [x / reach(x), y / reach(y)], around, size),
    };
    (view, 2.0 * reach(x).max(reach(y)) / size as f32)
}

fn polygon_area(vertices: &[Vec3]) -> f32 {
    let Some((first, rest)) = vertices.split_first() else {
        return 0.0;
    };
    let sum: Vec3 = rest
        .windows(2)
        .map(|w| (w[0] - *first).cross(w[1] - *first))
        .sum();
    0.5 * sum.length()
}

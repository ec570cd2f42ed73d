//! Places on surfaces: there the light of virtual lights is compared, to tell how much an update shows. Rays of the lights find them,
//! and rays of who looks.

use std::f32::consts::PI;

use glam::Vec3;

use super::eye::Eye;
use super::sight::Division;
use crate::cluster::evaluate::{DISK_AREA_TERM, polygon_factor};
use crate::cluster::{Shape, VirtualLight};
use crate::scene::Scene;
use crate::transport::bvh::{Hit, SceneBvh};
use crate::transport::intersect::offset;

/// Places in the picture of who looks that each light is asked about.
pub(super) const LOOKS: usize = 6;
/// Radii of a polygon within which it is more than its middle.
const NEAR: f32 = 2.5;

/// The scene around lights.
#[derive(Clone, Copy)]
pub(in crate::bake) struct Around<'a> {
    pub(super) scene: &'a Scene,
    pub(super) bvh: &'a SceneBvh,
    /// Along its box, metres.
    size: Vec3,
    /// How wide the map's texels are, metres.
    pub(super) texel: f32,
    /// The parts of the map, if somebody looks.
    pub(super) division: Option<Division<'a>>,
}

/// A place on a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub point: Vec3,
    /// Unit, on the side that is asked about.
    pub normal: Vec3,
    /// How much it counts for who looks.
    pub weight: f32,
    /// How densely one ray of who looks falls there, 1/m².
    pub looked: f32,
    /// Which part of the map it lies in.
    pub part: usize,
}

impl<'a> Around<'a> {
    /// `texel`: how wide the map's are, metres; `division`: its parts, if somebody looks.
    pub fn new(
        scene: &'a Scene,
        bvh: &'a SceneBvh,
        texel: f32,
        division: Option<Division<'a>>,
    ) -> Self {
        Self {
            scene,
            bvh,
            size: scene.bounds().size(),
            texel,
            division,
        }
    }

    /// The length of the scene's diagonal, metres.
    pub(super) fn far(&self) -> f32 {
        self.size.length().max(1e-6)
    }

    /// The area of surfaces that parallel light falls on, m²: a box shows a quarter of its surface.
    pub(super) fn even(&self) -> f64 {
        let size = self.size;
        f64::from(0.5 * (size.x * size.y + size.y * size.z + size.z * size.x))
    }

    pub(super) fn closest(&self, origin: Vec3, direction: Vec3, far: f32) -> Option<Hit> {
        self.bvh.closest(self.scene, origin, direction, far)
    }

    /// Whether something stands between two points.
    pub(super) fn hidden(&self, from: Vec3, to: Vec3) -> bool {
        let (direction, distance) = (to - from).normalize_and_length();
        (self.bvh).occluded(self.scene, from, direction, distance)
    }

    /// Where a ray has hit.
    pub(super) fn place(&self, eye: Option<&Eye>, hit: &Hit) -> Place {
        let (point, normal) = (hit.position, hit.normal);
        let weight = eye.map_or(1.0, |eye| eye.weight(self.scene, self.bvh, point, normal));
        self.counting(eye, hit, weight)
    }

    /// Some places in the picture of who looks, other ones for each light of a cell.
    pub(super) fn looked(&self, eye: Option<&Eye>, index: usize) -> impl Iterator<Item = Place> {
        let seen = eye.into_iter().flat_map(move |eye| eye.seen(LOOKS * index));
        let few = seen.take(LOOKS);
        few.map(move |(hit, weight)| self.counting(eye, hit, *weight))
    }

    fn counting(&self, eye: Option<&Eye>, hit: &Hit, weight: f32) -> Place {
        Place {
            point: hit.position,
            normal: if hit.front { hit.normal } else { -hit.normal },
            weight,
            looked: eye.map_or(0.0, |eye| eye.density(weight)),
            part: self.division.map_or(1, |division| division.part(hit)),
        }
    }
}

/// How large an emitter is for what is near it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    /// Added to distances squared, m²: nothing is lit more than beside the emitter's middle, and no texel tells more than it spans.
    soft: f32,
    /// Within this distance squared a polygon is more than its middle.
    near: f32,
}

impl Size {
    pub const NONE: Self = Self {
        soft: 0.0,
        near: 0.0,
    };

    /// `texel`: how wide the map's are, metres.
    pub fn new(light: &VirtualLight, texel: f32) -> Self {
        let (area, near) = match &light.shape {
            Shape::Disk { area } => (DISK_AREA_TERM * *area, 0.0),
            Shape::Polygon { vertices } => {
                let far = vertices.iter().map(|v| v.distance_squared(light.position));
                let radius = far.fold(0.0, f32::max);
                (PI * radius, NEAR * NEAR * radius)
            }
            _ => (0.0, 0.0),
        };
        Self {
            soft: (area + texel * texel) / PI,
            near,
        }
    }
}

/// Where a light's rays start.
pub(super) fn source(light: &VirtualLight) -> Vec3 {
    match light.shape {
        Shape::Point | Shape::Spot { .. } => light.position,
        _ => offset(light.position, light.surface),
    }
}

/// Irradiance that a unit of a light's flux or intensity causes at a place, if it sees it, and how densely one of its rays falls there,
/// 1/m², if they are drawn as it shines. Nothing of parallel light.
pub(super) fn falls(light: &VirtualLight, size: &Size, place: &Place) -> [f32; 2] {
    let way = place.point - light.position;
    let squared = way.length_squared().max(1e-12);
    let direction = way / squared.sqrt();
    let [arriving, dense] = {
        let cosine = (-place.normal.dot(direction)).max(0.0);
        [cosine / (squared + size.soft), cosine / squared]
    };
    let cosine = light.normal.dot(direction);
    match &light.shape {
        Shape::Directional { .. } => [0.0; 2],
        Shape::Point => [arriving, dense / (4.0 * PI)],
        Shape::Spot { outer, .. } => {
            let lit = f32::from(cosine > outer.cos());
            let cone = 2.0 * PI * (1.0 - outer.cos());
            [lit * arriving, lit * dense / cone]
        }
        Shape::Polygon { vertices } if squared < size.near => {
            let factor = polygon_factor(vertices, light.normal, place.point, place.normal);
            [factor, cosine.max(0.0) * dense / PI]
        }
        _ => [arriving, dense].map(|part| cosine.max(0.0) * part / PI),
    }
}

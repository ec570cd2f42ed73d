//! What a camera sees of the scene: what is wrong there is put right first.

use glam::{Affine3A, Vec3};

use crate::scene::{Camera, Scene};
use crate::transport::SceneBvh;
use crate::transport::bvh::Hit;
use crate::transport::intersect::offset;

/// Width and height of the pictures that what is seen is judged by.
pub(in crate::bake) const PICTURE: [u32; 2] = [320, 180];
/// The one over the other.
pub(in crate::bake) const ASPECT: f32 = PICTURE[0] as f32 / PICTURE[1] as f32;

/// How much what is not seen counts, of what is: somebody will look there too.
pub(super) const UNSEEN: f32 = 0.005;
/// Rays that tell which surfaces the picture shows.
const LOOKS: u32 = 512;
/// By how much of the scene's size, and by what angle, radians, a camera moves before it counts as another one.
const STEP: f32 = 0.01;
const TURN: f32 = 0.1;

/// A camera, ready to be asked about points.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::bake) struct Eye {
    place: Vec3,
    to_camera: Affine3A,
    /// Half the picture's height, a unit away.
    half: f32,
    /// What a pixel of the picture's middling surface covers, m², if pixels took a unit of the picture a unit away; none before it was
    /// looked at.
    middling: Option<f32>,
    /// What rays through the picture have met, and how much it counts; any few in a row are spread over all of it.
    seen: Vec<(Hit, f32)>,
}

impl Eye {
    pub fn new(camera: &Camera) -> Self {
        Self {
            place: camera.transform.translation.into(),
            to_camera: camera.transform.inverse(),
            half: (0.5 * camera.fov_y).tan(),
            middling: None,
            seen: Vec::new(),
        }
    }

    /// Finds out what is in the picture by now.
    pub fn look(&mut self, scene: &Scene, bvh: &SceneBvh) {
        let from_camera = self.to_camera.inverse();
        let far = 4.0 * scene.bounds().size().length();
        let rays = (0..LOOKS).filter_map(|i| {
            // Powers of the inverse plastic number: even in both directions.
            let part = |step: f32| 2.0 * ((i as f32 + 0.5) * step).fract() - 1.0;
            let (x, y) = (part(0.754_877_7) * ASPECT, part(0.569_840_3));
            let local = Vec3::new(x * self.half, y * self.half, -1.0);
            let direction = from_camera.transform_vector3(local).normalize();
            let hit = bvh.closest(scene, self.place, direction, far)?;
            Some((hit, self.pixels(hit.position, hit.normal)))
        });
        let mut seen: Vec<(Hit, f32)> = rays.filter(|(_, pixels)| *pixels > 0.0).collect();
        let mut found: Vec<f32> = seen.iter().map(|(_, pixels)| 1.0 / pixels).collect();
        found.sort_unstable_by(f32::total_cmp);
        let middling =
            *(self.middling).get_or_insert(found.get(found.len() / 2).copied().unwrap_or(1.0));
        for (_, weight) in &mut seen {
            *weight = (middling * *weight).max(UNSEEN);
        }
        self.seen = seen;
    }

    /// What rays through the picture have met, from the `first` on, and how much it counts.
    pub fn seen(&self, first: usize) -> impl Iterator<Item = &(Hit, f32)> {
        let first = first % self.seen.len().max(1);
        self.seen[first..].iter().chain(&self.seen[..first])
    }

    /// How densely one ray through the picture falls on a surface that counts this much, 1/m².
    pub fn density(&self, weight: f32) -> f32 {
        let picture = 4.0 * self.half * self.half * ASPECT;
        match self.middling {
            Some(middling) if weight > UNSEEN => weight / (middling * picture),
            _ => 0.0,
        }
    }

    /// The picture that a square metre of a surface takes, if it is in it and nothing stands before it, in units a unit away.
    fn pixels(&self, point: Vec3, normal: Vec3) -> f32 {
        let way = self.place - point;
        let squared = way.length_squared().max(1e-12);
        let ahead = (-self.to_camera.transform_point3(point).z).max(0.0) / squared.sqrt();
        normal.dot(way).abs() / (squared * squared.sqrt() * ahead.powi(3)).max(1e-12)
    }

    /// Whether it sees much the same as another one, in a scene of this size, metres.
    pub fn is_like(&self, other: &Self, size: f32) -> bool {
        let back = |eye: &Self| eye.to_camera.inverse().matrix3.z_axis;
        self.place.distance(other.place) <= STEP * size && back(self).distance(back(other)) <= TURN
    }

    /// How much a point of a surface with this normal counts: by the pixels that it takes for its size, those of the picture's middling
    /// surface being 1.
    pub fn weight(&self, scene: &Scene, bvh: &SceneBvh, point: Vec3, normal: Vec3) -> f32 {
        let local = self.to_camera.transform_point3(point);
        let (right, up) = (-self.half * ASPECT * local.z, -self.half * local.z);
        let framed = local.z < 0.0 && local.x.abs() <= right && local.y.abs() <= up;
        let front = if normal.dot(self.place - point) < 0.0 {
            -normal
        } else {
            normal
        };
        let origin = offset(point, front);
        let (direction, distance) = (self.place - origin).normalize_and_length();
        if framed && !bvh.occluded(scene, origin, direction, distance) {
            let middling = self.middling.unwrap_or(1.0);
            (middling * self.pixels(point, normal)).max(UNSEEN)
        } else {
            UNSEEN
        }
    }
}

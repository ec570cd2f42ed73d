//! What a camera sees of the scene: what is wrong there is put right first.

use glam::{Affine3A, Vec3};

use crate::scene::{Camera, Scene};
use crate::transport::SceneBvh;
use crate::transport::intersect::offset;

/// Width and height of the pictures that what is seen is judged by.
pub(in crate::bake) const PICTURE: [u32; 2] = [320, 180];
/// The one over the other.
pub(in crate::bake) const ASPECT: f32 = PICTURE[0] as f32 / PICTURE[1] as f32;

/// How much what is not seen counts, of what is: somebody will look there too.
pub(super) const UNSEEN: f32 = 0.005;
/// How much more than the picture's middling surface any counts at most: few rays tell, and not one of them is to decide.
const CLOSEST: f32 = 16.0;
/// Columns and rows of the rays that tell which that is.
const GRID: [u32; 2] = [16, 9];
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
    /// Distance squared over cosine of the picture's middling surface; none before it was looked at.
    middling: Option<f32>,
}

impl Eye {
    pub fn new(camera: &Camera) -> Self {
        Self {
            place: camera.transform.translation.into(),
            to_camera: camera.transform.inverse(),
            half: (0.5 * camera.fov_y).tan(),
            middling: None,
        }
    }

    /// Finds out how large the surfaces are in the picture.
    pub fn look(&mut self, scene: &Scene, bvh: &SceneBvh) {
        let from_camera = self.to_camera.inverse();
        let far = 4.0 * scene.bounds().size().length();
        let pixels = (0..GRID[0]).flat_map(|x| (0..GRID[1]).map(move |y| (x, y)));
        let mut found: Vec<f32> = pixels
            .filter_map(|(x, y)| {
                let part = |i: u32, n: u32| 2.0 * (i as f32 + 0.5) / n as f32 - 1.0;
                let (x, y) = (part(x, GRID[0]) * ASPECT, part(y, GRID[1]));
                let local = Vec3::new(x * self.half, y * self.half, -1.0);
                let direction = from_camera.transform_vector3(local).normalize();
                let hit = bvh.closest(scene, self.place, direction, far)?;
                Some(hit.t * hit.t / hit.normal.dot(direction).abs().max(1e-3))
            })
            .collect();
        found.sort_unstable_by(f32::total_cmp);
        self.middling = found.get(found.len() / 2).copied();
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
        let way = self.place - point;
        let front = if normal.dot(way) < 0.0 {
            -normal
        } else {
            normal
        };
        let origin = offset(point, front);
        let (direction, distance) = (self.place - origin).normalize_and_length();
        if framed && !bvh.occluded(scene, origin, direction, distance) {
            let pixels = front.dot(direction).max(0.0) / (distance * distance);
            let share = self.middling.map_or(1.0, |middling| middling * pixels);
            share.clamp(UNSEEN, CLOSEST)
        } else {
            UNSEEN
        }
    }
}

//! Where the picture is taken from, and the two ways of moving: flying, and circling around a point.

use glam::camera::rh::proj::directx;
use glam::{Affine3A, Mat3, Mat4, Quat, Vec2, Vec3};

use crate::scene::{Bounds, Camera};

/// Steepest look up or down, radians: a little short of the vertical, where left and right would be lost.
const STEEPEST: f32 = 1.55;
/// Vertical field of view of cameras that bring none, radians.
pub const FOV_Y: f32 = 0.9;

/// A place to look from. Turns are around Y and then around the camera's own X: the horizon stays level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// World, metres.
    pub position: Vec3,
    /// Around Y, radians: 0 looks along -Z, a quarter turn along -X.
    pub yaw: f32,
    /// Upwards, radians.
    pub pitch: f32,
    /// Vertical field of view, radians.
    pub fov_y: f32,
    /// Metres to what is looked at: the centre that orbiting circles around.
    pub distance: f32,
}

/// What the keys ask for: each axis between -1 and 1, in the camera's own directions but for `rise`, which is the world's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Ahead.
    pub ahead: f32,
    /// To the right.
    pub right: f32,
    /// Up.
    pub rise: f32,
}

impl Pose {
    /// Looks from `position` to `target`.
    pub fn looking(position: Vec3, target: Vec3, fov_y: f32) -> Self {
        let to = target - position;
        let distance = to.length();
        let d = to.try_normalize().unwrap_or(Vec3::NEG_Z);
        Self {
            position,
            yaw: if d.x == 0.0 && d.z == 0.0 {
                0.0
            } else {
                (-d.x).atan2(-d.z)
            },
            pitch: d.y.clamp(-1.0, 1.0).asin().clamp(-STEEPEST, STEEPEST),
            fov_y,
            distance: distance.max(1e-3),
        }
    }

    /// A camera of the file; `distance` metres in front of it is what orbiting circles around. A tilted horizon is levelled.
    pub fn of(camera: &Camera, distance: f32) -> Self {
        let position = Vec3::from(camera.transform.translation);
        let ahead = -Vec3::from(camera.transform.matrix3.z_axis).normalize_or(Vec3::Z);
        Self::looking(position, position + ahead * distance, camera.fov_y)
    }

    /// The camera that it is.
    pub fn camera(&self) -> Camera {
        Camera {
            name: String::new(),
            transform: Affine3A::from_rotation_translation(self.rotation(), self.position),
            fov_y: self.fov_y,
        }
    }

    /// Camera space to world space.
    pub fn rotation(&self) -> Quat {
        Quat::from_rotation_y(self.yaw) * Quat::from_rotation_x(self.pitch)
    }

    /// Unit vector to where it looks.
    pub fn ahead(&self) -> Vec3 {
        self.rotation() * Vec3::NEG_Z
    }

    /// The point that orbiting circles around.
    pub fn target(&self) -> Vec3 {
        self.position + self.ahead() * self.distance
    }

    /// World space to clip space for pictures `aspect` times as wide as high: depth is 1 at `near` metres and goes to 0 at
    /// infinity, where floats are finest.
    pub fn clip(&self, aspect: f32, near: f32) -> Mat4 {
        let view = Mat4::from_rotation_translation(self.rotation(), self.position).inverse();
        directx::perspective_infinite_reverse(self.fov_y, aspect, near) * view
    }

    /// The ray through a point of the picture: `at` from (-1, -1) bottom left to (1, 1) top right. Origin, unit direction.
    pub fn ray(&self, at: Vec2, aspect: f32) -> (Vec3, Vec3) {
        let half = (0.5 * self.fov_y).tan();
        let local = Vec3::new(at.x * half * aspect, at.y * half, -1.0);
        (self.position, (self.rotation() * local).normalize())
    }

    /// Turns the head: radians to the left and up.
    pub fn turn(&mut self, left: f32, up: f32) {
        self.yaw = (self.yaw + left).rem_euclid(std::f32::consts::TAU);
        self.pitch = (self.pitch + up).clamp(-STEEPEST, STEEPEST);
    }

    /// Flies `metres` the way that `motion` says.
    pub fn fly(&mut self, motion: Motion, metres: f32) {
        let axes = Mat3::from_quat(self.rotation());
        let way = axes * Vec3::new(motion.right, 0.0, -motion.ahead) + Vec3::Y * motion.rise;
        self.position += way.clamp_length_max(1.0) * metres;
    }

    /// Circles around [`Pose::target`].
    pub fn orbit(&mut self, left: f32, up: f32) {
        let target = self.target();
        self.turn(left, up);
        self.position = target - self.ahead() * self.distance;
    }

    /// Shifts the picture, by shares of its height at the target: `right` moves the camera to the right.
    pub fn pan(&mut self, right: f32, up: f32) {
        let height = 2.0 * self.distance * (0.5 * self.fov_y).tan();
        self.position += self.rotation() * Vec3::new(right, up, 0.0) * height;
    }

    /// Goes towards [`Pose::target`]: a factor below 1 comes nearer.
    pub fn zoom(&mut self, factor: f32) {
        let target = self.target();
        self.distance = (self.distance * factor).clamp(1e-3, 1e6);
        self.position = target - self.ahead() * self.distance;
    }

    /// Steps back, looking the same way, until a box fills most of the picture.
    pub fn focus(&mut self, bounds: &Bounds, aspect: f32) {
        let radius = (0.5 * bounds.size().length()).max(1e-2);
        let half = (0.5 * self.fov_y).tan() * aspect.min(1.0);
        self.distance = 1.15 * radius / half.atan().sin();
        self.position = bounds.center() - self.ahead() * self.distance;
    }

    /// On the way to another pose, `share` between 0 and 1; the short way round.
    pub fn towards(&self, other: &Self, share: f32) -> Self {
        let turn = (other.yaw - self.yaw + std::f32::consts::PI).rem_euclid(std::f32::consts::TAU)
            - std::f32::consts::PI;
        let mix = |a: f32, b: f32| a + (b - a) * share;
        Self {
            position: self.position.lerp(other.position, share),
            yaw: (self.yaw + turn * share).rem_euclid(std::f32::consts::TAU),
            pitch: mix(self.pitch, other.pitch),
            fov_y: mix(self.fov_y, other.fov_y),
            distance: mix(self.distance, other.distance),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: Vec3, b: Vec3) {
        assert!((a - b).length() < 1e-4, "{a} {b}");
    }

    #[test]
    fn looks_where_it_is_told() {
        for target in [
            Vec3::new(3.0, 1.0, -2.0),
            Vec3::X,
            Vec3::Z,
            Vec3::NEG_Z,
            Vec3::new(-1.0, -2.0, 5.0),
        ] {
            let pose = Pose::looking(Vec3::new(0.5, 0.25, 0.0), target, 1.0);
            near(pose.target(), target);
        }
        // Straight up cannot be looked: nearly can.
        let up = Pose::looking(Vec3::ZERO, Vec3::Y, 1.0);
        assert!(up.ahead().y > 0.999 && up.ahead().is_finite());
    }

    #[test]
    fn a_ray_goes_through_the_pixel_that_its_points_are_seen_at() {
        let pose = Pose::looking(Vec3::new(1.0, 2.0, 3.0), Vec3::new(-2.0, 0.0, 1.0), 0.8);
        for at in [Vec2::ZERO, Vec2::new(0.9, -0.7), Vec2::new(-0.3, 0.5)] {
            let (origin, direction) = pose.ray(at, 16.0 / 9.0);
            let clip = pose.clip(16.0 / 9.0, 0.01) * (origin + 7.0 * direction).extend(1.0);
            let seen = Vec2::new(clip.x, clip.y) / clip.w;
            assert!((seen - at).length() < 1e-4, "{seen} {at}");
            assert!(clip.z > 0.0 && clip.z < clip.w);
        }
    }

    #[test]
    fn orbiting_and_zooming_keep_the_target_and_flying_the_direction() {
        let mut pose = Pose::looking(Vec3::new(4.0, 1.0, 0.0), Vec3::new(0.0, 1.0, 0.0), 0.9);
        let target = pose.target();
        pose.orbit(0.7, 0.3);
        pose.orbit(-2.0, 9.0);
        near(pose.target(), target);
        pose.zoom(0.5);
        near(pose.target(), target);
        assert!((pose.distance - 2.0).abs() < 1e-5);
        let (before, ahead) = (pose.position, pose.ahead());
        let motion = Motion {
            ahead: 1.0,
            ..Motion::default()
        };
        pose.fly(motion, 3.0);
        near(pose.position, before + 3.0 * ahead);
    }

    #[test]
    fn focusing_shows_all_of_a_box() {
        let bounds = Bounds {
            min: Vec3::new(1.0, 1.0, 1.0),
            max: Vec3::new(3.0, 2.0, 5.0),
        };
        let mut pose = Pose::looking(Vec3::ZERO, Vec3::new(1.0, 0.2, -1.0), 0.9);
        for aspect in [1.7, 0.6] {
            pose.focus(&bounds, aspect);
            for i in 0..8 {
                let pick = |bit: usize, a: f32, b: f32| if i >> bit & 1 == 0 { a } else { b };
                let corner = Vec3::new(
                    pick(0, bounds.min.x, bounds.max.x),
                    pick(1, bounds.min.y, bounds.max.y),
                    pick(2, bounds.min.z, bounds.max.z),
                );
                let clip = pose.clip(aspect, 0.01) * corner.extend(1.0);
                assert!(clip.x.abs() < clip.w && clip.y.abs() < clip.w, "{corner}");
            }
        }
    }

    #[test]
    fn a_walk_takes_the_short_way_round() {
        let a = Pose {
            yaw: 0.1,
            ..Pose::looking(Vec3::ZERO, Vec3::NEG_Z, 1.0)
        };
        let b = Pose {
            yaw: std::f32::consts::TAU - 0.1,
            position: Vec3::X,
            ..a
        };
        let half = a.towards(&b, 0.5);
        assert!(half.yaw.min(std::f32::consts::TAU - half.yaw) < 1e-5);
        near(half.position, 0.5 * Vec3::X);
        near(a.towards(&b, 1.0).ahead(), b.ahead());
    }
}

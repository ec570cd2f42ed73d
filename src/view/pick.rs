//! What lies under the cursor: lights by their marks on the screen, objects by a ray.

use egui::{Pos2, Rect};
use glam::{Mat4, Vec2, Vec3};

use super::camera::Pose;
use crate::scene::{Aperture, Scene};
use crate::transport::SceneBvh;

/// Points from a light's mark that a click may be off by.
const REACH: f32 = 14.0;

/// Where a point of the world is seen on the screen; none behind the camera.
pub fn project(clip: &Mat4, screen: Rect, at: Vec3) -> Option<Pos2> {
    let c = *clip * at.extend(1.0);
    (c.w > 0.0 && c.z < c.w).then(|| {
        let x = screen.min.x + screen.width() * (0.5 + 0.5 * c.x / c.w);
        let y = screen.min.y + screen.height() * (0.5 - 0.5 * c.y / c.w);
        Pos2::new(x, y)
    })
}

/// A point of the screen from (-1, -1) bottom left to (1, 1) top right.
pub fn centered(screen: Rect, at: Pos2) -> Vec2 {
    let share = (at - screen.min) / screen.size();
    Vec2::new(2.0 * share.x - 1.0, 1.0 - 2.0 * share.y)
}

/// Where the mark of a punctual light is: suns stand over the middle of the scene.
pub fn light_mark(scene: &Scene, light: usize, bounds: &crate::scene::Bounds) -> Option<Vec3> {
    let light = &scene.lights[light];
    match light.aperture {
        Aperture::Point | Aperture::Spot { .. } => Some(light.transform.translation.into()),
        Aperture::Directional => {
            let from = Vec3::from(light.transform.matrix3.z_axis).normalize_or(Vec3::Y);
            Some(bounds.center() + from * 0.5 * bounds.size().length())
        }
        Aperture::Surface { .. } => None,
    }
}

/// The node under a point of the screen.
pub fn pick(
    scene: &Scene,
    bvh: Option<&SceneBvh>,
    bounds: &crate::scene::Bounds,
    pose: &Pose,
    clip: &Mat4,
    screen: Rect,
    at: Pos2,
) -> Option<u32> {
    let lights = (0..scene.lights.len()).filter_map(|l| {
        let mark = project(clip, screen, light_mark(scene, l, bounds)?)?;
        let off = mark.distance(at);
        (off < REACH).then_some((off, scene.lights[l].node))
    });
    if let Some((_, node)) = lights.min_by(|a, b| a.0.total_cmp(&b.0)) {
        return Some(node);
    }
    let (origin, direction) = pose.ray(centered(screen, at), screen.width() / screen.height());
    let hit = visible(scene, bvh?, origin, direction)?;
    Some(scene.objects[hit as usize].node)
}

/// The first object along a ray whose side there is drawn: backs of single-sided surfaces are not.
fn visible(scene: &Scene, bvh: &SceneBvh, mut origin: Vec3, direction: Vec3) -> Option<u32> {
    for _ in 0..64 {
        let hit = bvh.closest(scene, origin, direction, f32::INFINITY)?;
        if hit.front || scene.materials[hit.material as usize].double_sided {
            return Some(hit.object);
        }
        // On, a little behind the surface.
        origin += direction * (hit.t * (1.0 + 1e-5) + 1e-5);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builtin;

    #[test]
    fn finds_what_is_drawn_under_a_point() {
        let (scene, _) = builtin::open("cornell").unwrap();
        let bvh = SceneBvh::build(&scene);
        let bounds = scene.bounds();
        let screen = Rect::from_min_size(Pos2::ZERO, egui::vec2(1280.0, 720.0));
        // From behind the camera's side of the box, which shows no wall from there.
        let pose = Pose::looking(Vec3::new(0.0, 1.0, 4.0), Vec3::new(0.0, 1.0, 0.0), 0.7);
        let clip = pose.clip(screen.width() / screen.height(), 0.01);
        for (o, object) in scene.objects.iter().enumerate() {
            if !object.name.contains("box") {
                continue;
            }
            let b = scene.object_bounds(o as u32);
            let at = project(&clip, screen, b.center()).expect("in front");
            let node = pick(&scene, Some(&bvh), &bounds, &pose, &clip, screen, at);
            let name = node.map(|n| {
                let found = scene.objects.iter().find(|o| o.node == n);
                found.map_or("a light", |o| o.name.as_str())
            });
            assert!(name.is_some_and(|n| n.contains("box")), "{name:?}");
        }
        let nowhere = pick(
            &scene,
            Some(&bvh),
            &bounds,
            &pose,
            &clip,
            screen,
            Pos2::new(5.0, 5.0),
        );
        assert_eq!(nowhere, None);
    }

    #[test]
    fn projecting_undoes_the_ray() {
        let screen = Rect::from_min_size(Pos2::new(100.0, 20.0), egui::vec2(640.0, 480.0));
        let pose = Pose::looking(Vec3::ZERO, Vec3::new(1.0, 0.3, -2.0), 0.8);
        let at = Pos2::new(300.0, 77.0);
        let aspect = screen.width() / screen.height();
        let (o, d) = pose.ray(centered(screen, at), aspect);
        let back = project(&pose.clip(aspect, 0.01), screen, o + 3.0 * d).unwrap();
        assert!(back.distance(at) < 0.05, "{back}");
        assert_eq!(project(&pose.clip(aspect, 0.01), screen, o - 3.0 * d), None);
    }
}

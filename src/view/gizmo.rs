//! The handles by which the selection is moved, turned and scaled.

use egui::epaint::Vertex;
use egui::{Event, PointerButton, Pos2, Rect, Response, Rgba};
use glam::{DMat4, DQuat, DVec3};
use transform_gizmo_egui::math::Transform;
use transform_gizmo_egui::{
    Gizmo, GizmoConfig, GizmoInteraction, GizmoMode, GizmoOrientation, mint,
};

use super::camera::Pose;
use super::place::{Handle, Place};

/// How the handles are shown and what they do.
pub(super) struct Settings {
    pub pose: Pose,
    pub screen: Rect,
    pub handle: Handle,
    pub local: bool,
    pub snap: bool,
    /// Metres, degrees, factor.
    pub steps: [f32; 3],
    /// Where the handles are, in the node's own space.
    pub pivot: DVec3,
}

/// The handles.
#[derive(Default)]
pub(super) struct Manipulator {
    gizmo: Gizmo,
    /// Where the node was when the drag began, and whether it has moved since.
    from: Option<(Place, bool)>,
}

impl Manipulator {
    /// A handle is held.
    pub(super) fn is_dragging(&self) -> bool {
        self.from.is_some()
    }

    /// Nothing is selected.
    pub(super) fn rest(&mut self) {
        self.from = None;
    }

    /// Draws the handles of a node on the picture; if they are dragged, where it stands now, and whether it stood still until now.
    pub(super) fn follow(
        &mut self,
        ui: &egui::Ui,
        picture: &Response,
        settings: &Settings,
        place: &Place,
    ) -> Option<(Place, bool)> {
        let pose = &settings.pose;
        let aspect = f64::from(settings.screen.width() / settings.screen.height().max(1.0));
        let view =
            DMat4::from_rotation_translation(pose.rotation().as_dquat(), pose.position.as_dvec3())
                .inverse();
        let projection = glam::dcamera::rh::proj::directx::perspective(
            f64::from(pose.fov_y),
            aspect,
            0.01,
            1000.0,
        );
        let modes = match settings.handle {
            Handle::Move => GizmoMode::all_translate(),
            Handle::Turn => GizmoMode::all_rotate(),
            Handle::Scale => GizmoMode::all_scale(),
        };
        self.gizmo.update_config(GizmoConfig {
            view_matrix: rows(&view),
            projection_matrix: rows(&projection),
            viewport: settings.screen,
            modes,
            orientation: if settings.local {
                GizmoOrientation::Local
            } else {
                GizmoOrientation::Global
            },
            snapping: settings.snap,
            snap_distance: settings.steps[0],
            snap_angle: settings.steps[1].to_radians(),
            snap_scale: settings.steps[2],
            pixels_per_point: ui.ctx().pixels_per_point(),
            ..GizmoConfig::default()
        });
        let (scale, rotation, translation) = place.world().to_scale_rotation_translation();
        let pivot = place.world().transform_point3(settings.pivot);
        let target = Transform {
            scale: scale.to_array().into(),
            rotation: mint::Quaternion::from(rotation.to_array()),
            translation: pivot.to_array().into(),
        };
        let dragged = self.interact(ui, picture, target);
        self.draw(ui, settings.screen);
        let Some((moved, still)) = dragged else {
            self.from = None;
            return None;
        };
        let (_, was_moved) = self.from.get_or_insert((*place, false));
        if still && !*was_moved {
            return None;
        }
        let first = !std::mem::replace(was_moved, true);
        let new = match settings.handle {
            Handle::Move => place.moved_to(translation + vector(moved.translation) - pivot),
            Handle::Turn => {
                let q: [f64; 4] = moved.rotation.into();
                let turned = place.turned_to(DQuat::from_array(q).normalize());
                turned.holding(settings.pivot, place)
            }
            Handle::Scale => {
                let old = DVec3::select(scale.abs().cmplt(DVec3::splat(1e-9)), DVec3::ONE, scale);
                let scaled = place.scaled_by(vector(moved.scale) / old);
                scaled.holding(settings.pivot, place)
            }
        };
        (first || new != *place).then_some((new, first))
    }

    /// Follows the pointer: where the handles are dragged to, if they are, and whether the pointer is where it was pressed.
    ///
    /// A frame may hold a press, and much movement after it: what is grasped is what was under the pointer when it was pressed.
    fn interact(
        &mut self,
        ui: &egui::Ui,
        picture: &Response,
        target: Transform,
    ) -> Option<(Transform, bool)> {
        let pressed = |event: &Event| match event {
            Event::PointerButton {
                pos,
                button: PointerButton::Primary,
                pressed: true,
                ..
            } => Some(*pos),
            _ => None,
        };
        let (pressed, at, down, origin) = ui.input(|i| {
            let pointer = &i.pointer;
            (
                i.events.iter().find_map(pressed),
                pointer.latest_pos().unwrap_or_default(),
                pointer.primary_down(),
                pointer.press_origin(),
            )
        });
        // Not what lies on the picture.
        let on_picture = |at: &Pos2| {
            let top = ui.ctx().layer_id_at(*at);
            picture.rect.contains(*at) && top.is_none_or(|layer| layer == picture.layer_id)
        };
        let pressed = pressed.filter(on_picture);
        let mut update = |at: Pos2, hovered, drag_started, dragging| {
            let interaction = GizmoInteraction {
                cursor_pos: (at.x, at.y),
                hovered,
                drag_started,
                dragging,
            };
            self.gizmo.update(interaction, &[target])
        };
        if let Some(from) = pressed {
            update(from, true, true, true);
        }
        let dragging = down || pressed.is_some();
        let (_, moved) = update(at, picture.hovered(), false, dragging)?;
        let still = pressed.or(origin).is_some_and(|from| from == at);
        moved.first().map(|moved| (*moved, still))
    }

    fn draw(&self, ui: &egui::Ui, screen: Rect) {
        let drawn = self.gizmo.draw();
        let vertices = drawn.vertices.into_iter().zip(drawn.colors);
        let mesh = egui::Mesh {
            indices: drawn.indices,
            vertices: vertices
                .map(|(at, [r, g, b, a])| Vertex {
                    pos: at.into(),
                    uv: Pos2::default(),
                    color: Rgba::from_rgba_premultiplied(r, g, b, a).into(),
                })
                .collect(),
            ..Default::default()
        };
        ui.painter().with_clip_rect(screen).add(mesh);
    }
}

fn vector(v: mint::Vector3<f64>) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
}

fn rows(m: &DMat4) -> mint::RowMatrix4<f64> {
    let t = m.transpose().to_cols_array_2d();
    mint::RowMatrix4 {
        x: t[0].into(),
        y: t[1].into(),
        z: t[2].into(),
        w: t[3].into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A node at the origin, seen along -z from 5 m, with handles to move it.
    struct Scene {
        ctx: egui::Context,
        manipulator: Manipulator,
        place: Place,
    }

    const SCREEN: Rect = Rect {
        min: Pos2::ZERO,
        max: Pos2::new(800.0, 600.0),
    };
    /// On the arrow to the right.
    const ARROW: Pos2 = Pos2::new(445.0, 300.0);

    impl Scene {
        fn new() -> Self {
            let document = serde_json::json!({"nodes": [{"name": "node"}]});
            let mut scene = Self {
                ctx: egui::Context::default(),
                manipulator: Manipulator::default(),
                place: Place::of(&document, 0).expect("a node"),
            };
            // The picture has to be there before it can be pressed.
            scene.frame(&[Event::PointerMoved(Pos2::new(100.0, 100.0))]);
            scene
        }

        /// A frame with these events: what the handles did.
        fn frame(&mut self, events: &[Event]) -> Option<(Place, bool)> {
            let input = egui::RawInput {
                screen_rect: Some(SCREEN),
                events: events.to_vec(),
                ..Default::default()
            };
            let settings = Settings {
                pose: Pose::looking(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, 0.7),
                screen: SCREEN,
                handle: Handle::Move,
                local: false,
                snap: false,
                steps: [0.05, 5.0, 0.1],
                pivot: DVec3::ZERO,
            };
            let (manipulator, place) = (&mut self.manipulator, self.place);
            let mut moved = None;
            let _ = self.ctx.run(input, |ctx| {
                egui::CentralPanel::default().show(ctx, |ui| {
                    let (id, sense) = (ui.id().with("picture"), egui::Sense::click_and_drag());
                    let picture = ui.interact(ui.max_rect(), id, sense);
                    moved = manipulator.follow(ui, &picture, &settings, &place);
                });
            });
            if let Some((place, _)) = moved {
                self.place = place;
            }
            moved
        }
    }

    fn button(pos: Pos2, pressed: bool) -> Event {
        Event::PointerButton {
            pos,
            button: PointerButton::Primary,
            pressed,
            modifiers: egui::Modifiers::NONE,
        }
    }

    #[test]
    fn what_is_grasped_was_under_the_pointer_when_it_was_pressed() {
        let mut scene = Scene::new();
        let far = Pos2::new(600.0, 420.0);
        // All of it comes in one frame.
        let events = [
            Event::PointerMoved(ARROW),
            button(ARROW, true),
            Event::PointerMoved(far),
        ];
        let (place, first) = scene.frame(&events).expect("it is dragged");
        assert!(first);
        assert!(place.translation.x > 0.3, "{place:?}");
        assert!(
            place.translation.y.abs() < 1e-6,
            "along the arrow alone: {place:?}"
        );
        let (on, first) = scene
            .frame(&[Event::PointerMoved(far + egui::vec2(50.0, 0.0))])
            .expect("and on");
        assert!(!first && on.translation.x > place.translation.x);
        assert!(scene.frame(&[button(far, false)]).is_none());
        assert!(!scene.manipulator.is_dragging());
    }

    #[test]
    fn a_drag_that_one_frame_holds_all_of_moves_it() {
        let mut scene = Scene::new();
        let far = ARROW + egui::vec2(100.0, 0.0);
        let events = [
            Event::PointerMoved(ARROW),
            button(ARROW, true),
            Event::PointerMoved(far),
            button(far, false),
        ];
        let (place, first) = scene.frame(&events).expect("it was dragged");
        assert!(first && place.translation.x > 0.3, "{place:?}");
        assert!(scene.frame(&[]).is_none());
        assert!(!scene.manipulator.is_dragging());
    }

    #[test]
    fn a_click_on_a_handle_moves_nothing() {
        let mut scene = Scene::new();
        scene.frame(&[Event::PointerMoved(ARROW)]);
        assert!(scene.frame(&[button(ARROW, true)]).is_none());
        assert!(scene.manipulator.is_dragging(), "it is held all the same");
        assert!(scene.frame(&[button(ARROW, false)]).is_none());
        assert!(!scene.manipulator.is_dragging());
        // Nor does one beside all handles grasp any.
        let beside = Pos2::new(120.0, 500.0);
        assert!(
            scene
                .frame(&[Event::PointerMoved(beside), button(beside, true)])
                .is_none()
        );
        assert!(!scene.manipulator.is_dragging());
    }
}

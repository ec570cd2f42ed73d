//! The handles by which the selection is moved, turned and scaled.

use egui::Rect;
use glam::{DMat4, DQuat, DVec3};
use transform_gizmo_egui::math::Transform;
use transform_gizmo_egui::{Gizmo, GizmoConfig, GizmoExt as _, GizmoMode, GizmoOrientation, mint};

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
    /// Where the node was when the drag began.
    from: Option<Place>,
}

impl Manipulator {
    pub(super) fn is_dragging(&self) -> bool {
        self.from.is_some()
    }

    /// Nothing is selected.
    pub(super) fn rest(&mut self) {
        self.from = None;
    }

    /// Draws the handles of a node; if they are dragged, where it stands now, and whether that is new with this frame.
    pub(super) fn follow(
        &mut self,
        ui: &mut egui::Ui,
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
            ..GizmoConfig::default()
        });
        let (scale, rotation, translation) = place.world().to_scale_rotation_translation();
        let pivot = place.world().transform_point3(settings.pivot);
        let target = Transform {
            scale: scale.to_array().into(),
            rotation: mint::Quaternion::from(rotation.to_array()),
            translation: pivot.to_array().into(),
        };
        let Some((_, moved)) = self.gizmo.interact(ui, &[target]) else {
            if !ui.input(|i| i.pointer.primary_down()) {
                self.from = None;
            }
            return None;
        };
        let moved = moved.first()?;
        let first = self.from.is_none();
        self.from.get_or_insert(*place);
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

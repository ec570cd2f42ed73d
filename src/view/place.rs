//! Where a node stands, in its parent and in the world, and the edits that put it elsewhere.

use glam::{DAffine3, DMat4, DQuat, DVec3};
use serde_json::Value;

use crate::scene::edit::{Edit, Name};

/// A node's place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Its parent's space to world space.
    pub parent: DAffine3,
    /// In its parent, metres.
    pub translation: DVec3,
    /// In its parent.
    pub rotation: DQuat,
    /// Along its own axes.
    pub scale: DVec3,
}

/// What an edit is about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Handle {
    /// The translation.
    #[default]
    Move,
    /// The rotation.
    Turn,
    /// The scale.
    Scale,
}

impl Place {
    /// Of a node of a glTF document; none if there is no such node.
    pub fn of(document: &Value, node: u32) -> Option<Self> {
        let nodes = document.get("nodes")?.as_array()?;
        let local = |i: usize| local(nodes.get(i)?);
        let parent_of = |child: usize| {
            nodes.iter().position(|n| {
                let children = n.get("children").and_then(Value::as_array);
                children.is_some_and(|c| c.iter().any(|v| v.as_u64() == Some(child as u64)))
            })
        };
        let mut parent = DAffine3::IDENTITY;
        let mut at = node as usize;
        // A tree is no deeper than it has nodes.
        for _ in 0..nodes.len() {
            let Some(above) = parent_of(at) else { break };
            parent = local(above)? * parent;
            at = above;
        }
        let (scale, rotation, translation) = local(node as usize)?.to_scale_rotation_translation();
        Some(Self {
            parent,
            translation,
            rotation,
            scale,
        })
    }

    /// The node's space to world space.
    pub fn world(&self) -> DAffine3 {
        let local =
            DAffine3::from_scale_rotation_translation(self.scale, self.rotation, self.translation);
        self.parent * local
    }

    /// With its origin elsewhere in the world.
    pub fn moved_to(self, world: DVec3) -> Self {
        Self {
            translation: self.parent.inverse().transform_point3(world),
            ..self
        }
    }

    /// Turned in the world.
    pub fn turned_to(self, world: DQuat) -> Self {
        let (_, parent, _) = self.parent.to_scale_rotation_translation();
        Self {
            rotation: (parent.inverse() * world).normalize(),
            ..self
        }
    }

    /// Scaled by factors along its own axes; never to nothing.
    pub fn scaled_by(self, factors: DVec3) -> Self {
        let scale = self.scale * factors;
        let least = DVec3::splat(1e-4);
        Self {
            scale: DVec3::select(scale.abs().cmplt(least), least, scale),
            ..self
        }
    }

    /// How large something is along its axes, metres, that takes `extent` in its own space.
    pub fn size(&self, extent: DVec3) -> DVec3 {
        let axes = self.world().matrix3;
        extent * DVec3::from_array([axes.x_axis, axes.y_axis, axes.z_axis].map(DVec3::length))
    }

    /// Scaled so that what fills a box of its own space is so large along its axes, around the box's centre. Along an axis
    /// without extent nothing changes.
    pub fn sized(self, [low, high]: [DVec3; 2], metres: DVec3) -> Self {
        let now = self.size(high - low);
        let factor = |now: f64, wanted: f64| if now > 0.0 { wanted / now } else { 1.0 };
        let factors = [0, 1, 2].map(|axis| factor(now[axis], metres[axis]));
        let scaled = self.scaled_by(DVec3::from_array(factors));
        scaled.holding(0.5 * (low + high), &self)
    }

    /// With a point of its own space where that of `before` was.
    pub fn holding(self, point: DVec3, before: &Self) -> Self {
        let shift = before.world().transform_point3(point) - self.world().transform_point3(point);
        self.moved_to(self.world().translation + shift)
    }

    /// The edit that puts the node there, as far as a handle changes it; `around`: and the translation, because what it turns
    /// or grows around is not its origin.
    pub fn edit(&self, node: u32, handle: Handle, around: bool) -> Edit {
        let given = |wanted, yes: bool| yes.then_some(wanted);
        let moves = around || handle == Handle::Move;
        Edit::Transform {
            node: Name::Index(node),
            translation: given(self.translation.to_array(), moves),
            rotation: (handle == Handle::Turn).then_some(self.rotation.to_array()),
            scale: given(self.scale.to_array(), handle == Handle::Scale),
        }
    }
}

fn local(node: &Value) -> Option<DAffine3> {
    fn numbers<const N: usize>(node: &Value, name: &str) -> Option<[f64; N]> {
        let list = node.get(name)?.as_array()?;
        let values: Option<Vec<f64>> = list.iter().map(Value::as_f64).collect();
        values?.try_into().ok()
    }
    if let Some(matrix) = numbers::<16>(node, "matrix") {
        return Some(DAffine3::from_mat4(DMat4::from_cols_array(&matrix)));
    }
    let rotation = numbers(node, "rotation").map_or(DQuat::IDENTITY, DQuat::from_array);
    Some(DAffine3::from_scale_rotation_translation(
        numbers(node, "scale").map_or(DVec3::ONE, DVec3::from_array),
        rotation.normalize(),
        numbers(node, "translation").map_or(DVec3::ZERO, DVec3::from_array),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_turns_around_a_point_of_its_own_keeps_it_in_place() {
        let place = Place::of(&document(), 2).unwrap();
        let point = DVec3::new(3.0, 1.0, -2.0);
        let turned = place.turned_to(DQuat::from_rotation_x(1.0));
        let held = turned.holding(point, &place);
        let [a, b] = [place, held].map(|p| p.world().transform_point3(point));
        assert!(a.distance(b) < 1e-12, "{a} {b}");
        assert!(held.rotation.abs_diff_eq(turned.rotation, 1e-15));
        let Edit::Transform { translation, .. } = held.edit(2, Handle::Turn, true) else {
            panic!("a transform");
        };
        assert_eq!(translation, Some(held.translation.to_array()));
    }

    #[test]
    fn a_lamp_gets_the_size_that_it_is_given_and_stays_in_its_middle() {
        let place = Place::of(&document(), 2).unwrap();
        let own = [DVec3::new(0.0, 0.0, 1.0), DVec3::new(0.5, 0.0, 3.0)];
        let extent = own[1] - own[0];
        // Its parent doubles it.
        assert!(
            place
                .size(extent)
                .abs_diff_eq(DVec3::new(1.0, 0.0, 4.0), 1e-12)
        );
        let wanted = DVec3::new(0.25, 9.0, 6.0);
        let sized = place.sized(own, wanted);
        let flat = DVec3::new(0.25, 0.0, 6.0);
        assert!(sized.size(extent).abs_diff_eq(flat, 1e-12));
        assert_eq!(sized.scale.y, place.scale.y);
        let middle = 0.5 * (own[0] + own[1]);
        let [a, b] = [place, sized].map(|p| p.world().transform_point3(middle));
        assert!(a.distance(b) < 1e-12, "{a} {b}");
    }

    fn document() -> Value {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        json!({ "nodes": [
            { "children": [1], "translation": [10, 0, 0], "rotation": [0, half, 0, half] },
            { "children": [2], "scale": [2, 2, 2] },
            { "translation": [0, 0, 1] },
        ]})
    }

    #[test]
    fn parents_carry_their_children() {
        let place = Place::of(&document(), 2).unwrap();
        // One metre along z, doubled, turned a quarter around y: two metres along x.
        let at = place.world().translation;
        assert!((at - DVec3::new(12.0, 0.0, 0.0)).length() < 1e-9, "{at}");
        assert_eq!(Place::of(&document(), 3), None);
    }

    #[test]
    fn what_is_moved_or_turned_in_the_world_is_there_afterwards() {
        let place = Place::of(&document(), 2).unwrap();
        let wanted = DVec3::new(3.0, 4.0, 5.0);
        let moved = place.moved_to(wanted);
        assert!((moved.world().translation - wanted).length() < 1e-9);
        let turn = DQuat::from_rotation_x(0.3);
        let (_, found, _) = place
            .turned_to(turn)
            .world()
            .to_scale_rotation_translation();
        assert!(found.angle_between(turn) < 1e-6);
        let scaled = place.scaled_by(DVec3::new(2.0, 1.0, 0.0));
        assert_eq!(scaled.scale, DVec3::new(2.0, 1.0, 1e-4));
        let Edit::Transform {
            translation,
            rotation,
            scale,
            ..
        } = moved.edit(2, Handle::Move, false)
        else {
            panic!("no transform");
        };
        assert!(translation.is_some() && rotation.is_none() && scale.is_none());
    }
}

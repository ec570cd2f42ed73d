//! A version of the scene, ready to be drawn. Whichever thread makes it, frames only exchange one for the next.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use serde_json::Value;

use super::geometry::Geometry;
use super::resolve::PagesView;
use super::textures::{Materials, Samplers};
use crate::gpu::Result;
use crate::lightmap::Atlas;
use crate::scene::{Bounds, Document, Scene};

/// A scene on the device.
pub struct Shown {
    /// What it is.
    pub scene: Arc<Scene>,
    /// The glTF document that it is read from.
    pub json: Arc<Value>,
    /// How it is lit; without one it can only be shown unbaked.
    pub atlas: Option<Arc<Atlas>>,
    pub(super) geometry: Geometry,
    pub(super) materials: Materials,
    pub(super) pages: PagesView,
}

impl Shown {
    /// Puts on the device what `before` has not put there yet.
    ///
    /// # Errors
    /// No memory, a lost device.
    pub fn new(
        samplers: &Samplers,
        scene: &Arc<Scene>,
        document: &Document,
        atlas: Option<Arc<Atlas>>,
        pages: &PagesView,
        before: Option<&Self>,
    ) -> Result<Self> {
        let (geometry, materials) = (before.map(|b| &b.geometry), before.map(|b| &b.materials));
        Ok(Self {
            geometry: Geometry::new(samplers.gpu(), scene, atlas.as_deref(), geometry)?,
            materials: Materials::new(samplers, scene, pages, materials)?,
            scene: Arc::clone(scene),
            json: Arc::new(document.json.clone()),
            atlas,
            pages: pages.clone(),
        })
    }

    /// The box around all objects.
    pub fn bounds(&self) -> Bounds {
        let all = self.geometry.bounds.iter();
        all.fold(Bounds::EMPTY, |all, b| all.union(b))
    }

    /// The box around an object; an empty one for one that is gone.
    pub fn object_bounds(&self, object: u32) -> Bounds {
        let bounds = self.geometry.bounds.get(object as usize);
        bounds.copied().unwrap_or(Bounds::EMPTY)
    }

    /// Where a node's handles are, in its own space: at its origin, or, if that lies beside what it shows, in the middle of that.
    pub(super) fn pivot_of(&self, node: u32) -> DVec3 {
        let object = self.scene.objects.iter().position(|o| o.node == node);
        let bounds = object.and_then(|o| self.geometry.own_bounds(o as u32));
        bounds.map_or(DVec3::ZERO, |bounds| pivot(&bounds))
    }

    /// The name of the object or light on a node.
    pub fn name_of(&self, node: u32) -> Option<&str> {
        let object = self.scene.objects.iter().find(|o| o.node == node);
        let light = || self.scene.lights.iter().find(|l| l.node == node);
        object
            .map(|o| o.name.as_str())
            .or_else(|| light().map(|l| l.name.as_str()))
    }

    /// Lux at both ends of false colours that suit the scene.
    pub fn scale(&self) -> [f32; 2] {
        self.pages.scale()
    }
}

fn pivot(bounds: &Bounds) -> DVec3 {
    let margin = 0.02 * bounds.size().length();
    let nearest = Vec3::ZERO.clamp(bounds.min, bounds.max);
    if nearest.length() <= margin {
        return DVec3::ZERO;
    }
    bounds.center().as_dvec3()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn handles_are_at_an_origin_on_the_object_else_in_its_middle() {
        let on_the_floor = Bounds {
            min: Vec3::new(-1.0, 0.01, -1.0),
            max: Vec3::new(1.0, 2.0, 1.0),
        };
        assert_eq!(pivot(&on_the_floor), DVec3::ZERO);
        let elsewhere = Bounds {
            min: Vec3::new(4.0, 0.0, 0.0),
            max: Vec3::new(6.0, 2.0, 2.0),
        };
        assert_eq!(pivot(&elsewhere), DVec3::new(5.0, 1.0, 1.0));
    }
}

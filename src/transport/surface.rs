//! Untextured surface lookups.

use glam::Vec3;

use crate::scene::{AlphaMode, Material, Scene};

pub(super) trait Surface {
    fn material_at(&self, object: u32, triangle: u32) -> &Material;
    fn albedo(&self, object: u32, triangle: u32, _weights: Vec3) -> Vec3 {
        self.material_at(object, triangle).base_color.truncate()
    }
    fn emission(&self, object: u32, triangle: u32, _weights: Vec3) -> Vec3 {
        self.material_at(object, triangle).emission
    }
    fn alpha_passes(&self, object: u32, triangle: u32, _weights: Vec3) -> bool {
        let m = self.material_at(object, triangle);
        matches!(m.alpha, AlphaMode::Mask { cutoff } if m.base_color.w < cutoff)
    }
}

impl Surface for Scene {
    fn material_at(&self, object: u32, triangle: u32) -> &Material {
        let mesh = &self.meshes[self.objects[object as usize].mesh as usize];
        let run = mesh
            .primitives
            .partition_point(|p| p.triangles.end <= triangle);
        &self.materials[mesh.primitives[run].material as usize]
    }
}

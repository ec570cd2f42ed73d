//! What a picture is to be: where from, what of, how.

use glam::{Mat4, Vec2, Vec4};

use super::camera::Pose;
use super::look::Look;

/// What a picture is to be.
#[derive(Clone, Copy, Debug)]
pub struct Shot {
    /// Where from.
    pub pose: Pose,
    /// What of.
    pub look: Look,
    /// What both ends of the false colours stand for.
    pub scale: [f32; 2],
    /// How a page is laid out, where one is looked at.
    pub page: PageShot,
    /// 1, or how many pixels of the target are as wide as one that is computed: what moves is to be seen soon.
    pub coarse: u32,
}

/// How a page of the lightmap is laid out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PageShot {
    /// From 0.
    pub page: u32,
    /// What lies in the middle, as shares of width and height.
    pub center: Vec2,
    /// How much larger than what fits into the picture.
    pub zoom: f32,
}

impl Default for PageShot {
    fn default() -> Self {
        Self {
            page: 0,
            center: Vec2::splat(0.5),
            zoom: 1.0,
        }
    }
}

impl PageShot {
    /// Pixels per texel in a picture of a size.
    pub fn pixels_per_texel(&self, size: Vec2, page_size: f32) -> f32 {
        0.94 * self.zoom * size.min_element() / page_size
    }

    /// Texels to clip space.
    pub(super) fn clip(&self, size: [u32; 2], page_size: f32) -> Mat4 {
        let size = Vec2::new(size[0] as f32, size[1] as f32);
        let scale = self.pixels_per_texel(size, page_size) * 2.0 / size;
        let at = self.center * page_size;
        Mat4::from_cols(
            Vec4::X * scale.x,
            Vec4::Y * -scale.y,
            Vec4::ZERO,
            Vec4::new(-at.x * scale.x, at.y * scale.y, 0.5, 1.0),
        )
    }
}

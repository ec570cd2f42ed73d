//! Looking a lightmap up as a renderer does: bilinear, clamped at the page's border.

use glam::{UVec2, Vec2, Vec3};

use super::Lightmap;

/// The four texels that a bilinear lookup at `at` (in texels; the first texel's centre is at 0.5) fetches, as offsets into a page, and
/// their weights.
pub(crate) fn taps(at: Vec2, page_size: u32) -> [(usize, f32); 4] {
    let last = page_size - 1;
    let shifted = at - 0.5;
    let floor = shifted.floor();
    let f = shifted - floor;
    let clamp = |v: Vec2| v.clamp(Vec2::ZERO, Vec2::splat(last as f32)).as_uvec2();
    let (low, high): (UVec2, UVec2) = (clamp(floor), clamp(floor + 1.0));
    let index = |x: u32, y: u32| y as usize * page_size as usize + x as usize;
    [
        (index(low.x, low.y), (1.0 - f.x) * (1.0 - f.y)),
        (index(high.x, low.y), f.x * (1.0 - f.y)),
        (index(low.x, high.y), (1.0 - f.x) * f.y),
        (index(high.x, high.y), f.x * f.y),
    ]
}

impl Lightmap {
    /// Irradiance in lux at page coordinates `uv` (0..1, top left first: glTF's `TEXCOORD_1`), filtered bilinearly.
    /// Zero for a page that does not exist or coordinates that are not finite.
    pub fn sample_bilinear(&self, page: u32, uv: Vec2) -> Vec3 {
        let Some(texels) = self.pages.get(page as usize).filter(|_| uv.is_finite()) else {
            return Vec3::ZERO;
        };
        let taps = taps(uv * self.page_size as f32, self.page_size);
        taps.into_iter()
            .map(|(i, weight)| Vec3::from(texels[i]) * weight)
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolates_between_centres_and_clamps_at_the_border() {
        let texel = |v: f32| [v, 2.0 * v, 0.0];
        let map = Lightmap {
            page_size: 2,
            pages: vec![vec![texel(1.0), texel(3.0), texel(5.0), texel(11.0)]],
        };
        let at = |u: f32, v: f32| map.sample_bilinear(0, Vec2::new(u, v)).x;
        assert_eq!(at(0.25, 0.25), 1.0, "a centre");
        assert_eq!(at(0.5, 0.25), 2.0);
        assert_eq!(at(0.5, 0.5), 5.0);
        assert_eq!(at(0.0, 0.0), 1.0);
        assert_eq!(at(7.0, 1.0), 11.0);
        assert_eq!(map.sample_bilinear(0, Vec2::splat(0.5)).y, 10.0);
        assert_eq!(map.sample_bilinear(1, Vec2::splat(0.5)), Vec3::ZERO);
        assert_eq!(at(f32::NAN, 0.5), 0.0);
    }
}

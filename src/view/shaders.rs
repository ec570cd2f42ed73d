//! The viewer's compiled shaders, by file stem.

use crate::gpu::Shader;

include!(concat!(env!("OUT_DIR"), "/view_shaders.rs"));

#[cfg(test)]
mod tests {
    use std::mem::offset_of;

    use super::super::display::Picture;
    use super::super::geometry::{Placed, Surface, Vertex};
    use super::super::marker::{Corner, Stroke};

    #[test]
    fn structures_lie_in_memory_as_the_shaders_have_them() {
        macro_rules! check {
            ($name:literal, $rust:ty, $($field:ident as $shader:literal),+) => {
                let (_, members) = super::LAYOUTS.iter().find(|(n, _)| *n == $name).expect($name);
                let rust = [$(($shader, offset_of!($rust, $field) as u32)),+];
                assert_eq!(rust.as_slice(), *members, $name);
            };
        }
        check!("Picture", Picture, clip as "clip", eye as "eye", exposure as "exposure", lux as "lux",
            page_size as "page_size", scale as "scale", page as "page", least as "least");
        check!("Stroke", Stroke, from as "from", to as "to", color as "color", width as "width");
        check!("Corner", Corner, position as "position", color as "color");
        check!("Vertex", Vertex, position as "position", normal as "normal", color_uv as "color_uv",
            emission_uv as "emission_uv", light_uv as "light_uv");
        check!("Surface", Surface, color as "color", alpha as "alpha", emission as "emission", cutoff as "cutoff");
        let (_, members) = super::LAYOUTS
            .iter()
            .find(|(n, _)| *n == "Placed")
            .expect("Placed");
        let columns = offset_of!(Placed, columns) as u32;
        let rust = [
            ("x", columns),
            ("y", columns + 12),
            ("z", columns + 24),
            ("position", columns + 36),
            ("origin", offset_of!(Placed, origin) as u32),
            ("page", offset_of!(Placed, page) as u32),
        ];
        assert_eq!(rust.as_slice(), *members);
    }
}

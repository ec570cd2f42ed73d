//! Records of lights: those that a change is said to miss reach nothing of it.

use glam::Vec3;
use proptest::prelude::*;

use super::*;
use crate::cluster::{Shape, VirtualLight};

fn vector(reach: f32) -> impl Strategy<Value = Vec3> {
    prop::array::uniform3(-reach..reach).prop_map(Vec3::from)
}

fn light() -> impl Strategy<Value = VirtualLight> {
    let shape = prop_oneof![
        Just(Shape::Disk { area: 0.1 }),
        Just(Shape::Point),
        (0.1f32..1.5).prop_map(|outer| Shape::Spot { inner: 0.05, outer }),
    ];
    let directions = (vector(1.0), vector(0.3));
    (shape, vector(2.0), directions, any::<bool>()).prop_map(
        |(shape, position, (normal, tilt), direct)| {
            let normal = normal.normalize_or(Vec3::Y);
            let tilted = matches!(shape, Shape::Disk { .. }) && !direct;
            VirtualLight {
                shape,
                position,
                normal,
                surface: if tilted {
                    (normal + tilt).normalize()
                } else {
                    normal
                },
                flux: Vec3::ONE,
                direct,
            }
        },
    )
}

fn region() -> impl Strategy<Value = Region> {
    (vector(3.0), vector(0.5)).prop_map(|(center, extent)| Region {
        center: center.to_array(),
        extent: (extent.abs() + 0.01).to_array(),
    })
}

const SIZES: ShadowSizes = ShadowSizes {
    indirect: 64,
    direct: 256,
    sun: 512,
};

proptest! {
    /// A light that misses the regions shines on none of their points, half a texel or less beside them neither.
    #[test]
    fn a_light_that_misses_does_not_reach(
        light in light(),
        regions in prop::collection::vec(region(), 1..3),
        at in prop::collection::vec(vector(1.0), 20),
    ) {
        let epsilon = 0.05;
        prop_assume!(misses(&light, &SIZES, &regions, epsilon));
        prop_assert!(!matches!(light.shape, Shape::Point));
        for region in &regions {
            let extent = Vec3::from(region.extent) + epsilon / 3f32.sqrt();
            for at in &at {
                let way = Vec3::from(region.center) + *at * extent - light.position;
                let cosine = way.normalize().dot(light.surface);
                let least = match light.shape {
                    Shape::Spot { outer, .. } => outer.cos(),
                    _ => 0.0,
                };
                prop_assert!(cosine < least, "{cosine} {least}");
            }
        }
    }
}

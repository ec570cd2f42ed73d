//! Which point of which surface each texel's centre stands for, as scene.glb says it.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DAffine3, DMat3, DVec2, DVec3};
use rebake::scene::Scene;

use crate::map::Map;

/// A texel whose centre a triangle covers.
pub struct Point {
    /// Name of the object.
    pub object: String,
    /// World space, metres.
    pub position: DVec3,
    /// Interpolated vertex normal, world space, unit length.
    pub normal: DVec3,
    /// Of the surface that the texel stands for, m².
    pub area: f64,
    /// From the texel's centre to the nearest edge of the triangle, texels: nearer than 1/64, the texel stands for a
    /// point that is moved inside.
    pub margin: f64,
    /// Column and row.
    pub texel: [usize; 2],
    /// Irradiance in lux.
    pub value: [f64; 3],
}

impl Point {
    /// Mean over RGB, lux.
    pub fn mean(&self) -> f64 {
        self.value.iter().sum::<f64>() / 3.0
    }
}

/// All texels whose centre lies inside a triangle of `scene.glb`'s `TEXCOORD_1`, once each.
pub fn points(out: &Path) -> Vec<Point> {
    let map = Map::read(out);
    let (scene, _) = Scene::load(&out.join("scene.glb")).expect("scene.glb loads");
    let mut points = BTreeMap::new();
    for object in &scene.objects {
        let mesh = &scene.meshes[object.mesh as usize];
        let place: DAffine3 = DAffine3::from_mat3_translation(
            DMat3::from_cols(
                object.transform.matrix3.x_axis.as_dvec3(),
                object.transform.matrix3.y_axis.as_dvec3(),
                object.transform.matrix3.z_axis.as_dvec3(),
            ),
            object.transform.translation.as_dvec3(),
        );
        let turn = place.matrix3.inverse().transpose();
        for triangle in &mesh.triangles {
            let corner = triangle.map(|v| v as usize);
            let uv = corner.map(|v| mesh.texcoords[1][v].as_dvec2() * map.size as f64);
            let position = corner.map(|v| place.transform_point3(mesh.positions[v].as_dvec3()));
            let normal = corner.map(|v| turn * mesh.normals[v].as_dvec3());
            let double = (uv[1] - uv[0]).perp_dot(uv[2] - uv[0]);
            if double == 0.0 {
                continue;
            }
            let surface = (position[1] - position[0])
                .cross(position[2] - position[0])
                .length();
            let low = uv[0].min(uv[1]).min(uv[2]).floor().max(DVec2::ZERO);
            let high = uv[0].max(uv[1]).max(uv[2]).ceil();
            for y in low.y as usize..(high.y as usize).min(map.size) {
                for x in low.x as usize..(high.x as usize).min(map.size) {
                    let center = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                    let [to_0, to_1, to_2] = uv.map(|corner| corner - center);
                    let weights = [
                        to_1.perp_dot(to_2) / double,
                        to_2.perp_dot(to_0) / double,
                        to_0.perp_dot(to_1) / double,
                    ];
                    if weights.iter().any(|w| *w < 0.0) {
                        continue;
                    }
                    let sides = [uv[2] - uv[1], uv[0] - uv[2], uv[1] - uv[0]];
                    let margin = (0..3)
                        .map(|i| weights[i] * double.abs() / sides[i].length())
                        .fold(f64::INFINITY, f64::min);
                    let blend = |of: [DVec3; 3]| -> DVec3 {
                        of.iter().zip(weights).map(|(v, w)| *v * w).sum()
                    };
                    points.entry((y, x)).or_insert_with(|| Point {
                        object: object.name.clone(),
                        position: blend(position),
                        normal: blend(normal).normalize(),
                        area: (surface / double).abs(),
                        margin,
                        texel: [x, y],
                        value: map.texels[y * map.size + x],
                    });
                }
            }
        }
    }
    points.into_values().collect()
}

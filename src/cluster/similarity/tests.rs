//! Similarity clustering, on planes with and without noise.

use super::*;
use crate::transport::sampling::{Sequence, sphere};
use crate::transport::{Scatter, VplKey};

/// A floor, a wall, and a ball above them, in one cell.
fn corner(cell: Cell) -> Vec<Vpl> {
    let [lo, _] = cell.bounds();
    let (size, sequence) = (cell.size(), Sequence::new(5, 0));
    (0..400)
        .map(|i| {
            let [u, v, choice, w] = sequence.sample(i, 0);
            let (at, normal) = match (choice * 10.0) as u32 {
                0..5 => (Vec3::new(u, 0.1, v), Vec3::Y),
                5..8 => (Vec3::new(0.1, u, v), Vec3::X),
                _ => {
                    let n = sphere([u, w]);
                    (Vec3::splat(0.7) + n * 0.2, n)
                }
            };
            Vpl {
                key: VplKey {
                    light: 0,
                    path: i,
                    bounce: 0,
                },
                position: lo + at * size,
                normal,
                share: Vec3::new(1.5, 1.0, 0.5) * (1.0 + u),
                weight: 1.0 + u,
                flux: Vec3::new(0.3, 0.2, 0.1) * (1.0 + u),
                object: 0,
                scatter: Scatter {
                    distance: 1.0,
                    albedo: 0.5,
                    ..Default::default()
                },
            }
        })
        .collect()
}

#[test]
fn planes_become_polygons_and_the_rest_disks_with_all_of_the_flux() {
    let cell = Cell::at(Vec3::ONE, 10);
    let (settings, scale) = (SimilaritySettings::default(), FluxScale::new(0.2));
    let groups = Groups::new(cell, corner(cell), &settings);
    assert_eq!(groups.planes.len(), 2);
    let lights = groups.lights(&Border::default(), &scale, &settings);
    assert_eq!(lights.len(), 3, "one disk in proportion to the ball's flux");
    let (floor, wall, disk) = (&lights[0], &lights[1], &lights[2]);
    assert_eq!((floor.normal, wall.normal), (Vec3::Y, Vec3::X));
    for polygon in [floor, wall] {
        let Shape::Polygon { vertices } = &polygon.shape else {
            panic!("{polygon:?}")
        };
        let edges = (2..vertices.len())
            .map(|i| (vertices[i - 1] - vertices[0]).cross(vertices[i] - vertices[0]) * 0.5);
        let area = edges.sum::<Vec3>().dot(polygon.normal);
        // The unclipped planes fill the cell's section.
        assert!((area / cell.size().powi(2) - 1.0).abs() < 0.1, "{area}");
    }
    assert!(matches!(disk.shape, Shape::Disk { area } if area > 0.0));
    let units = groups.vpls.iter().fold([0; 3], |sum: [i64; 3], v| {
        let u = scale.units(v.flux);
        std::array::from_fn(|c| sum[c] + u[c])
    });
    let sum = lights.iter().map(|l| l.flux).sum::<Vec3>();
    assert!((sum / scale.lumens(units) - 1.0).abs().max_element() < 1e-6);
}

#[test]
fn few_points_and_lines_make_disks_and_no_setting_fails() {
    let cell = Cell::at(Vec3::ONE, 10);
    let mut line = corner(cell);
    line.iter_mut()
        .for_each(|v| (v.position.y, v.position.z, v.normal) = (1.0, 1.0, Vec3::Y));
    for (vpls, k) in [
        (line, 4),
        (corner(cell)[..1].to_vec(), 4),
        (corner(cell), 1),
        (corner(cell), 0),
        (Vec::new(), 4),
    ] {
        let settings = SimilaritySettings {
            lights_per_cell: k,
            ..Default::default()
        };
        let lights = Groups::new(cell, vpls.clone(), &settings).lights(
            &Border::default(),
            &FluxScale::new(0.2),
            &settings,
        );
        assert_eq!(lights.is_empty(), vpls.is_empty());
        assert!(lights.len() <= k.max(1));
        assert!(lights.iter().all(
            |l| matches!(l.shape, Shape::Disk { area } if area.is_finite())
                && l.normal.is_normalized()
        ));
    }
}

#[test]
fn directions_are_told_apart() {
    let items: Vec<(Vec3, f32)> = (0..30)
        .map(|i| {
            (
                [Vec3::X, Vec3::Y, -Vec3::X][i % 3] + Vec3::Z * 0.01 * (i / 3) as f32,
                1.0,
            )
        })
        .map(|(n, w)| (n.normalize(), w))
        .collect();
    let groups = by_direction(&items, 4);
    assert_eq!(groups.len(), 3);
    for group in groups {
        assert!(group.len() == 10 && group.iter().all(|i| i % 3 == group[0] % 3));
    }
}

//! A mesh's connectivity by position: which vertices coincide, which triangles share an edge, and which a chart.

use std::collections::HashMap;

use glam::{Vec2, Vec3};

use super::UvLayout;
use crate::scene::Mesh;

/// Vertices closer than this share of the mesh's diagonal count as one: f32 noise of exporters, far below any texel.
const WELD: f64 = 1.0 / (1 << 20) as f64;

/// Maps every vertex to the first one at (nearly) the same position, so that vertices split for normals or texture
/// coordinates still connect their triangles.
pub(crate) fn weld(positions: &[Vec3]) -> Vec<u32> {
    let (lo, hi) = positions
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), &p| {
            (lo.min(p), hi.max(p))
        });
    let cell = (hi - lo).as_dvec3().length() * WELD;
    let inverse = if cell > 0.0 && cell.is_finite() {
        1.0 / cell
    } else {
        0.0
    };
    let mut first = HashMap::with_capacity(positions.len());
    positions
        .iter()
        .enumerate()
        .map(|(i, &p)| {
            let key = ((p - lo).as_dvec3() * inverse).round().as_i64vec3();
            *first.entry(key).or_insert(i as u32)
        })
        .collect()
}

/// Two triangles that share an edge. Edge `e` of a triangle runs from corner `e` to corner `(e + 1) % 3`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SharedEdge {
    /// Both triangles, the one with the lower index first.
    pub triangles: [u32; 2],
    /// The edge in each.
    pub edges: [u8; 2],
}

/// All edges that exactly two triangles share with opposite directions (manifold, consistently wound), ordered by their
/// triangles. `triangles` index welded vertices.
pub(crate) fn shared_edges(triangles: &[[u32; 3]]) -> Vec<SharedEdge> {
    let mut directed: Vec<([u32; 2], u32, u8)> = Vec::with_capacity(triangles.len() * 3);
    for (t, corners) in triangles.iter().enumerate() {
        if corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0] {
            continue;
        }
        for e in 0..3 {
            let (a, b) = (corners[e], corners[(e + 1) % 3]);
            directed.push(([a.min(b), a.max(b)], t as u32, e as u8));
        }
    }
    directed.sort_unstable();
    let mut shared: Vec<SharedEdge> = directed
        .chunk_by(|x, y| x.0 == y.0)
        .filter_map(|run| match *run {
            [(_, t0, e0), (_, t1, e1)] => {
                let start = |t: u32, e: u8| triangles[t as usize][e as usize];
                let opposed = start(t0, e0) != start(t1, e1);
                opposed.then_some(SharedEdge {
                    triangles: [t0, t1],
                    edges: [e0, e1],
                })
            }
            _ => None,
        })
        .collect();
    shared.sort_unstable_by_key(|s| (s.triangles, s.edges));
    shared
}

/// Numbers the charts of a layout by their first triangle: triangles connect where they share a place and its coordinates. One entry per triangle.
pub(crate) fn charts(mesh: &Mesh, layout: &UvLayout) -> Vec<u32> {
    let places = weld(&mesh.positions);
    let mut first = HashMap::new();
    let mut parent: Vec<u32> = (0..layout.vertices.len() as u32).collect();
    for (i, vertex) in layout.vertices.iter().enumerate() {
        let uv = vertex.uv + Vec2::ZERO; // -0 becomes 0
        let key = (
            places[vertex.source as usize],
            uv.x.to_bits(),
            uv.y.to_bits(),
        );
        parent[i] = *first.entry(key).or_insert(i as u32);
    }
    let root = |parent: &mut Vec<u32>, mut v: u32| {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    };
    for &[a, b, c] in &layout.triangles {
        for other in [b, c] {
            let (p, q) = (root(&mut parent, a), root(&mut parent, other));
            parent[p.max(q) as usize] = p.min(q);
        }
    }
    let mut number = vec![u32::MAX; layout.vertices.len()];
    let mut count = 0;
    layout
        .triangles
        .iter()
        .map(|t| {
            let slot = &mut number[root(&mut parent, t[0]) as usize];
            if *slot == u32::MAX {
                *slot = count;
                count += 1;
            }
            *slot
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn welds_what_coincides_and_nothing_else() {
        let x = [0.0, 1.0, 0.0, 1.0 + 1e-7, 1.001, 2.0];
        assert_eq!(weld(&x.map(|x| Vec3::X * x)), [0, 1, 0, 1, 4, 5]);
        assert_eq!(
            weld(&[Vec3::ONE, Vec3::ONE]),
            [0, 0],
            "a mesh without extent"
        );
    }

    #[test]
    fn an_edge_of_three_triangles_or_of_equal_direction_is_no_shared_edge() {
        let two = [[0, 1, 2], [2, 1, 3]];
        assert_eq!(
            shared_edges(&two),
            [SharedEdge {
                triangles: [0, 1],
                edges: [1, 0]
            }]
        );
        assert!(
            shared_edges(&[[0, 1, 2], [1, 2, 3]]).is_empty(),
            "wound against each other"
        );
        assert!(
            shared_edges(&[[0, 1, 2], [2, 1, 3], [2, 1, 4]]).is_empty(),
            "not manifold"
        );
    }
}

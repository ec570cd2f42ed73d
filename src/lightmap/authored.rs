//! The file's own `TEXCOORD_1`: kept where it is usable as a lightmap layout, refused with a reason where not.

use glam::{DVec2, UVec2, Vec2, Vec3};

use super::coverage::{Triangle2, footprint};
use super::edges::charts;
use super::unwrap::triangle_area;
use super::{PADDING, UvLayout, UvVertex};
use crate::scene::Mesh;

/// Coordinates may leave 0..1 by this much: rounding of exporters and of 16-bit coordinates.
const SLACK: f32 = 1e-4;
/// Share of the surface that may have no area in the layout.
const COLLAPSED: f64 = 0.001;
/// Share of the surface that may get less than a [`THIN`]th of the texels it should.
const STARVED: f64 = 0.05;
/// Share of the rectangle that must be used.
const SPARSE: f64 = 0.1;
/// See [`STARVED`].
const THIN: f64 = 16.0;

/// Why a mesh's `TEXCOORD_1` is not used.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// No such set.
    #[error("there is none")]
    Missing,
    /// A coordinate is NaN or infinite.
    #[error("a coordinate of vertex {vertex} is not a number")]
    NotFinite {
        /// Index into the mesh's vertices.
        vertex: u32,
    },
    /// A coordinate leaves 0..1.
    #[error("vertex {vertex} lies at ({u}, {v}), outside 0..1")]
    Outside {
        /// Index into the mesh's vertices.
        vertex: u32,
        /// First coordinate.
        u: f32,
        /// Second coordinate.
        v: f32,
    },
    /// Surface without texels.
    #[error("{percent:.1} % of the surface has no area in it")]
    Collapsed {
        /// Percent of the mesh's surface.
        percent: f64,
    },
    /// Very uneven texel density.
    #[error("{percent:.1} % of the surface gets less than a sixteenth of its share of the texels")]
    Uneven {
        /// Percent of the mesh's surface.
        percent: f64,
    },
    /// Two triangles cover one texel.
    #[error("triangles {} and {} overlap", triangles[0], triangles[1])]
    Overlap {
        /// Indices into the mesh's triangles.
        triangles: [u32; 2],
    },
    /// Two charts are so near that bilinear filtering mixes them.
    #[error("the charts of triangles {} and {} are less than 2 texels apart in a rectangle of {width} x {height}", triangles[0], triangles[1])]
    TooClose {
        /// One triangle of each chart.
        triangles: [u32; 2],
        /// Of the rectangle, texels.
        width: u32,
        /// Of the rectangle, texels.
        height: u32,
    },
    /// Far more texels than the surface needs.
    #[error("it would need a rectangle of {width} x {height} texels, most of them empty")]
    Sparse {
        /// Of the rectangle, texels.
        width: u32,
        /// Of the rectangle, texels.
        height: u32,
    },
}

/// Lays `mesh` out by its `TEXCOORD_1`, in a rectangle that gives the surface `density` texels per metre in the mean.
/// `positions` are the mesh's, scaled to metres of the world.
pub(crate) fn authored(
    mesh: &Mesh,
    positions: &[Vec3],
    density: f32,
) -> Result<(UvLayout, UVec2), Refusal> {
    let mut layout = connected(mesh)?;
    let span = span(&layout, positions, density)?;
    // Objects that shared one atlas use a part of 0..1 each: only that part is kept.
    let (low, high) = extent(&layout);
    let size = (span * (high - low)).ceil().as_uvec2() + 2 * PADDING;
    for vertex in &mut layout.vertices {
        let texels = (vertex.uv.as_dvec2() - low) * span;
        vertex.uv = Vec2::splat(PADDING as f32) + texels.as_vec2();
    }
    separate(&layout, size)?;
    Ok((layout, size))
}

/// Lays `mesh` out by its `TEXCOORD_1` as it is, with (1, 1) at `scale` texels and `origin` taken off: the way back into an
/// atlas that was written before.
pub(crate) fn verbatim(mesh: &Mesh, scale: f32, origin: UVec2) -> Result<UvLayout, Refusal> {
    let mut layout = connected(mesh)?;
    for vertex in &mut layout.vertices {
        vertex.uv = vertex.uv * scale - origin.as_vec2();
    }
    Ok(layout)
}

/// The box around all coordinates.
fn extent(layout: &UvLayout) -> (DVec2, DVec2) {
    let empty = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    layout.vertices.iter().fold(empty, |(low, high), v| {
        (low.min(v.uv.as_dvec2()), high.max(v.uv.as_dvec2()))
    })
}

/// The layout in the file's coordinates; its charts are what connects without a seam.
fn connected(mesh: &Mesh) -> Result<UvLayout, Refusal> {
    let coordinates = &mesh.texcoords[1];
    if coordinates.len() != mesh.positions.len() {
        return Err(Refusal::Missing);
    }
    let mut used = vec![u32::MAX; coordinates.len()];
    let mut layout = UvLayout::default();
    for corners in &mesh.triangles {
        for &source in corners {
            let uv = coordinates[source as usize];
            if !uv.is_finite() {
                return Err(Refusal::NotFinite { vertex: source });
            }
            if uv.min_element() < -SLACK || uv.max_element() > 1.0 + SLACK {
                return Err(Refusal::Outside {
                    vertex: source,
                    u: uv.x,
                    v: uv.y,
                });
            }
            if used[source as usize] == u32::MAX {
                used[source as usize] = layout.vertices.len() as u32;
                layout.vertices.push(UvVertex { source, uv });
            }
        }
        layout.triangles.push(corners.map(|v| used[v as usize]));
    }
    layout.charts = charts(mesh, &layout);
    Ok(layout)
}

/// Texels that 0..1 spans in each direction, so that the layout's area is the surface's times the density squared, and a
/// texel is as square as the layout allows.
fn span(layout: &UvLayout, positions: &[Vec3], density: f32) -> Result<DVec2, Refusal> {
    // Per triangle: surface, share of the layout. Metres along each coordinate, weighted by surface.
    let (mut surface, mut covered, mut metres) = (0.0, 0.0, DVec2::ZERO);
    let mut shares = Vec::with_capacity(layout.triangles.len());
    for corners in &layout.triangles {
        let vertices = corners.map(|v| layout.vertices[v as usize]);
        let [a, b, c] = vertices.map(|v| v.uv.as_dvec2());
        let (du, dv) = (b - a, c - a);
        let area = triangle_area(positions, &vertices.map(|v| v.source));
        let determinant = du.perp_dot(dv);
        shares.push((area, 0.5 * determinant.abs()));
        surface += area;
        covered += 0.5 * determinant.abs();
        if determinant != 0.0 {
            let [p, q, r] = vertices.map(|v| positions[v.source as usize].as_dvec3());
            let (e, f) = (q - p, r - p);
            let along_u = (e * dv.y - f * du.y) / determinant;
            let along_v = (f * du.x - e * dv.x) / determinant;
            metres += area * DVec2::new(along_u.length(), along_v.length());
        }
    }
    let percent = |test: &dyn Fn(f64, f64) -> bool| {
        let hit: f64 = shares
            .iter()
            .filter(|(a, s)| test(*a, *s))
            .map(|(a, _)| a)
            .sum();
        100.0 * hit / surface
    };
    if surface == 0.0 || covered == 0.0 {
        return Err(Refusal::Collapsed { percent: 100.0 });
    }
    let collapsed = percent(&|_, share| share == 0.0);
    if collapsed > 100.0 * COLLAPSED {
        return Err(Refusal::Collapsed { percent: collapsed });
    }
    let uneven = percent(&|area, share| share / covered * THIN < area / surface);
    if uneven > 100.0 * STARVED {
        return Err(Refusal::Uneven { percent: uneven });
    }
    let texels = surface * f64::from(density) * f64::from(density);
    let aspect = (metres.x / metres.y).clamp(1e-3, 1e3);
    let span = (texels / covered).sqrt() * DVec2::new(aspect.sqrt(), 1.0 / aspect.sqrt());
    // What unwrapping fills is about half; a layout that wastes far more is refused, before it asks for absurd memory.
    let (low, high) = extent(layout);
    let needed = span * (high - low);
    if needed.x * needed.y > (texels / SPARSE).max(65536.0) || needed.max_element() > 65536.0 {
        let (width, height) = (needed.x.ceil() as u32, needed.y.ceil() as u32);
        return Err(Refusal::Sparse { width, height });
    }
    Ok(span)
}

/// Checks that no texel serves two places: none is covered by two triangles, and none is fetched by two charts.
fn separate(layout: &UvLayout, size: UVec2) -> Result<(), Refusal> {
    const FREE: u32 = u32::MAX;
    let texels = size.x as usize * size.y as usize;
    let (mut covered, mut fetched) = (vec![FREE; texels], vec![FREE; texels]);
    for (t, corners) in layout.triangles.iter().enumerate() {
        let triangle: Triangle2 = corners.map(|v| layout.vertices[v as usize].uv.as_dvec2());
        let mut refusal = None;
        footprint(&triangle, size, |x, y| {
            let i = (y * size.x + x) as usize;
            if fetched[i] == FREE {
                fetched[i] = t as u32;
            } else if layout.charts[fetched[i] as usize] != layout.charts[t] {
                let triangles = [fetched[i], t as u32];
                refusal.get_or_insert(Refusal::TooClose {
                    triangles,
                    width: size.x,
                    height: size.y,
                });
            }
            if holds(
                &triangle,
                DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5),
            ) {
                if covered[i] == FREE {
                    covered[i] = t as u32;
                } else {
                    refusal = Some(Refusal::Overlap {
                        triangles: [covered[i], t as u32],
                    });
                }
            }
        });
        if let Some(refusal) = refusal {
            return Err(refusal);
        }
    }
    Ok(())
}

/// Whether the triangle holds the point; of two triangles on either side of a common edge exactly one holds a point on it.
fn holds(triangle: &Triangle2, point: DVec2) -> bool {
    // Even-odd crossings of a ray along +x; every edge is evaluated from its lower end, so that neighbours agree.
    let crossings = [0, 1, 2].into_iter().filter(|&i| {
        let (p, q) = (triangle[i], triangle[(i + 1) % 3]);
        let (low, high) = if (p.y, p.x) <= (q.y, q.x) {
            (p, q)
        } else {
            (q, p)
        };
        low.y <= point.y && point.y < high.y && (high - low).perp_dot(point - low) > 0.0
    });
    crossings.count() % 2 == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Squares of 1 m side by side, each with the given corners in the layout.
    fn squares(rectangles: &[[f32; 4]]) -> Mesh {
        let mut mesh = Mesh::default();
        for (i, &[u0, v0, u1, v1]) in rectangles.iter().enumerate() {
            let (base, x) = (4 * i as u32, 3.0 * i as f32);
            mesh.positions.extend(
                [(x, 0.0), (x + 1.0, 0.0), (x + 1.0, 1.0), (x, 1.0)]
                    .map(|(x, y)| Vec3::new(x, y, 0.0)),
            );
            mesh.texcoords[1]
                .extend([(u0, v0), (u1, v0), (u1, v1), (u0, v1)].map(|(u, v)| Vec2::new(u, v)));
            mesh.triangles
                .extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
        }
        mesh
    }

    fn lay(rectangles: &[[f32; 4]], density: f32) -> Result<(UvLayout, UVec2), Refusal> {
        let mesh = squares(rectangles);
        authored(&mesh, &mesh.positions, density)
    }

    #[test]
    fn a_clean_layout_is_kept_at_the_density_asked_for() {
        let (layout, size) = lay(&[[0.0, 0.0, 0.45, 1.0], [0.55, 0.0, 1.0, 1.0]], 32.0).unwrap();
        assert_eq!(layout.charts, [0, 0, 1, 1]);
        // A part of the layout is as good: an object in an atlas that several share.
        let part = [[0.1, 0.2, 0.19, 0.4], [0.21, 0.2, 0.3, 0.4]];
        assert_eq!(lay(&part, 32.0).unwrap().1, size);
        // Each square is 32 texels wide and high: the stretch along v is undone.
        assert_eq!(size, UVec2::new(72 + 4, 32 + 4));
        let corner = layout.vertices.iter().find(|v| v.source == 2).unwrap();
        assert!(
            corner.uv.distance(Vec2::new(2.0 + 32.0, 2.0 + 32.0)) < 1e-3,
            "{}",
            corner.uv
        );
    }

    #[test]
    fn what_cannot_work_is_refused_with_its_reason() {
        let mut none = squares(&[[0.0, 0.0, 1.0, 1.0]]);
        none.texcoords[1].clear();
        assert_eq!(
            authored(&none, &none.positions, 8.0).unwrap_err(),
            Refusal::Missing
        );
        assert!(matches!(
            lay(&[[0.0, 0.0, 1.2, 1.0]], 8.0),
            Err(Refusal::Outside { vertex: 1, .. })
        ));
        assert!(matches!(
            lay(&[[0.0, f32::NAN, 1.0, 1.0]], 8.0),
            Err(Refusal::NotFinite { vertex: 0 })
        ));
        let tiled = lay(&[[0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 1.0, 1.0]], 8.0);
        assert_eq!(tiled.unwrap_err(), Refusal::Overlap { triangles: [0, 2] });
        let flat = lay(&[[0.0, 0.0, 1.0, 0.9], [0.0, 1.0, 1.0, 1.0]], 8.0);
        assert!(
            matches!(flat, Err(Refusal::Collapsed { percent }) if (percent - 50.0).abs() < 1e-6)
        );
        let tiny = lay(&[[0.0, 0.0, 0.9, 0.9], [0.95, 0.95, 1.0, 1.0]], 8.0);
        assert!(matches!(tiny, Err(Refusal::Uneven { .. })));
    }

    #[test]
    fn whether_charts_keep_apart_depends_on_the_resolution() {
        let gap = [[0.0, 0.0, 0.48, 1.0], [0.52, 0.0, 1.0, 1.0]];
        assert!(matches!(lay(&gap, 8.0), Err(Refusal::TooClose { .. })));
        assert!(lay(&gap, 64.0).is_ok());
    }

    #[test]
    fn neighbours_never_both_hold_a_point_on_their_edge() {
        let p = |x: f64, y: f64| DVec2::new(x, y);
        let fan = [p(4.0, 0.5), p(7.5, 4.0), p(4.0, 7.5), p(0.5, 4.0)];
        for y in 0..16 {
            for x in 0..16 {
                let point = p(f64::from(x) / 2.0, f64::from(y) / 2.0);
                let held = (0..4)
                    .filter(|&i| holds(&[p(4.0, 4.0), fan[i], fan[(i + 1) % 4]], point))
                    .count();
                let inside = (point.x - 4.0).abs() + (point.y - 4.0).abs();
                assert!(
                    held == usize::from(inside < 3.5) || (inside == 3.5 && held < 2),
                    "{point}: {held}"
                );
            }
        }
    }
}

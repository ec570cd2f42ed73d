//! What objects share a layout for: a mesh at one scale.

use std::collections::BTreeMap;

use glam::{DMat3, Mat3, UVec2, Vec3};
use rayon::prelude::*;

use super::authored::{Refusal, authored};
use super::edges::charts;
use super::error::LightmapError;
use super::unwrap::{repack, triangle_area, unwrap};
use super::{UvLayout, UvSource};
use crate::scene::{Mesh, Scene};

/// Layouts are snapped to this part of a texel. Then coordinates survive the way through a file bit for bit: a corner in
/// a page of 16384 texels takes 14 + 8 bits, and f32 has 24.
const SNAP: f32 = 256.0;

/// A mesh at one scale: what objects share a layout for.
pub(super) struct Shape {
    /// Indices into the scene's objects, ascending.
    pub objects: Vec<u32>,
    /// Index into the scene's meshes.
    pub mesh: u32,
    /// Vertex positions, metres of the world up to a rotation.
    pub positions: Vec<Vec3>,
    /// m², of one object.
    pub area: f64,
}

/// A shape's layout.
pub(super) struct Laid {
    /// In a rectangle of its own.
    pub layout: UvLayout,
    /// Of the rectangle, texels.
    pub size: UVec2,
    /// Where it comes from.
    pub source: UvSource,
}

/// Groups all objects, in the order of each group's first.
pub(super) fn shapes(scene: &Scene) -> Result<Vec<Shape>, LightmapError> {
    let all: Vec<u32> = (0..scene.objects.len() as u32).collect();
    shapes_among(scene, &all)
}

/// Groups some objects, in the order of each group's first.
pub(super) fn shapes_among(scene: &Scene, objects: &[u32]) -> Result<Vec<Shape>, LightmapError> {
    let mut groups: BTreeMap<(u32, [u32; 9]), Vec<u32>> = BTreeMap::new();
    for &i in objects {
        let object = &scene.objects[i as usize];
        let scale = canonical_scale(object.transform.matrix3.into());
        let key = (object.mesh, scale.to_cols_array().map(f32::to_bits));
        groups.entry(key).or_default().push(i);
    }
    let mut shapes = groups
        .into_par_iter()
        .map(|((mesh, scale), objects)| {
            let scale = Mat3::from_cols_array(&scale.map(f32::from_bits));
            let data = &scene.meshes[mesh as usize];
            let positions: Vec<Vec3> = data.positions.iter().map(|p| scale * *p).collect();
            let object = &scene.objects[objects[0] as usize];
            if !object.transform.is_finite() || positions.iter().any(|p| !p.is_finite()) {
                return Err(LightmapError::NotFinite {
                    object: object.name.clone(),
                });
            }
            let area = data
                .triangles
                .iter()
                .map(|t| triangle_area(&positions, t))
                .sum();
            Ok(Shape {
                objects,
                mesh,
                positions,
                area,
            })
        })
        .collect::<Result<Vec<_>, _>>()?;
    shapes.sort_by_key(|s| s.objects[0]);
    Ok(shapes)
}

/// The scale and shear of a transform without its rotation and mirroring: the upper triangular R with RᵀR = MᵀM, rounded to
/// one part in 4096, so that instances at one scale compare equal however they are turned.
pub(super) fn canonical_scale(matrix: Mat3) -> Mat3 {
    let m: DMat3 = matrix.as_dmat3();
    let gram = m.transpose() * m;
    let mean = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
    if !(mean > 0.0 && mean.is_finite()) {
        return if mean == 0.0 { Mat3::ZERO } else { Mat3::NAN };
    }
    let round = |v: f64| (v / mean * 4096.0).round() / 4096.0 + 0.0; // never -0
    let [a, b, c] = [gram.x_axis.x, gram.y_axis.x, gram.z_axis.x].map(round);
    let [d, e, f] = [gram.y_axis.y, gram.z_axis.y, gram.z_axis.z].map(round);
    // Cholesky; an axis that is scaled to nothing leaves a row of zeros.
    let divide = |v: f64, by: f64| if by > 0.0 { v / by } else { 0.0 };
    let r11 = a.max(0.0).sqrt();
    let (r12, r13) = (divide(b, r11), divide(c, r11));
    let r22 = (d - r12 * r12).max(0.0).sqrt();
    let r23 = divide(e - r12 * r13, r22);
    let r33 = (f - r13 * r13 - r23 * r23).max(0.0).sqrt();
    let size =
        f32::from_bits((mean.sqrt() as f32).to_bits().wrapping_add(1 << 11) & !((1 << 12) - 1));
    let columns = [[r11, 0.0, 0.0], [r12, r22, 0.0], [r13, r23, r33]];
    Mat3::from_cols_array_2d(&columns.map(|c| c.map(|v| v as f32))) * size
}

impl Shape {
    /// Lays the shape out at `density` texels per metre. `first` is its layout at another density, whose charts are then
    /// kept, and by how much each should be denser than `density` (nothing: by 1). No side of the rectangle is longer than
    /// `limit` texels.
    pub fn lay_out(
        &self,
        scene: &Scene,
        density: f32,
        limit: u32,
        first: Option<(&Laid, &[f32])>,
    ) -> Result<Laid, LightmapError> {
        let mesh = &scene.meshes[self.mesh as usize];
        let object = || scene.objects[self.objects[0] as usize].name.clone();
        if mesh.triangles.is_empty() {
            let (layout, size, source) = (UvLayout::default(), UVec2::ZERO, UvSource::Unwrapped);
            return Ok(Laid {
                layout,
                size,
                source,
            });
        }
        let too_large = |width: f64, height: f64| LightmapError::TooLarge {
            object: object(),
            width: width as u64,
            height: height as u64,
            page_size: limit,
        };
        // Before any memory is asked for: the surface alone, or one edge, may already be more than a page.
        let side = self.area.sqrt() * f64::from(density);
        if side > f64::from(limit) {
            return Err(too_large(side, side));
        }
        let longest = self.longest_edge(mesh) * f64::from(density);
        if longest > 1.42 * f64::from(limit) {
            return Err(too_large(longest, 1.0));
        }
        let unwrapped = first.filter(|(first, _)| first.source == UvSource::Unwrapped);
        let kept = match (unwrapped, first) {
            (Some(_), _) => None,
            // The file says how the texels are shared out among the charts.
            (None, Some((first, factors))) => {
                let mean = self.mean_factor(mesh, &first.layout, factors);
                self.authored(mesh, density * mean, limit)
            }
            (None, None) => self.authored(mesh, density, limit),
        };
        let (mut layout, size, source) = match (kept, unwrapped) {
            (Some((layout, size)), _) => (layout, size, UvSource::Authored),
            (None, first) => {
                let charts = match first {
                    Some((first, factors)) => {
                        let anew = |factors| {
                            repack(
                                mesh,
                                &self.positions,
                                &first.layout,
                                factors,
                                density,
                                limit,
                            )
                        };
                        match anew(factors) {
                            Ok((_, size)) if size.max_element() > limit => anew(&[]),
                            laid => laid,
                        }
                    }
                    None => unwrap(mesh, &self.positions, density, limit),
                };
                let (layout, size) = charts.map_err(|e| LightmapError::Unwrap {
                    object: object(),
                    reason: e.to_string(),
                })?;
                (layout, size, UvSource::Unwrapped)
            }
        };
        if size.max_element() > limit {
            return Err(too_large(size.x.into(), size.y.into()));
        }
        snap(mesh, &mut layout);
        Ok(Laid {
            layout,
            size,
            source,
        })
    }

    /// The file's own layout, if it is usable.
    fn authored(&self, mesh: &Mesh, density: f32, limit: u32) -> Option<(UvLayout, UVec2)> {
        let fits = |(layout, size): (UvLayout, UVec2)| match size.max_element() <= limit {
            true => Ok((layout, size)),
            false => Err(Refusal::Sparse {
                width: size.x,
                height: size.y,
            }),
        };
        match authored(mesh, &self.positions, density).and_then(fits) {
            Ok(kept) => Some(kept),
            Err(Refusal::Missing) => None,
            Err(refusal) => {
                tracing::info!(mesh = mesh.name, "TEXCOORD_1 is not used: {refusal}");
                None
            }
        }
    }

    /// The factor that gives the whole shape as many texels as its charts' factors do.
    fn mean_factor(&self, mesh: &Mesh, layout: &UvLayout, factors: &[f32]) -> f32 {
        let weighted = mesh.triangles.iter().zip(&layout.charts).map(|(t, c)| {
            let factor = factors.get(*c as usize).copied().unwrap_or(1.0);
            triangle_area(&self.positions, t) * f64::from(factor * factor)
        });
        let mean = weighted.sum::<f64>() / self.area;
        if mean > 0.0 { mean.sqrt() as f32 } else { 1.0 }
    }

    fn longest_edge(&self, mesh: &Mesh) -> f64 {
        let edges = mesh
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
        let length = |(a, b): (u32, u32)| {
            self.positions[a as usize]
                .as_dvec3()
                .distance(self.positions[b as usize].as_dvec3())
        };
        edges.map(length).fold(0.0, f64::max)
    }
}

/// Rounds the coordinates to what a file can hold, and numbers the charts by what the file will tell: so that the atlas read
/// back is the atlas that was written.
pub(super) fn snap(mesh: &Mesh, layout: &mut UvLayout) {
    for vertex in &mut layout.vertices {
        vertex.uv = (vertex.uv * SNAP).round() / SNAP;
    }
    layout.charts = charts(mesh, layout);
}

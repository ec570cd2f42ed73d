//! What is laid over the picture: virtual lights (IBGI fig. 10), cells, VPLs, what is not right yet, and charts, as lines, points
//! and shapes.

mod pencil;

use std::collections::{BTreeMap, BTreeSet};
use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::legend::round_up;
use super::look::Overlay;
use super::marker::Marks;
use crate::bake::Baker;
use crate::cluster::{Cell, CellId, Shape, VirtualLight};
use crate::gpu::Result;
use crate::lightmap::UvLayout;
use crate::scene::Bounds;
use pencil::{Pencil, Scale, ink};

/// Corners of a disk.
const DISK: usize = 20;
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// What is to be laid over the picture.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Overlays {
    /// All of these.
    pub shown: BTreeSet<Overlay>,
    /// The page whose charts are drawn, if any are.
    pub page: u32,
}

impl Overlays {
    /// Whether updates change it; else only edits do.
    pub(super) fn follow_updates(&self) -> bool {
        self.shown.iter().any(|o| *o != Overlay::Charts)
    }
}

/// What is laid over the picture, on the device.
pub struct Sketch {
    pub(super) marks: Arc<Marks>,
    /// What it was asked to show.
    pub of: Overlays,
    /// What both ends of false colours stand for, lumens.
    pub scales: Vec<(Overlay, [f32; 2])>,
}

impl Sketch {
    /// Of what the baker holds at this moment; none if nothing is asked for.
    ///
    /// # Errors
    /// No memory, a lost device.
    pub fn new(baker: &Baker, wanted: &Overlays) -> Result<Option<Arc<Self>>> {
        if wanted.shown.is_empty() {
            return Ok(None);
        }
        let mut pencil = Pencil::default();
        for overlay in &wanted.shown {
            match overlay {
                Overlay::Lights => pencil.lights(baker),
                Overlay::Cells => pencil.cells(baker),
                Overlay::Vpls => pencil.vpls(baker),
                Overlay::Invalid => pencil.invalid(baker),
                Overlay::Charts => pencil.charts(baker, wanted.page),
            }
        }
        let marks = Marks::new(baker.gpu(), &pencil.strokes, [&pencil.solid, &pencil.veils])?;
        Ok(Some(Arc::new(Self {
            marks: Arc::new(marks),
            of: wanted.clone(),
            scales: pencil.scales,
        })))
    }
}

/// A cell's box as far as it lies in the scene, a little smaller, so that neighbours are told apart.
fn inside(cell: Cell, scene: &Bounds) -> Bounds {
    let [min, max] = cell.bounds();
    let (gap, margin) = (0.02 * cell.size(), 0.003 * scene.size());
    Bounds {
        min: (min + gap).max(scene.min - margin),
        max: (max - gap).min(scene.max + margin),
    }
}

fn luminance(flux: Vec3) -> f32 {
    flux.dot(LUMINANCE)
}

/// Lumens; none for the sun, whose light has no place.
fn lumens(light: &VirtualLight) -> Option<f32> {
    let factor = match light.shape {
        Shape::Polygon { .. } | Shape::Disk { .. } => 1.0,
        Shape::Point => 4.0 * PI,
        Shape::Spot { inner, outer } => TAU * (1.0 - (0.5 * (inner + outer)).cos()),
        Shape::Directional { .. } => return None,
    };
    Some(luminance(light.flux) * factor)
}

impl Pencil {
    fn lights(&mut self, baker: &Baker) {
        let lights = || baker.virtual_lights().map(|(_, light)| light);
        let Some(scale) = Scale::over(lights().filter_map(lumens)) else {
            return;
        };
        for light in lights() {
            let Some(lumens) = lumens(light) else {
                continue;
            };
            let color = scale.color(lumens);
            let (fill, edge) = (ink(color, 0.9), ink(color.map(|v| 0.3 * v), 1.0));
            match &light.shape {
                Shape::Polygon { vertices } => self.polygon(vertices, fill, edge),
                Shape::Disk { area } if *area > 0.0 => {
                    let radius = (area / PI).sqrt();
                    let (x, y) = light.normal.normalize_or(Vec3::Y).any_orthonormal_pair();
                    let rim: [Vec3; DISK] = std::array::from_fn(|i| {
                        let (sin, cos) = (i as f32 / DISK as f32 * TAU).sin_cos();
                        light.position + (x * cos + y * sin) * radius
                    });
                    self.polygon(&rim, fill, edge);
                }
                _ => {
                    self.point(light.position, edge, 11.0);
                    self.point(light.position, ink(color, 1.0), 8.0);
                }
            }
        }
        self.scales.push((Overlay::Lights, scale.0));
    }

    fn cells(&mut self, baker: &Baker) {
        let mut cells = BTreeMap::new();
        for (cell, light) in baker.virtual_lights() {
            if let CellId::Octree(cell) = cell {
                *cells.entry(*cell).or_insert(0.0) += lumens(light).unwrap_or(0.0);
            }
        }
        let Some(scale) = Scale::over(cells.values().copied()) else {
            return;
        };
        let scene = baker.scene().bounds();
        for (cell, lumens) in &cells {
            let (bounds, color) = (inside(*cell, &scene), scale.color(*lumens));
            self.walls(&bounds, ink(color, 0.05));
            self.frame(&bounds, ink(color, 1.0), 1.3);
        }
        self.scales.push((Overlay::Cells, scale.0));
    }

    fn vpls(&mut self, baker: &Baker) {
        for vpl in baker.vpls() {
            let strongest = vpl.flux.max_element();
            if strongest > 0.0 {
                let color = (vpl.flux / strongest).to_array();
                let color = color.map(|v| v.max(0.0).powf(1.0 / 2.2));
                self.point(vpl.position, ink(color, 1.0), 2.5);
            }
        }
    }

    fn invalid(&mut self, baker: &Baker) {
        // Where the lights of an aperture's cells are.
        let mut reach = BTreeMap::new();
        for (cell, light) in baker.virtual_lights() {
            if let (CellId::Aperture { .. }, Some(_)) = (cell, lumens(light)) {
                let bounds = reach.entry(*cell).or_insert(Bounds::EMPTY);
                match &light.shape {
                    Shape::Polygon { vertices } => {
                        *bounds = vertices.iter().fold(*bounds, |b, v| b.with(*v));
                    }
                    _ => *bounds = bounds.with(light.position),
                }
            }
        }
        let mut wrong = BTreeMap::new();
        for (cell, lumens) in baker.invalid_flux() {
            *wrong.entry(cell).or_insert(0.0) += lumens as f32;
        }
        let most = wrong.values().copied().fold(0.0, f32::max);
        if most <= 0.0 {
            return;
        }
        let scene = baker.scene().bounds();
        let most = round_up(most);
        let scale = Scale([most * 1e-3, most]);
        for (cell, lumens) in wrong {
            let bounds = match cell {
                CellId::Octree(cell) => Some(inside(cell, &scene)),
                CellId::Aperture { .. } => reach.get(&cell).copied(),
            };
            if let Some(bounds) = bounds.filter(|_| lumens > scale.0[0]) {
                let color = scale.color(lumens);
                self.walls(&bounds, ink(color, 0.12));
                self.frame(&bounds, ink(color, 0.9), 1.3);
            }
        }
        self.scales.push((Overlay::Invalid, scale.0));
    }

    fn charts(&mut self, baker: &Baker, page: u32) {
        let atlas = baker.atlas();
        let scene = baker.scene();
        let mut known = BTreeMap::new();
        for (o, object) in (0u32..).zip(&atlas.objects) {
            if object.page != page || scene.is_gone(o) {
                continue;
            }
            let borders = known
                .entry(Arc::as_ptr(&object.layout) as usize)
                .or_insert_with(|| borders(&object.layout));
            // Neighbours in the list get hues far from each other.
            let hue = (o as f32 * 0.618_034).fract();
            let color =
                [0.0, 1.0 / 3.0, 2.0 / 3.0].map(|shift| 0.62 + 0.38 * (TAU * (hue + shift)).cos());
            let (color, origin) = (ink(color, 1.0), object.origin.as_vec2());
            for [a, b] in borders {
                let at = |uv: &Vec2| (*uv + origin).extend(0.0);
                self.line(at(a), at(b), color, 1.2);
            }
        }
    }
}

/// The edges that belong to one triangle of a layout alone.
fn borders(layout: &UvLayout) -> Vec<[Vec2; 2]> {
    // By place: vertices may be split inside of a chart, too.
    let key = |v: Vec2| [v.x.to_bits(), v.y.to_bits()];
    let mut sides: Vec<[Vec2; 2]> = Vec::with_capacity(3 * layout.triangles.len());
    for triangle in &layout.triangles {
        let [a, b, c] = triangle.map(|v| layout.vertices[v as usize].uv);
        sides.extend([[a, b], [b, c], [c, a]].map(
            |[a, b]| {
                if key(a) <= key(b) { [a, b] } else { [b, a] }
            },
        ));
    }
    sides.sort_unstable_by_key(|[a, b]| [key(*a), key(*b)]);
    let groups = sides.chunk_by(|a, b| a == b);
    groups.filter(|g| g.len() == 1).map(|g| g[0]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lightmap::UvVertex;

    #[test]
    fn a_square_of_two_triangles_has_four_borders_even_with_split_vertices() {
        let corners = [
            [0.0, 0.0],
            [1.0, 0.0],
            [1.0, 1.0],
            [0.0, 1.0],
            [1.0, 1.0],
            [0.0, 0.0],
        ];
        let vertices = corners.map(|uv| UvVertex {
            source: 0,
            uv: Vec2::from(uv),
        });
        let layout = UvLayout {
            vertices: vertices.to_vec(),
            triangles: vec![[0, 1, 2], [4, 3, 5]],
            charts: vec![0, 0],
        };
        let borders = borders(&layout);
        assert_eq!(borders.len(), 4);
        let length: f32 = borders.iter().map(|[a, b]| a.distance(*b)).sum();
        assert_eq!(length, 4.0);
    }
}

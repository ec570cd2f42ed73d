//! The texel list: for each texel that a surface claims, the point of the surface that it stands for.

use std::collections::BTreeSet;
use std::ops::Range;

use glam::{DVec2, DVec3, UVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::pool::Pool;
use super::tiles::arrange;
use super::{Atlas, Clearance, ObjectAtlas, Texel};
use crate::scene::{Mesh, Scene};

/// How far inside its triangle a texel's point lies at least, in texels (less in triangles too small for that), so that
/// it does not lie in the wall that meets the surface there.
const INSET: f64 = 1.0 / 64.0;
/// The same at most, as a share of the inradius: the incentre of a sliver lies near one of its ends, and texels along the other
/// are not all to be lit where that share ends.
const INSET_SHARE: f64 = 0.1;

/// Which triangle owns which texel, as `bake::uv_raster` finds it (VPL13 section 4).
#[derive(Clone, Debug, Default)]
pub struct Claims {
    /// Per page, `page_size²` claims (or nothing, where no object was asked for), top row first: [`Claims::NONE`], or the triangle in the low 30 bits and above them
    /// how it claims: 0 it covers the centre, 1 an edge crosses the texel, 2 an edge passes within reach, 3 a vertex does.
    pub pages: Vec<Vec<u32>>,
    /// The number of each object's first triangle, counted over all objects in order; the total follows.
    pub first_triangle: Vec<u32>,
    /// Counts and time.
    pub statistics: ClaimStatistics,
}

/// VPL13's table (section 7) for one scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct ClaimStatistics {
    /// Triangles that own at least one texel (#T_uv).
    pub t_uv: u32,
    /// Texels whose centre no triangle covers, found by edges and vertices (#P_uv).
    pub p_uv: u32,
    /// All claimed texels.
    pub texels: u32,
    /// Milliseconds from the layout to the claims, transfers included.
    pub ms: f64,
}

impl Claims {
    /// Nobody's texel.
    pub const NONE: u32 = u32::MAX;

    /// The triangle's number over all objects; none for an unclaimed texel.
    pub fn triangle(claim: u32) -> Option<u32> {
        (claim != Self::NONE).then_some(claim & 0x3fff_ffff)
    }

    /// Whether a triangle covers the texel's centre.
    pub fn is_covered(claim: u32) -> bool {
        claim < 1 << 30
    }

    /// What one object claims.
    pub fn of_object(&self, atlas: &Atlas, object: u32) -> ClaimStatistics {
        let object = object as usize;
        let layout = &atlas.objects[object];
        let own = self.first_triangle[object]..self.first_triangle[object + 1];
        let mut statistics = ClaimStatistics::default();
        if own.is_empty() {
            return statistics;
        }
        let mut owns = vec![false; own.len()];
        let page = &self.pages[layout.page as usize];
        let end = (layout.origin + layout.size).min(UVec2::splat(atlas.page_size));
        for y in layout.origin.y..end.y {
            let row = (y * atlas.page_size) as usize;
            for claim in &page[row + layout.origin.x as usize..row + end.x as usize] {
                let triangle = Self::triangle(*claim).filter(|t| own.contains(t));
                let Some(triangle) = triangle else { continue };
                let owned = &mut owns[(triangle - own.start) as usize];
                statistics.texels += 1;
                statistics.p_uv += u32::from(!Self::is_covered(*claim));
                statistics.t_uv += u32::from(!std::mem::replace(owned, true));
            }
        }
        statistics
    }
}

/// All texels that receive light.
#[derive(Clone, Debug, Default)]
pub struct Texels {
    /// By object; within it in tiles that lie together and face alike, the last of them filled up with copies of its last
    /// texel whose `pixel` is [`Texel::NONE`]. Tiles that are no object's hold what they held last.
    pub list: Vec<Texel>,
    /// Per object, its tiles of [`Texel::TILE`] entries of the list; none for one that is gone.
    pub tiles: Vec<Range<u32>>,
    /// Entries of objects that are no fillers.
    pub count: u32,
    /// What stands near each entry of the list, as far as that was looked for: nothing near those beyond the end.
    pub clearances: Vec<Clearance>,
    /// Where objects that come find room.
    pub room: Room,
}

/// Which tiles are nobody's.
#[derive(Clone, Debug, Default)]
pub struct Room {
    tiles: Pool,
    /// Objects that had texels, but are gone.
    retired: BTreeSet<u32>,
}

/// A claimed texel on its way into the list.
#[derive(Clone, Copy)]
struct Claimed {
    /// Inside its page.
    at: UVec2,
    /// Inside its mesh.
    triangle: u32,
}

impl Texels {
    /// What stands near some entries of the list.
    pub fn clearances_of(&self, entries: Range<usize>) -> Vec<Clearance> {
        let known = self.clearances.get(entries.start..).unwrap_or(&[]);
        let known = &known[..known.len().min(entries.len())];
        let mut all = known.to_vec();
        all.resize(entries.len(), Clearance::OPEN);
        all
    }

    /// Finds each claimed texel's point: its centre where its triangle covers it, the nearest point of the triangle
    /// elsewhere.
    ///
    /// Normals are of the front side, in object space, mirrored objects included. Into world space they go by the
    /// inverse transpose, that is the cofactor matrix times the determinant's *sign*: the cofactor matrix alone
    /// would turn the normals of a mirrored object to its back.
    pub fn build(scene: &Scene, atlas: &Atlas, claims: &Claims) -> Self {
        let mut texels = Self::default();
        let all: Vec<u32> = (0..atlas.objects.len() as u32).collect();
        texels.extend(scene, atlas, claims, &all);
        texels
    }

    /// Objects of a scene that were gone and are there again, ascending: they need texels, which come out as they were.
    pub fn lacking(&self, scene: &Scene) -> Vec<u32> {
        let stands = |o: &u32| (*o as usize) < scene.objects.len() && !scene.is_gone(*o);
        self.room.retired.iter().copied().filter(stands).collect()
    }

    /// An object is gone: its tiles are nobody's, but what they hold is still needed, until they are [released](Texels::release).
    pub fn retire(&mut self, object: u32) -> Range<u32> {
        let tiles = self.tiles.get_mut(object as usize);
        let tiles = tiles.map(std::mem::take).unwrap_or_default();
        if !tiles.is_empty() {
            self.room.retired.insert(object);
            self.count -= lit(&self.list[entries(&tiles)]);
        }
        tiles
    }

    /// Gives tiles back that were retired, to objects that come.
    pub fn release(&mut self, tiles: Range<u32>) {
        self.room.tiles.give(tiles);
    }

    /// Finds tiles for an object that has none: the first free ones that lie together, or new ones at the end of the list.
    pub(crate) fn take(&mut self, object: u32, count: u32) -> Range<u32> {
        let tiles = self.room.tiles.take(count);
        let end = self.list.len().max(tiles.end as usize * Texel::TILE);
        self.list.resize(end, bytemuck::Zeroable::zeroed());
        let known = self.clearances.len();
        let own = entries(&tiles);
        self.clearances[own.start.min(known)..own.end.min(known)].fill(Clearance::OPEN);
        if self.tiles.len() <= object as usize {
            self.tiles.resize(object as usize + 1, 0..0);
        }
        self.tiles[object as usize] = tiles.clone();
        self.room.retired.remove(&object);
        tiles
    }

    /// Finds the texels of some objects (ascending), as [`Texels::build`] does, and room for them; returns their tiles. `claims`
    /// need not hold more than these objects'. None of them has tiles, or what it has is [retired](Texels::retire) first.
    pub fn extend(
        &mut self,
        scene: &Scene,
        atlas: &Atlas,
        claims: &Claims,
        objects: &[u32],
    ) -> Vec<Range<u32>> {
        let per_object: Vec<Vec<Claimed>> = objects
            .par_iter()
            .map(|&object| {
                let object = object as usize;
                let own = claims.first_triangle[object]..claims.first_triangle[object + 1];
                collect(atlas, &atlas.objects[object], own, claims)
            })
            .collect();

        let mut new = Vec::new();
        let mut parts: Vec<(usize, u32, &[Claimed])> = Vec::new();
        for (&object, claimed) in objects.iter().zip(&per_object) {
            let count = (claimed.len().div_ceil(Texel::TILE)) as u32;
            let tiles = self.take(object, count);
            self.count += claimed.len() as u32;
            if count > 0 {
                parts.push((entries(&tiles).start, object, claimed));
                new.push(tiles);
            }
        }
        parts.sort_unstable_by_key(|part| part.0);
        let (mut rest, mut before) = (&mut self.list[..], 0);
        for (start, object, claimed) in parts {
            let filled = claimed.len().next_multiple_of(Texel::TILE);
            let (own, others) = rest[start - before..].split_at_mut(filled);
            (rest, before) = (others, start + filled);
            let layout = &atlas.objects[object as usize];
            let mesh = scene.mesh(object);
            own.par_iter_mut()
                .zip(claimed)
                .with_min_len(1024)
                .for_each(|(texel, claimed)| {
                    let [position, normal, face] = surface_point(mesh, layout, claimed);
                    let page = atlas.page_size * layout.page;
                    *texel = Texel {
                        position: position.to_array(),
                        object,
                        normal: normal.to_array(),
                        face: face.to_array(),
                        pixel: (page + claimed.at.y) * atlas.page_size + claimed.at.x,
                    };
                });
            arrange(&mut own[..claimed.len()]);
            let filler = Texel {
                pixel: Texel::NONE,
                ..own[claimed.len() - 1]
            };
            own[claimed.len()..].fill(filler);
        }
        new
    }
}

/// The entries of the list in some tiles.
fn entries(tiles: &Range<u32>) -> Range<usize> {
    tiles.start as usize * Texel::TILE..tiles.end as usize * Texel::TILE
}

/// How many are no fillers.
fn lit(entries: &[Texel]) -> u32 {
    entries.iter().filter(|t| t.pixel != Texel::NONE).count() as u32
}

/// The object's claimed texels, row by row.
fn collect(atlas: &Atlas, layout: &ObjectAtlas, own: Range<u32>, claims: &Claims) -> Vec<Claimed> {
    if own.is_empty() {
        return Vec::new();
    }
    let page = &claims.pages[layout.page as usize];
    let end = (layout.origin + layout.size).min(UVec2::splat(atlas.page_size));
    (layout.origin.y..end.y)
        .into_par_iter()
        .with_min_len(16)
        .flat_map_iter(|y| {
            let row = (y * atlas.page_size) as usize;
            let own = own.clone();
            (layout.origin.x..end.x).filter_map(move |x| {
                let triangle = Claims::triangle(page[row + x as usize])?;
                let triangle = own.contains(&triangle).then(|| triangle - own.start)?;
                Some(Claimed {
                    at: UVec2::new(x, y),
                    triangle,
                })
            })
        })
        .collect()
}

/// Object-space position, shading normal and geometric normal.
fn surface_point(mesh: &Mesh, layout: &ObjectAtlas, claimed: &Claimed) -> [Vec3; 3] {
    let corners = layout.layout.triangles[claimed.triangle as usize]
        .map(|vertex| layout.layout.vertices[vertex as usize]);
    let center = (claimed.at - layout.origin).as_vec2() + 0.5;
    let weights = inner_weights(corners.map(|corner| corner.uv), center);
    let [b0, b1, b2] = weights.map(|w| w as f32);
    let source = corners.map(|corner| corner.source as usize);

    let [p0, p1, p2] = source.map(|vertex| mesh.positions[vertex]);
    let position = p0 * b0 + p1 * b1 + p2 * b2;
    // The front is the mesh's, whatever order the layout keeps its corners in.
    let [q0, q1, q2] = mesh.triangles[claimed.triangle as usize]
        .map(|vertex| mesh.positions[vertex as usize].as_dvec3());
    let geometric = (q1 - q0).cross(q2 - q0).normalize_or_zero();

    let [n0, n1, n2] = source.map(|vertex| mesh.normals.get(vertex).copied().unwrap_or(Vec3::ZERO));
    let shading = (n0 * b0 + n1 * b1 + n2 * b2).as_dvec3().normalize_or_zero();
    let normal = if geometric == DVec3::ZERO {
        shading.try_normalize().unwrap_or(DVec3::Y)
    } else if shading.dot(geometric) > 0.0 {
        shading
    } else {
        geometric
    };
    let face = if geometric == DVec3::ZERO {
        normal
    } else {
        geometric
    };
    [position, normal.as_vec3(), face.as_vec3()]
}

/// Barycentric weights of the point nearest to `center` among those at least [`INSET`] inside the triangle.
///
/// These points are the triangle shrunk around its incentre, whose weights are the sides' shares of the perimeter: so
/// the nearest point is sought in the shrunk triangle, and nothing is divided by an area that may be zero.
fn inner_weights(uv: [Vec2; 3], center: Vec2) -> [f64; 3] {
    let v = uv.map(|uv| (uv - center).as_dvec2());
    let area = (v[1] - v[0]).perp_dot(v[2] - v[0]);
    let sides = [
        v[1].distance(v[2]),
        v[2].distance(v[0]),
        v[0].distance(v[1]),
    ];
    let perimeter: f64 = sides.iter().sum();
    if perimeter.is_nan() || perimeter <= 0.0 {
        return [1.0 / 3.0; 3];
    }
    let incentre = sides.map(|side| side / perimeter);
    let middle = v[0] * incentre[0] + v[1] * incentre[1] + v[2] * incentre[2];
    let inradius = area.abs() / perimeter;
    let shrink = 1.0 - (INSET / inradius).min(INSET_SHARE);
    let near = nearest_weights(v.map(|v| middle + (v - middle) * shrink));
    std::array::from_fn(|i| near[i] * shrink + incentre[i] * (1.0 - shrink))
}

/// Barycentric weights of the triangle's point nearest to the origin.
fn nearest_weights(v: [DVec2; 3]) -> [f64; 3] {
    let area = (v[1] - v[0]).perp_dot(v[2] - v[0]);
    let parts = [
        v[1].perp_dot(v[2]),
        v[2].perp_dot(v[0]),
        v[0].perp_dot(v[1]),
    ];
    if area != 0.0 && parts.iter().all(|part| part * area >= 0.0) {
        return parts.map(|part| part / area);
    }
    let mut best = ([1.0, 0.0, 0.0], f64::INFINITY);
    for i in 0..3 {
        let j = (i + 1) % 3;
        let along = v[j] - v[i];
        let length = along.length_squared();
        let t = if length > 0.0 {
            (-v[i].dot(along) / length).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let distance = (v[i] + along * t).length_squared();
        if distance < best.1 {
            let mut weights = [0.0; 3];
            weights[i] = 1.0 - t;
            weights[j] = t;
            best = (weights, distance);
        }
    }
    best.0
}

#[cfg(test)]
mod tests;

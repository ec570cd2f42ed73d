//! Finds which triangle owns which texel: three compute passes over all triangles in uv space (VPL13 section 4).
//!
//! Triangles claim the texels whose centre they cover; then edges, then vertices, claim what is left of the texels that
//! bilinear filtering can fetch. These are enough: if filtering at a point of a triangle fetches a texel whose centre
//! no triangle covers, then an edge crosses the way from the point to that centre, inside the box of one texel around
//! it. Unlike VPL13, which leaves lines and points to the device's rasterization rules and says that some texels are
//! missed, the rule is decided in integers: it is exact, misses nothing, and gives the same on every device.

use std::time::Instant;

use bytemuck::{Pod, Zeroable};
use glam::{IVec2, UVec2, Vec2};

use crate::bake::device::shaders::{UV_EDGES, UV_TRIANGLES, UV_VERTICES};
use crate::bake::device::shared::{UV_REACH, UV_UNIT};
use crate::gpu::{Address, Buffer, Gpu, GpuError, Memory, Pipeline, Result, Stage};
use crate::lightmap::texels::{ClaimStatistics, Claims};
use crate::lightmap::{Atlas, ObjectAtlas};

/// Triangles and strips that one submission takes at most.
const SUBMISSION: usize = 1 << 20;
/// Texels that a strip looks at, unless one row alone has more.
const STRIP_TEXELS: i64 = 1024;
/// Corners of rectangles are packed into 16 bits a coordinate, and grid products must fit 64.
const MAX_PAGE: u32 = 1 << 15;
/// Claims keep triangles in 30 bits, and all ones is [`Claims::NONE`].
const MAX_TRIANGLES: u64 = (1 << 30) - 1;

const UNIT: i32 = UV_UNIT as i32;
const REACH: i32 = UV_REACH as i32;

/// Shared with the shaders, which say more.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
struct UvTriangle {
    corner: [[i32; 2]; 3],
    id: u32,
    low: u32,
    high: u32,
}

/// Shared with the shaders, which say more.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
struct UvStrip {
    primitive: u32,
    rows: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    triangles: Address,
    strips: Address,
    claims: Address,
    count: u32,
    page_size: u32,
}

/// Claims every texel that bilinear filtering of any surface point can fetch, each for a triangle of the object in
/// whose rectangle it lies.
///
/// # Errors
/// The device's own, and [`GpuError::OutOfMemory`] for a scene past 2^30 triangles or pages past 32,768 texels.
pub fn rasterize(gpu: &Gpu, atlas: &Atlas) -> Result<Claims> {
    let all: Vec<u32> = (0..atlas.objects.len() as u32).collect();
    let mut claims = rasterize_objects(gpu, atlas, &all)?;
    let pixels = (atlas.page_size as usize).pow(2);
    for page in &mut claims.pages {
        page.resize(pixels, Claims::NONE);
    }
    Ok(claims)
}

/// As [`rasterize`], for some objects alone. Pages without any of them are left empty.
///
/// # Errors
/// As for [`rasterize`].
pub fn rasterize_objects(gpu: &Gpu, atlas: &Atlas, objects: &[u32]) -> Result<Claims> {
    let start = Instant::now();
    let first_triangle = number_triangles(atlas, objects)?;
    let side = atlas.page_size as usize;
    let passes = Passes::new(gpu)?;
    let buffer = gpu.buffer("texel claims", 4 * (side * side) as u64, Memory::Device)?;
    let mut pages = vec![Vec::new(); atlas.pages as usize];
    for (page, claims) in pages.iter_mut().enumerate() {
        let own = || {
            let objects = objects.iter().map(|o| *o as usize);
            objects
                .map(|o| (o, &atlas.objects[o]))
                .filter(|(_, layout)| {
                    layout.page as usize == page && !layout.layout.triangles.is_empty()
                })
        };
        // Only the rows of the objects' rectangles are cleared and read back.
        let first = own().map(|(_, o)| o.origin.y as usize).min().unwrap_or(0);
        let last = own().map(|(_, o)| (o.origin.y + o.size.y) as usize).max();
        let Some(last) = last.map(|last| last.min(side)).filter(|last| first < *last) else {
            continue;
        };
        let rows = first * side..last * side;
        let mut cmd = gpu.commands()?;
        let bytes = 4 * rows.len() as u64;
        cmd.fill(&buffer, 4 * rows.start as u64, bytes, Claims::NONE);
        cmd.submit()?.wait()?;
        let mut work = Work::default();
        for (object, layout) in own() {
            for (i, triangle) in layout.layout.triangles.iter().enumerate() {
                let uv = triangle.map(|vertex| layout.layout.vertices[vertex as usize].uv);
                work.push(grid_triangle(uv, layout, first_triangle[object] + i as u32));
                if work.is_full() {
                    passes.run(gpu, &std::mem::take(&mut work), &buffer, atlas.page_size)?;
                }
            }
        }
        passes.run(gpu, &work, &buffer, atlas.page_size)?;
        claims.resize(rows.start, Claims::NONE);
        claims.extend(buffer.read::<u32>(rows)?);
        claims.resize(side * side, Claims::NONE);
    }
    let mut statistics = count(&pages, first_triangle[atlas.objects.len()]);
    statistics.ms = start.elapsed().as_secs_f64() * 1e3;
    Ok(Claims {
        pages,
        first_triangle,
        statistics,
    })
}

/// Running count of triangles over the objects, those of `objects` alone.
fn number_triangles(atlas: &Atlas, objects: &[u32]) -> Result<Vec<u32>> {
    let mut counts = vec![0; atlas.objects.len()];
    for &object in objects {
        counts[object as usize] = atlas.objects[object as usize].layout.triangles.len();
    }
    let mut total = 0u64;
    let mut first = vec![0];
    for count in counts {
        total += count as u64;
        first.push(total.min(MAX_TRIANGLES) as u32);
    }
    let too_much = |name: &str, bytes, reason: String| GpuError::OutOfMemory {
        name: name.into(),
        bytes,
        reason,
    };
    if total > MAX_TRIANGLES {
        let bytes = total * size_of::<UvTriangle>() as u64;
        let reason = format!("{total} triangles, {MAX_TRIANGLES} is the most");
        return Err(too_much("triangles in uv space", bytes, reason));
    }
    if atlas.page_size > MAX_PAGE {
        let bytes = u64::from(atlas.page_size).pow(2) * 4;
        let reason = format!(
            "pages of {} texels, {MAX_PAGE} is the most",
            atlas.page_size
        );
        return Err(too_much("texel claims", bytes, reason));
    }
    Ok(first)
}

fn count(pages: &[Vec<u32>], triangles: u32) -> ClaimStatistics {
    let mut statistics = ClaimStatistics::default();
    let mut owns = vec![false; triangles as usize];
    for &claim in pages.iter().flatten() {
        if let Some(triangle) = Claims::triangle(claim) {
            statistics.texels += 1;
            statistics.p_uv += u32::from(!Claims::is_covered(claim));
            statistics.t_uv += u32::from(!std::mem::replace(&mut owns[triangle as usize], true));
        }
    }
    statistics
}

/// Rounds a triangle to the page's grid. Coordinates that cannot be (outside the rectangle, not a number) are clamped.
fn grid_triangle(uv: [Vec2; 3], layout: &ObjectAtlas, id: u32) -> UvTriangle {
    let end = layout.origin + layout.size;
    let corner = uv.map(|uv| {
        let uv = uv.clamp(Vec2::splat(-1.0), layout.size.as_vec2() + 1.0);
        let steps = IVec2::new(
            (uv.x * UNIT as f32).round_ties_even() as i32,
            (uv.y * UNIT as f32).round_ties_even() as i32,
        );
        (layout.origin.as_ivec2() * UNIT + steps).to_array()
    });
    UvTriangle {
        corner,
        id,
        low: pack(layout.origin),
        high: pack(end),
    }
}

fn pack(at: UVec2) -> u32 {
    at.x | at.y << 16
}

/// First texel whose centre lies at or after `v`.
fn first_texel(v: i32) -> i32 {
    (v + UNIT / 2 - 1).div_euclid(UNIT)
}

/// Last texel whose centre lies at or before `v`.
fn last_texel(v: i32) -> i32 {
    (v - UNIT / 2).div_euclid(UNIT)
}

/// Triangles of one page, and the strips that the passes take.
#[derive(Default)]
struct Work {
    triangles: Vec<UvTriangle>,
    faces: Vec<UvStrip>,
    edges: Vec<UvStrip>,
    vertices: Vec<UvStrip>,
}

impl Work {
    fn is_full(&self) -> bool {
        self.triangles.len() >= SUBMISSION
            || self.edges.len().max(self.faces.len()) >= 2 * SUBMISSION
    }

    fn push(&mut self, triangle: UvTriangle) {
        let index = self.triangles.len() as u32;
        let [a, b, c] = triangle.corner.map(IVec2::from);
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let rows = (triangle.low >> 16) as i32..=(triangle.high >> 16) as i32 - 1;
        let clamp = |first: i32, last: i32| (first.max(*rows.start()), last.min(*rows.end()));

        // Columns and rows of centres inside the bounds: without both, no texel is covered.
        let columns = last_texel(high.x) - first_texel(low.x) + 1;
        if columns > 0 {
            let (first, last) = clamp(first_texel(low.y), last_texel(high.y));
            add_strips(&mut self.faces, index, first, last, columns.into());
        }
        for (k, (from, to)) in [(a, b), (b, c), (c, a)].into_iter().enumerate() {
            let along = (to - from).abs();
            if along == IVec2::ZERO {
                continue;
            }
            let (low, high) = (from.min(to).y, from.max(to).y);
            let (first, last) = clamp(first_texel(low - REACH + 1), last_texel(high + REACH - 1));
            // A row's boxes see two texels' worth of the edge.
            let slope = 2 * i64::from(along.x) / i64::from(along.y).max(1);
            let columns = slope.min(i64::from(along.x / UNIT)) + 4;
            add_strips(&mut self.edges, 3 * index + k as u32, first, last, columns);
        }
        if a == b && b == c {
            let (first, last) = clamp(first_texel(a.y - REACH + 1), last_texel(a.y + REACH - 1));
            add_strips(&mut self.vertices, index, first, last, 3);
        }
        self.triangles.push(triangle);
    }
}

/// Cuts rows `first..=last` of about `columns` texels each into strips.
fn add_strips(strips: &mut Vec<UvStrip>, primitive: u32, first: i32, last: i32, columns: i64) {
    let height = (STRIP_TEXELS / columns).max(1) as i32;
    let mut row = first;
    while row <= last {
        let end = last.min(row + height - 1);
        strips.push(UvStrip {
            primitive,
            rows: row as u32 | (end as u32) << 16,
        });
        row = end + 1;
    }
}

struct Passes {
    triangles: Pipeline,
    edges: Pipeline,
    vertices: Pipeline,
}

impl Passes {
    fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            triangles: gpu.pipeline(UV_TRIANGLES, &[])?,
            edges: gpu.pipeline(UV_EDGES, &[])?,
            vertices: gpu.pipeline(UV_VERTICES, &[])?,
        })
    }

    /// Lets all of `work` claim, and waits.
    fn run(&self, gpu: &Gpu, work: &Work, claims: &Buffer, page_size: u32) -> Result<()> {
        if work.triangles.is_empty() {
            return Ok(());
        }
        let triangles = gpu.buffer_with("triangles in uv space", &work.triangles)?;
        let passes = [
            ("uv triangles", &self.triangles, &work.faces),
            ("uv edges", &self.edges, &work.edges),
            ("uv vertices", &self.vertices, &work.vertices),
        ];
        let strips = passes
            .iter()
            .map(|(name, _, strips)| gpu.buffer_with(name, strips))
            .collect::<Result<Vec<_>>>()?;
        let mut cmd = gpu.commands()?;
        for ((name, pipeline, list), strips) in passes.into_iter().zip(&strips) {
            let count = list.len() as u32;
            let push = Push {
                triangles: triangles.address(),
                strips: strips.address(),
                claims: claims.address(),
                count,
                page_size,
            };
            cmd.scope(name, |cmd| cmd.dispatch(pipeline, &push, [count, 1, 1]));
            // Claims are minima: the order changes nothing but the time, as who sees a lower claim leaves it.
            cmd.barrier(Stage::Compute, Stage::Compute);
        }
        cmd.submit()?.wait()
    }
}

#[cfg(test)]
mod tests;

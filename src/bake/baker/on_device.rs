//! A look at the map where it lies, for those who show it while it is worked on.

use std::ops::Range;

use crate::bake::baker::Baker;
use crate::gpu::Buffer;
use crate::lightmap::Texel;

/// The map on the device. Between two calls of [`Baker::step`] every update is in it wholly or not at all, in the order of
/// the queue: what is submitted now reads all of those that were done.
pub struct OnDevice<'a> {
    /// Signed 64-bit fixed-point irradiance: per tile 64 reds, 64 greens, 64 blues.
    pub sums: &'a Buffer,
    /// [`Texel`]s, tile by tile.
    pub texels: &'a Buffer,
    /// Lux per fixed-point unit.
    pub unit: f64,
    /// Tiles of the objects that are there.
    pub tiles: Vec<Range<u32>>,
}

impl Baker {
    /// Where the map lies on the device at this moment.
    pub fn on_device(&self) -> OnDevice<'_> {
        let tile = |range: Range<usize>| {
            (range.start / Texel::TILE) as u32..(range.end / Texel::TILE) as u32
        };
        let mut tiles: Vec<Range<u32>> = Vec::new();
        for range in self.live_tiles().map(tile).filter(|r| !r.is_empty()) {
            match tiles.last_mut() {
                Some(last) if last.end == range.start => last.end = range.end,
                _ => tiles.push(range),
            }
        }
        let pass = self.illumination.pass();
        OnDevice {
            sums: pass.sums(),
            texels: self.illumination.texels(),
            unit: 1.0 / f64::from(pass.scale()),
            tiles,
        }
    }

    /// Width and height of the lightmap's pages, texels, and their number, pages included that only objects in other states
    /// of the scene need.
    pub fn page_layout(&self) -> [u32; 2] {
        [self.atlas.page_size, self.atlas.pages]
    }
}

//! Room on the device for depth maps of one size.

use std::collections::VecDeque;

use crate::bake::device::shared::BATCH;
use crate::gpu::{Buffer, Gpu, Memory, Result};

/// Bytes of an allocation, if a map is not larger.
const CHUNK_BYTES: u64 = 48 << 20;

/// Places for maps of one size, each of them free or in use so many times.
pub(super) struct Shelf {
    gpu: Gpu,
    /// Bytes of a map.
    bytes: u64,
    chunks: Vec<Buffer>,
    uses: Vec<u32>,
    /// Those free for longest first, and when they may be used again.
    free: VecDeque<(u64, u32)>,
    /// How many lights came by that have maps of this size.
    lights: u64,
}

impl Shelf {
    pub fn new(gpu: &Gpu, bytes: u64) -> Self {
        Self {
            gpu: gpu.clone(),
            bytes,
            chunks: Vec::new(),
            uses: Vec::new(),
            free: VecDeque::new(),
            lights: 0,
        }
    }

    /// Maps of an allocation; the last one may be shorter.
    fn per_chunk(&self) -> u32 {
        (CHUNK_BYTES / self.bytes).max(1) as u32
    }

    /// Where a map is, and how many bytes before it.
    pub fn at(&self, place: u32) -> (&Buffer, u64) {
        let (chunk, at) = (place / self.per_chunk(), place % self.per_chunk());
        (&self.chunks[chunk as usize], u64::from(at) * self.bytes)
    }

    /// All places are free.
    pub fn clear(&mut self) {
        self.uses.fill(0);
        self.free = (0..self.uses.len() as u32)
            .map(|place| (0, place))
            .collect();
    }

    /// Another light comes by. What it leaves may be looked up by those that are sent together with it: nothing may be drawn there
    /// before they are.
    pub fn tick(&mut self) {
        self.lights += 1;
    }

    pub fn has_room(&self) -> bool {
        let first = self.free.front();
        first.is_some_and(|(when, _)| *when <= self.lights)
    }

    /// Makes room for more maps, in so many bytes at most; returns how many it took.
    pub fn extend(&mut self, most: u64) -> Result<u64> {
        let have = self.uses.len() as u32;
        // Whole chunks but for the last one: places are found by division.
        let more = u64::from(self.per_chunk()).min(most / self.bytes) as u32;
        if more == 0 || !have.is_multiple_of(self.per_chunk()) {
            return Ok(0);
        }
        let bytes = u64::from(more) * self.bytes;
        let chunk = self.gpu.buffer("kept depth maps", bytes, Memory::Device)?;
        self.chunks.push(chunk);
        self.uses.resize((have + more) as usize, 0);
        (have..have + more)
            .rev()
            .for_each(|place| self.free.push_front((0, place)));
        Ok(bytes)
    }

    /// A free place, if there is one; somebody is to use it.
    pub fn take(&mut self) -> Option<u32> {
        if !self.has_room() {
            return None;
        }
        self.free.pop_front().map(|(_, place)| place)
    }

    /// One more uses a map.
    pub fn begin(&mut self, place: u32) {
        self.uses[place as usize] += 1;
    }

    /// One less uses a map.
    pub fn end(&mut self, place: u32) {
        let uses = &mut self.uses[place as usize];
        *uses -= 1;
        if *uses == 0 {
            self.free.push_back((self.lights + u64::from(BATCH), place));
        }
    }
}

//! Device buffers whose slots are taken and given back: grown when none is left, and emptied where nothing is any more.

use std::ops::Range;

use crate::gpu::{Buffer, Commands, Gpu, Memory, Result, Stage};

pub(in crate::bake) use crate::lightmap::pool::Pool;

/// Makes `buffer` hold at least `bytes`, with half as much again to spare; what it holds is kept. Whether it moved: its
/// address is then another.
pub(in crate::bake) fn grow(
    gpu: &Gpu,
    cmd: &mut Commands,
    buffer: &mut Buffer,
    bytes: u64,
) -> Result<bool> {
    let Some(larger) = larger(gpu, buffer, bytes)? else {
        return Ok(false);
    };
    cmd.barrier(Stage::All, Stage::Transfer);
    cmd.copy(buffer, 0, &larger, 0, buffer.size());
    cmd.barrier(Stage::Transfer, Stage::All);
    *buffer = larger;
    Ok(true)
}

/// Likewise, but for what it holds: that is lost.
pub(in crate::bake) fn renew(gpu: &Gpu, buffer: &mut Buffer, bytes: u64) -> Result<()> {
    if let Some(larger) = larger(gpu, buffer, bytes)? {
        *buffer = larger;
    }
    Ok(())
}

fn larger(gpu: &Gpu, buffer: &Buffer, bytes: u64) -> Result<Option<Buffer>> {
    if bytes <= buffer.size() {
        return Ok(None);
    }
    let spare = (bytes + bytes / 2).next_multiple_of(16);
    gpu.buffer(buffer.name(), spare, Memory::Device).map(Some)
}

/// Fills slots of `slot` bytes (a multiple of 4) that were given back with `nobody`, so that they name no instance any more.
pub(in crate::bake) fn vacate(
    cmd: &mut Commands,
    buffer: &Buffer,
    slot: usize,
    mut slots: Vec<Range<u32>>,
    nobody: u32,
) {
    slots.retain(|range| !range.is_empty());
    slots.sort_unstable_by_key(|range| range.start);
    for run in slots.chunk_by(|a, b| a.end == b.start) {
        let (first, end) = (u64::from(run[0].start), u64::from(run[run.len() - 1].end));
        let slot = slot as u64;
        cmd.fill(buffer, first * slot, (end - first) * slot, nobody);
    }
}

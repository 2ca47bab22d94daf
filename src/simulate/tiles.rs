//! The tiles of a sensor: how many pixels they have, and their bits together.

use crate::plan::{LANES, Plan};

/// Pixels of a tile: its tables, state and bits stay in the first-level cache.
const TILE: usize = 4096;

/// Most pixels that act on each other and still run as one tile on one thread: it keeps about 120 bytes a pixel,
/// 30 MB of these.
const TOGETHER: usize = 1 << 18;

/// Threads up to which pixels that act on each other run as one tile, on one of them: tiles run a readout at a time, and three
/// threads on two cores were slower with them (`docs/why/performance.md`).
const TOGETHER_THREADS: usize = 2;

const _: () = assert!(TILE.is_multiple_of(LANES));

/// Pixels of a tile of a plan that runs on `threads`.
pub(super) fn tile_of(plan: &Plan, threads: usize) -> usize {
    let together = plan.couples() && threads <= TOGETHER_THREADS && plan.padded() <= TOGETHER;
    if together { plan.padded() } else { TILE }
}

/// Collects the tiles' bits of readout `t` into a packed frame.
pub(super) fn gather(tiles: &[Vec<u8>], pixels: usize, t: usize, plan: &Plan, frame: &mut [u8]) {
    for (i, (bits, slot)) in tiles.iter().zip(frame.chunks_mut(pixels / 8)).enumerate() {
        let bytes = pixels.min(plan.padded() - i * pixels) / 8;
        slot.copy_from_slice(&bits[t * bytes..][..slot.len()]);
    }
    // Flipped bits may reach into the padding.
    let used = plan.geometry().pixels() % 8;
    if let (Some(last), true) = (frame.last_mut(), used != 0) {
        *last &= (1 << used) - 1;
    }
}

//! The tiles of a sensor: the number of pixels per tile, and the collection of the tiles' bits.

use crate::plan::{PIXEL_ALIGNMENT, Plan};

/// Number of pixels in a tile. The tables, the state and the bits of a tile of this size fit in the first-level cache.
const TILE_PIXELS: usize = 4096;

/// Maximum number of coupled pixels that run as one tile on one thread. Such a tile needs about 120 bytes per pixel, in
/// total 30 MB.
const MAX_COUPLED_TILE_PIXELS: usize = 1 << 18;

/// Maximum number of threads for which coupled pixels run as one tile. Only one of the threads then works.
///
/// Several tiles of coupled pixels run one readout at a time. On two cores, three threads were slower with several tiles
/// than with one tile (`docs/why/performance.md`).
const MAX_COUPLED_TILE_THREADS: usize = 2;

const _: () = assert!(TILE_PIXELS.is_multiple_of(PIXEL_ALIGNMENT));

/// Returns the number of pixels in a tile of a plan that runs on `threads` threads.
pub(super) fn tile_pixels(plan: &Plan, threads: usize) -> usize {
    let together = plan.has_coupled_pixels()
        && threads <= MAX_COUPLED_TILE_THREADS
        && plan.padded_pixels() <= MAX_COUPLED_TILE_PIXELS;
    if together { plan.padded_pixels() } else { TILE_PIXELS }
}

/// Collects the bits of all tiles at readout `t` in a packed frame.
pub(super) fn gather_frame(tiles: &[Vec<u8>], pixels: usize, t: usize, plan: &Plan, frame: &mut [u8]) {
    for (i, (bits, slot)) in tiles.iter().zip(frame.chunks_mut(pixels / 8)).enumerate() {
        let bytes = pixels.min(plan.padded_pixels() - i * pixels) / 8;
        slot.copy_from_slice(&bits[t * bytes..][..slot.len()]);
    }
    // False or missed spikes are made by flipping bits, which may set padding bits. The padding of the last byte is
    // therefore cleared.
    let used = plan.geometry().pixels() % 8;
    if let (Some(last), true) = (frame.last_mut(), used != 0) {
        *last &= (1 << used) - 1;
    }
}

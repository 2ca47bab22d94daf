//! `.dat`: consecutive frames without a header, least significant bit first.
//!
//! SpikeCV, Spike-Zoo and the PKU recordings store the bottom row first. SCSim and SPCS store the top row first, which
//! is also the row order in memory. Zero bits pad the end of each frame to whole bytes, as in the writer of SCSim; see
//! `docs/reference/formats.md`.

use super::bits::{clear_padding, copy_bits};
use spikelane::spikes::Geometry;

/// Reverses the order of rows. Two calls restore the original order, so the function both encodes and decodes.
pub(crate) fn flip(geometry: Geometry, from: &[u8], to: &mut [u8]) {
    let (width, height) = (geometry.width(), geometry.height());
    match width {
        // The widths of the two existing cameras have separate fast versions. With a constant row length, the compiler
        // emits two or four vector moves per row. With a variable row length, the compiler calls `memcpy`, and the
        // call takes longer than the copy.
        400 => flip_rows::<50>(from, to),
        1000 => flip_rows::<125>(from, to),
        _ if width.is_multiple_of(8) => {
            let row = width / 8;
            for (a, b) in from.rchunks_exact(row).zip(to.chunks_exact_mut(row)) {
                b.copy_from_slice(a);
            }
        }
        _ => {
            to.fill(0);
            for r in 0..height {
                copy_bits(to, r * width, from, (height - 1 - r) * width, width);
            }
        }
    }
}

fn flip_rows<const N: usize>(from: &[u8], to: &mut [u8]) {
    let (from, _) = from.as_chunks::<N>();
    let (to, _) = to.as_chunks_mut::<N>();
    for (a, b) in from.iter().rev().zip(to) {
        *b = *a;
    }
}

/// Copies a frame that is stored with the top row first, and clears its padding.
pub(crate) fn copy(geometry: Geometry, from: &[u8], to: &mut [u8]) {
    to.copy_from_slice(from);
    clear_padding(to, geometry.pixels());
}

//! `.dat`: no header, one frame after the other, least significant bit first.
//!
//! SpikeCV, Spike-Zoo and the PKU recordings put the bottom row first; SCSim and SPCS
//! the top row, which makes a frame the same bytes as in memory. A frame is padded to
//! whole bytes with zero bits at its end, as SCSim's writer does; see `docs/reference/formats.md`.

use super::bits::{clear_padding, copy_bits};
use spikelane::spikes::Geometry;

/// Reverses the order of rows; its own inverse, so it encodes and decodes.
pub(crate) fn flip(geometry: Geometry, from: &[u8], to: &mut [u8]) {
    let (width, height) = (geometry.width(), geometry.height());
    match width {
        // The two cameras that exist: a length known to the compiler makes a
        // row two or four vector moves, where a call to memcpy costs more than the row.
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

/// Top row first: the bytes of memory, with padding that is surely zero.
pub(crate) fn copy(geometry: Geometry, from: &[u8], to: &mut [u8]) {
    to.copy_from_slice(from);
    clear_padding(to, geometry.pixels());
}

//! The rows of the 400x250 camera. Each row has 400 pixel bits and 16 header bits.
//!
//! The bottom row comes first, as in `.dat`. SpikeCV (`with_head`) and Spike-Zoo (`remove_head`) read a file of this
//! layout with a width of 416 pixels and remove the last 16 columns. By default, SpikeCV and Spike-Zoo then flip the
//! frame vertically. The meaning of the header bits is not public. The writer sets the header bits to zero, and the
//! reader ignores the header bits.

/// Number of rows of a frame.
const ROWS: usize = 250;
/// Bytes of the pixels in a row.
const PIXEL_BYTES: usize = 50;
/// Bytes of a row in the file.
const ROW_BYTES: usize = 52;
/// Bytes of a frame in the file.
pub(crate) const FRAME_BYTES: usize = ROWS * ROW_BYTES;

pub(crate) fn encode(packed: &[u8], file: &mut [u8]) {
    let rows = packed.as_chunks::<PIXEL_BYTES>().0.iter().rev();
    for (pixels, row) in rows.zip(file.as_chunks_mut::<ROW_BYTES>().0) {
        row[..PIXEL_BYTES].copy_from_slice(pixels);
        row[PIXEL_BYTES..].fill(0);
    }
}

pub(crate) fn decode(file: &[u8], packed: &mut [u8]) {
    let rows = file.as_chunks::<ROW_BYTES>().0.iter().rev();
    for (row, pixels) in rows.zip(packed.as_chunks_mut::<PIXEL_BYTES>().0) {
        pixels.copy_from_slice(&row[..PIXEL_BYTES]);
    }
}

//! The rows of the 400x250 camera: 416 bits each, of which the last 16 are no pixels.
//!
//! Bottom row first like `.dat`: SpikeCV (`with_head`) and Spike-Zoo (`remove_head`) both
//! read such a file as 416 pixels wide, drop the last 16 columns, and turn it upside down
//! by default. What the header bits say is not public; they are written as zero and
//! ignored when read.

/// Rows of a frame.
const ROWS: usize = 250;
/// Bytes of the pixels of a row.
const PIXELS: usize = 50;
/// Bytes of a row in the file.
const ROW: usize = 52;
/// Bytes of a frame in the file.
pub(crate) const FRAME: usize = ROWS * ROW;

pub(crate) fn encode(packed: &[u8], file: &mut [u8]) {
    let rows = packed.as_chunks::<PIXELS>().0.iter().rev();
    for (pixels, row) in rows.zip(file.as_chunks_mut::<ROW>().0) {
        row[..PIXELS].copy_from_slice(pixels);
        row[PIXELS..].fill(0);
    }
}

pub(crate) fn decode(file: &[u8], packed: &mut [u8]) {
    let rows = file.as_chunks::<ROW>().0.iter().rev();
    for (row, pixels) in rows.zip(packed.as_chunks_mut::<PIXELS>().0) {
        pixels.copy_from_slice(&row[..PIXELS]);
    }
}

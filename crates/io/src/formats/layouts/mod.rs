//! One file per layout: how the bits of a frame lie in it.

mod array;
mod bits;
pub(super) mod codec;
mod dat;
pub(super) mod layout;
mod meaning;
mod npy;
mod npz;
mod rows1024;
mod rows416;

use array::is_mapped;
pub(super) use array::{Axes, Packing, pack};
pub(super) use bits::copy_bits;
pub(super) use dat::{copy, flip};
pub(super) use meaning::{Meaning, array_meaning};
pub(super) use npy::{Array, bits_frame, decode_bits, encode_bits, header, meaning, other_geometry, parse};
pub(super) use npz::{Entry, MAGIC as ARCHIVE_MAGIC, read as read_archive};
pub(super) use rows416::{FRAME as ROWS416_FRAME, decode as decode_rows416, encode as encode_rows416};
pub(super) use rows1024::{
    FRAME as ROWS1024_FRAME, decode as decode_rows1024, encode as encode_rows1024, find as find_rows1024,
    is_framed,
};

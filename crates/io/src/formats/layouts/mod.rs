//! Encoding and decoding of frames, one file per layout.

mod array;
mod array_content;
mod bits;
pub(super) mod codec;
mod dat;
pub(super) mod layout;
mod npy;
mod npz;
mod rows1024;
mod rows416;

use array::is_mapped;
pub(super) use array::{PackedStream, ReadoutAxis, pack};
pub(super) use array_content::{ArrayContent, array_content};
pub(super) use bits::copy_bits;
pub(super) use dat::{copy, flip};
pub(super) use npy::{
    ArrayHeader, array_header, bits_frame_bytes, decode_bits, encode_bits, geometry_error, header, parse,
};
pub(super) use npz::{ArchiveHint, MAGIC as ARCHIVE_MAGIC, read as read_archive};
pub(super) use rows416::{
    FRAME_BYTES as ROWS416_FRAME_BYTES, decode as decode_rows416, encode as encode_rows416,
};
pub(super) use rows1024::{
    FRAME_BYTES as ROWS1024_FRAME_BYTES, decode as decode_rows1024, encode as encode_rows1024,
    find as find_rows1024, is_framed,
};

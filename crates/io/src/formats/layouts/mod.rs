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

pub(super) use array::{PackedStream, ReadoutAxis, pack};
pub(super) use array_content::{ArrayContent, array_content};
pub(super) use bits::copy_bits;
pub(super) use npy::{ArrayHeader, parse};
pub(super) use npz::{ArchiveHint, read as read_archive};
pub(super) use rows1024::find as find_rows1024;

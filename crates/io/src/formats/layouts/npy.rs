//! `.npy`: a NumPy array, (T,H,ceil(W/8)) of packed bits or (T,H,W) of bytes 0 and 1.

use super::bits::copy_bits;
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;
use spikelane::unstable::npy::{self, Element, Header};

/// What a header says of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Array {
    /// Lengths of the three axes, without one of length 1 for a channel.
    pub(crate) shape: [u64; 3],
    pub(crate) element: Element,
    pub(crate) big_endian: bool,
    /// Whether the first axis is the fastest.
    pub(crate) fortran: bool,
    /// Bytes before the data.
    pub(crate) start: usize,
}

impl Array {
    /// Bytes of the data, `None` when no machine could hold them.
    pub(crate) fn data_bytes(&self) -> Option<u64> {
        self.shape.iter().try_fold(self.element.bytes() as u64, |a, &b| a.checked_mul(b))
    }
}

/// A header for an array of `u8`.
pub(crate) fn header(shape: &[u64; 3]) -> Vec<u8> {
    npy::header(Element::U8, shape)
}

/// Reads a header. `name` is the file, for errors.
pub(crate) fn parse(name: &str, bytes: &[u8]) -> Result<Array> {
    meaning(name, &Header::parse(name, bytes)?)
}

/// What a header means for a stream.
pub(crate) fn meaning(name: &str, header: &Header) -> Result<Array> {
    let shape = three_axes(&header.shape).ok_or_else(|| {
        Error::new(Kind::Input, name)
            .found(format_args!("shape {:?}", header.shape))
            .expected("an array with three axes, (T, H, W), or four of which one is a channel of length 1")
            .remedy("save a.reshape(T, H, W)")
    })?;
    Ok(Array {
        shape,
        element: header.element,
        big_endian: header.big_endian,
        fortran: header.fortran,
        start: header.start,
    })
}

/// Four axes with a channel are (T, 1, H, W) or (T, H, W, 1), or a batch of one, (1, T, H, W).
fn three_axes(shape: &[u64]) -> Option<[u64; 3]> {
    match *shape {
        [a, b, c] | [a, 1, b, c] | [a, b, c, 1] | [1, a, b, c] => Some([a, b, c]),
        _ => None,
    }
}

/// The error for frames of another size than wanted.
pub(crate) fn other_geometry(name: &str, found: Geometry, wanted: Geometry) -> Error {
    Error::new(Kind::Input, name)
        .found(format_args!("frames of {found}"))
        .expected(format_args!("{wanted}"))
        .remedy("leave width and height out, or correct them")
}

/// The error for a shape that holds frames of a size in neither order.
pub(crate) fn no_order(name: &str, shape: [u64; 3], wanted: Geometry) -> Error {
    Error::new(Kind::Input, name)
        .found(format_args!("shape {shape:?}"))
        .expected(format_args!(
            "frames of {wanted}: (T, {h}, {w}) or ({h}, {w}, T)",
            h = wanted.height(),
            w = wanted.width()
        ))
        .remedy("correct width and height")
}

/// Bytes of a frame of packed bits: each row starts at a whole byte.
pub(crate) fn bits_frame(geometry: Geometry) -> usize {
    geometry.height() * geometry.width().div_ceil(8)
}

pub(crate) fn encode_bits(geometry: Geometry, packed: &[u8], file: &mut [u8]) {
    let width = geometry.width();
    if width.is_multiple_of(8) {
        file.copy_from_slice(packed);
        return;
    }
    file.fill(0);
    for (r, row) in file.chunks_exact_mut(width.div_ceil(8)).enumerate() {
        copy_bits(row, 0, packed, r * width, width);
    }
}

pub(crate) fn decode_bits(geometry: Geometry, file: &[u8], packed: &mut [u8]) {
    let width = geometry.width();
    if width.is_multiple_of(8) {
        packed.copy_from_slice(file);
        return;
    }
    packed.fill(0);
    for (r, row) in file.chunks_exact(width.div_ceil(8)).enumerate() {
        copy_bits(packed, r * width, row, 0, width);
    }
}

//! `.npy` arrays of packed bits with shape (T, H, ceil(W/8)), or of bytes 0 and 1 with shape (T, H, W).

use super::bits::copy_bits;
use spikelane::error::{Error, Result, Setting, error};
use spikelane::spikes::Geometry;
use spikelane::unstable::npy::{self, Element, Header};

/// The header of an array that contains a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ArrayHeader {
    /// Lengths of the three axes. If the file has a fourth axis of length 1, this axis is removed.
    pub(crate) shape: [u64; 3],
    pub(crate) element: Element,
    pub(crate) is_big_endian: bool,
    /// Whether the index of the first axis varies fastest in storage.
    pub(crate) is_fortran_order: bool,
    /// Offset of the data in the file.
    pub(crate) data_offset_bytes: usize,
}

impl ArrayHeader {
    /// Returns the number of bytes of the data, or `None` if the number does not fit in `u64`.
    pub(crate) fn data_bytes(&self) -> Option<u64> {
        self.shape.iter().try_fold(self.element.bytes() as u64, |a, &b| a.checked_mul(b))
    }
}

/// Returns the header of a `u8` array.
pub(crate) fn header(shape: &[u64; 3]) -> Vec<u8> {
    npy::header_bytes(Element::U8, shape)
}

/// Parses a header. Error messages refer to the file as `name`.
pub(crate) fn parse(name: &str, bytes: &[u8]) -> Result<ArrayHeader> {
    array_header(name, &Header::parse(name, bytes)?)
}

/// Converts a NumPy header to the header of an array that contains a stream.
pub(crate) fn array_header(name: &str, header: &Header) -> Result<ArrayHeader> {
    let shape = to_three_axes(&header.shape).ok_or_else(|| {
        let remedy = match header.shape.len() {
            4 => "convert each color to its own stream",
            3.. => "save one stream of the array",
            _ => "pass a recording of spikes; a map or an image has no axis of readouts",
        };
        error!(Input, "{name}"; found "shape {}", npy::shape_text(&header.shape);
            expected "an array with axes (T, H, W), or with four axes of which one is a channel of length 1";
            remedy "{remedy}")
    })?;
    Ok(ArrayHeader {
        shape,
        element: header.element,
        is_big_endian: header.is_big_endian,
        is_fortran_order: header.is_fortran_order,
        data_offset_bytes: header.data_offset,
    })
}

/// Returns the shape with three axes. Shapes with four axes must be (T, 1, H, W), (T, H, W, 1) or (1, T, H, W).
fn to_three_axes(shape: &[u64]) -> Option<[u64; 3]> {
    match *shape {
        [a, b, c] | [a, 1, b, c] | [a, b, c, 1] | [1, a, b, c] => Some([a, b, c]),
        _ => None,
    }
}

/// Returns the error for frames whose geometry differs from `wanted`.
pub(crate) fn geometry_error(name: &str, found: Geometry, wanted: Geometry) -> Error {
    error!(Input, "{name}"; found "frames of {found}"; expected "{wanted}";
        remedy "omit {} and {}, or correct them", Setting("width"), Setting("height"))
}

/// Returns the error for a shape that does not contain frames of geometry `wanted` in any axis order.
pub(crate) fn axis_order_error(name: &str, shape: [u64; 3], wanted: Geometry) -> Error {
    error!(Input, "{name}"; found "shape {}", npy::shape_text(&shape);
        expected "frames of {wanted}: (T, {0}, {1}) or ({0}, {1}, T)", wanted.height(), wanted.width();
        remedy "correct {} and {}", Setting("width"), Setting("height"))
}

/// Returns the number of bytes of a packed frame in which each row starts at a byte boundary.
pub(crate) fn bits_frame_bytes(geometry: Geometry) -> usize {
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

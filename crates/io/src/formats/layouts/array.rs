//! Packs arrays that cannot be read frame by frame. The arrays can have any element type and axis order, and the
//! packed stream is in memory.

use std::io::Read;

use super::npy::ArrayHeader;
use spikelane::error::{Error, Result, bail, error};
use spikelane::spikes::{Geometry, set_bit};
use spikelane::unstable::inputs;
use spikelane::unstable::npy::{self, Element};

/// Size limit of the packed stream.
const MAX_PACKED_BYTES: u64 = 1 << 30;

/// Maximum number of elements per read.
const CHUNK_ELEMENTS: usize = 64 << 10;

/// The readout axis of an array with three axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ReadoutAxis {
    /// The order (T, H, W).
    First,
    /// The order (H, W, T).
    Last,
}

impl ReadoutAxis {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::First => "(T, H, W)",
            Self::Last => "(H, W, T)",
        }
    }

    /// Returns the number of readouts and the geometry of an array of this shape. Returns `None` if the number of
    /// readouts or the geometry is invalid.
    pub(crate) fn readouts_and_geometry(self, [a, b, c]: [u64; 3]) -> Option<(u64, Geometry)> {
        let (readouts, height, width) = match self {
            Self::First => (a, b, c),
            Self::Last => (c, a, b),
        };
        let side = |n: u64| u32::try_from(n).ok();
        let geometry = Geometry::new(side(width)?, side(height)?).ok()?;
        (readouts > 0).then_some((readouts, geometry))
    }

    /// Returns the axis orders in which an array of this shape contains frames of `geometry`.
    pub(crate) fn candidates(shape: [u64; 3], geometry: Geometry) -> Vec<Self> {
        let fits = |axes: &Self| axes.readouts_and_geometry(shape).is_some_and(|(_, g)| g == geometry);
        [Self::First, Self::Last].into_iter().filter(fits).collect()
    }
}

/// A packed stream in memory.
pub(crate) struct PackedStream {
    pub(crate) geometry: Geometry,
    pub(crate) packed: Vec<u8>,
}

/// Packs the elements of `array`, which `source` reads in storage order.
///
/// # Errors
/// * [`ErrorKind::Input`](spikelane::ErrorKind::Input) unless all values are 0 or 1, or all values are 0 or 255.
/// * [`ErrorKind::Input`](spikelane::ErrorKind::Input) if `source` ends early, or if the packed stream exceeds 1 GiB.
pub(crate) fn pack(
    name: &str,
    array: &ArrayHeader,
    axes: ReadoutAxis,
    source: &mut impl Read,
) -> Result<PackedStream> {
    let (readouts, geometry) = axes.readouts_and_geometry(array.shape).ok_or_else(|| {
        error!(Input, "{name}"; found "shape {}", npy::shape_text(&array.shape);
            expected "{} with frames of 1 to 2^28 pixels", axes.name())
    })?;
    let size = geometry.frame_bytes();
    if (size as u64).checked_mul(readouts).is_none_or(|n| n > MAX_PACKED_BYTES) {
        bail!(Input, "{name}"; found "an array {}", npy::shape_text(&array.shape);
            expected "at most 1 GiB of packed frames, because the whole array must fit in memory";
            remedy "save the array as .npy, which is read frame by frame: numpy.ascontiguousarray(a, numpy.uint8) with axes (T, H, W)");
    }
    let mut packed = inputs::zeroed_vec(name, size * readouts as usize)?;
    let mut bits = BitPacker { size, spike_value: 0.0 };
    let width = geometry.width();
    // For each axis, the two numbers are added to (readout, pixel) when the index of the axis increases by 1.
    let steps = match axes {
        ReadoutAxis::First => [(1, 0), (0, width), (0, 1)],
        ReadoutAxis::Last => [(0, width), (0, 1), (1, 0)],
    };
    let shape = array.shape.map(|n| n as usize);
    // `order` lists the axes from the slowest to the fastest in storage.
    let order = if array.is_fortran_order { [2, 1, 0] } else { [0, 1, 2] };
    let [(slow, a), (middle, b), (fast, c)] = order.map(|k| (shape[k], steps[k]));
    let mut line = inputs::zeroed_vec(name, fast.min(CHUNK_ELEMENTS) * array.element.bytes())?;
    for i in 0..slow {
        for j in 0..middle {
            let (t, p) = (i * a.0 + j * b.0, i * a.1 + j * b.1);
            let mut k = 0;
            while k < fast {
                let line = &mut line[..(fast - k).min(CHUNK_ELEMENTS) * array.element.bytes()];
                source.read_exact(line).map_err(|e| incomplete_array_error(name, e))?;
                let mut wrong = None;
                array.element.for_each(array.is_big_endian, line, |value| {
                    if value != 0.0 && !bits.set(&mut packed, t + k * c.0, p + k * c.1, value) {
                        wrong = wrong.or(Some((value, t + k * c.0, p + k * c.1)));
                    }
                    k += 1;
                });
                if let Some((value, t, p)) = wrong {
                    return Err(not_binary_error(name, value, t, (p / width, p % width)));
                }
            }
        }
    }
    Ok(PackedStream { geometry, packed })
}

/// Packs elements one at a time.
struct BitPacker {
    size: usize,
    /// The value that represents a spike (1 or 255), or 0 before the first spike.
    spike_value: f64,
}

impl BitPacker {
    /// Sets a bit for the nonzero `value`. Returns `false` if `value` is not the spike value.
    fn set(&mut self, packed: &mut [u8], readout: usize, pixel: usize, value: f64) -> bool {
        if self.spike_value == 0.0 && (value == 1.0 || value == 255.0) {
            self.spike_value = value;
        }
        if value != self.spike_value {
            return false;
        }
        set_bit(&mut packed[readout * self.size..][..self.size], pixel);
        true
    }
}

pub(super) fn incomplete_array_error(name: &str, error: std::io::Error) -> Error {
    if error.kind() != std::io::ErrorKind::UnexpectedEof {
        return Error::io(name, error);
    }
    error!(Input, "{name}"; found "{error}"; expected "all elements of the array";
        remedy "the file is truncated; save the array again")
}

fn not_binary_error(name: &str, value: f64, readout: usize, (row, col): (usize, usize)) -> Error {
    error!(Input, "{name}"; found "the value {value} at readout {readout}, row {row}, col {col}";
        expected "0 and 1, or 0 and 255, as in a stream"; remedy "simulate an array of light first")
}

/// Returns whether the array is stored in the encoding of `npy-bytes`. Frames in this encoding are read directly from
/// the file. The frames of other arrays are packed in memory.
pub(crate) const fn is_mapped(array: &ArrayHeader, axes: ReadoutAxis) -> bool {
    let bytes = matches!(array.element, Element::Bool | Element::U8 | Element::I8);
    bytes && !array.is_fortran_order && matches!(axes, ReadoutAxis::First)
}

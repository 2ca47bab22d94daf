//! Arrays that are not read frame by frame: any type of element, any order of axes, made packed in memory.

use std::io::Read;

use super::Array;
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::{Geometry, set_bit};
use spikelane::unstable::inputs;
use spikelane::unstable::npy::Element;

/// Largest packed stream held in memory.
const MAX_PACKED: u64 = 1 << 30;

/// Elements that are read in one piece.
const LINE: usize = 64 << 10;

/// Which axis of an array of three counts readouts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Axes {
    /// (T, H, W)
    First,
    /// (H, W, T)
    Last,
}

impl Axes {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::First => "(T, H, W)",
            Self::Last => "(H, W, T)",
        }
    }

    /// Readouts and geometry of an array of this shape; `None` when no camera has it.
    pub(crate) fn meaning(self, [a, b, c]: [u64; 3]) -> Option<(u64, Geometry)> {
        let (readouts, height, width) = match self {
            Self::First => (a, b, c),
            Self::Last => (c, a, b),
        };
        let side = |n: u64| u32::try_from(n).ok();
        let geometry = Geometry::new(side(width)?, side(height)?).ok()?;
        (readouts > 0).then_some((readouts, geometry))
    }

    /// The orders in which an array of this shape holds frames of `geometry`.
    pub(crate) fn of(shape: [u64; 3], geometry: Geometry) -> Vec<Self> {
        let fits = |axes: &Self| axes.meaning(shape).is_some_and(|(_, g)| g == geometry);
        [Self::First, Self::Last].into_iter().filter(fits).collect()
    }
}

/// A stream in memory, packed.
pub(crate) struct Packing {
    pub(crate) geometry: Geometry,
    pub(crate) packed: Vec<u8>,
}

/// Packs the elements that `source` holds, in the order of `array`.
///
/// # Errors
/// [`Kind::Input`] when they are other than 0 and 1, or 0 and 255, when they end early, or when the packed
/// stream would be larger than 1 GiB.
pub(crate) fn pack(name: &str, array: &Array, axes: Axes, source: &mut impl Read) -> Result<Packing> {
    let (readouts, geometry) = axes.meaning(array.shape).ok_or_else(|| {
        Error::new(Kind::Input, name)
            .found(format_args!("shape {:?}", array.shape))
            .expected(format_args!("{} with frames of 1 to 2^28 pixels", axes.name()))
    })?;
    let size = geometry.frame_bytes();
    if (size as u64).checked_mul(readouts).is_none_or(|n| n > MAX_PACKED) {
        return Err(Error::new(Kind::Input, name)
            .found(format_args!("an array {:?}", array.shape))
            .expected("at most 1 GiB of packed frames, as it has to be held in memory")
            .remedy("save it as .npy, numpy.ascontiguousarray(a, numpy.uint8) with axes (T, H, W), which is read frame by frame"));
    }
    let mut packed = inputs::zeroed(name, size * readouts as usize)?;
    let mut bits = Bits { size, top: 0.0 };
    let width = geometry.width();
    // What a step along each axis adds to the readout and to the pixel.
    let steps = match axes {
        Axes::First => [(1, 0), (0, width), (0, 1)],
        Axes::Last => [(0, width), (0, 1), (1, 0)],
    };
    let shape = array.shape.map(|n| n as usize);
    // From the slowest axis to the fastest.
    let order = if array.fortran { [2, 1, 0] } else { [0, 1, 2] };
    let [(slow, a), (middle, b), (fast, c)] = order.map(|k| (shape[k], steps[k]));
    let mut line = inputs::zeroed(name, fast.min(LINE) * array.element.bytes())?;
    for i in 0..slow {
        for j in 0..middle {
            let (t, p) = (i * a.0 + j * b.0, i * a.1 + j * b.1);
            let mut k = 0;
            while k < fast {
                let line = &mut line[..(fast - k).min(LINE) * array.element.bytes()];
                source.read_exact(line).map_err(|e| ends(name, &e))?;
                let mut wrong = None;
                array.element.for_each(array.big_endian, line, |value| {
                    if value != 0.0 && !bits.set(&mut packed, t + k * c.0, p + k * c.1, value) {
                        wrong = wrong.or(Some((value, t + k * c.0, p + k * c.1)));
                    }
                    k += 1;
                });
                if let Some((value, t, p)) = wrong {
                    return Err(no_bit(name, value, t, (p / width, p % width)));
                }
            }
        }
    }
    Ok(Packing { geometry, packed })
}

/// Frames of bits in the making.
struct Bits {
    size: usize,
    /// The value that stands for a spike, once one was seen.
    top: f64,
}

impl Bits {
    /// Sets a bit, unless `value` stands for no spike.
    fn set(&mut self, packed: &mut [u8], readout: usize, pixel: usize, value: f64) -> bool {
        if self.top == 0.0 && (value == 1.0 || value == 255.0) {
            self.top = value;
        }
        if value != self.top {
            return false;
        }
        set_bit(&mut packed[readout * self.size..][..self.size], pixel);
        true
    }
}

fn ends(name: &str, error: &std::io::Error) -> Error {
    Error::new(Kind::Input, name)
        .found(error)
        .expected("all elements of the array")
        .remedy("save it again; it was cut short")
}

fn no_bit(name: &str, value: f64, readout: usize, (row, col): (usize, usize)) -> Error {
    Error::new(Kind::Input, name)
        .found(format_args!("the value {value} at readout {readout}, row {row}, col {col}"))
        .expected("0 and 1, or 0 and 255, as a stream has them")
        .remedy("give an array of light to 'spikelane simulate', which makes spikes of it")
}

/// Whether bytes of this type lie in a file as `npy-bytes` has them.
pub(crate) const fn is_mapped(array: &Array, axes: Axes) -> bool {
    let bytes = matches!(array.element, Element::Bool | Element::U8 | Element::I8);
    bytes && !array.fortran && matches!(axes, Axes::First)
}

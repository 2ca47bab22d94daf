//! What a bit-packed spike stream is, in memory.
//!
//! A **packed frame** holds one readout: pixel `p = row * width + col`, row 0
//! on top, is bit `p % 8` (least significant first) of byte `p / 8`. A frame
//! whose pixel count is no multiple of 8 ends in zero bits, so that every
//! frame starts at a whole byte. A stream is its frames, one after the other.
//! Files may order things differently; the stream formats translate.

mod bytes;
mod crop;

pub use bytes::{pack, unpack};
pub use bytes::{pack_frame, spread, unpack_frame};
pub use crop::Crop;

use crate::error::{Error, Kind, Result};

/// The largest number of pixels of a sensor: addresses of draws are 32 bits
/// per pair of pixels, and 2^28 pixels are already sixty times the largest camera.
pub(crate) const MAX_PIXELS: usize = 1 << 28;

/// Width and height of a sensor in pixels, `width x height` in all texts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Geometry {
    width: u32,
    height: u32,
}

impl Geometry {
    /// A sensor of `width` x `height` pixels.
    ///
    /// # Examples
    /// ```
    /// let geometry = spikelane::Geometry::new(400, 250)?;
    /// assert_eq!((geometry.pixels(), geometry.frame_bytes()), (100_000, 12_500));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// When a side is zero, or the sensor has more than 2^28 pixels.
    pub fn new(width: u32, height: u32) -> Result<Self> {
        let pixels = u64::from(width) * u64::from(height);
        if pixels == 0 || pixels > MAX_PIXELS as u64 {
            return Err(Error::new(Kind::Usage, "sensor size")
                .found(format_args!("{width}x{height}"))
                .expected(format_args!("1 to {MAX_PIXELS} pixels"))
                .remedy("give width and height in pixels"));
        }
        Ok(Self { width, height })
    }

    /// Pixels in a row.
    #[must_use]
    pub const fn width(self) -> usize {
        self.width as usize
    }

    /// Rows.
    #[must_use]
    pub const fn height(self) -> usize {
        self.height as usize
    }

    /// Pixels in a frame.
    #[must_use]
    pub const fn pixels(self) -> usize {
        self.width() * self.height()
    }

    /// Bytes of one packed frame, the padding of the last byte included.
    #[must_use]
    pub const fn frame_bytes(self) -> usize {
        self.pixels().div_ceil(8)
    }
}

impl std::fmt::Display for Geometry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// A borrowed stream of packed frames.
#[derive(Clone, Copy, Debug)]
pub struct Packed<'a> {
    geometry: Geometry,
    bytes: &'a [u8],
}

impl<'a> Packed<'a> {
    /// A view of `bytes` as whole frames.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Geometry, Packed};
    /// // Two readouts of 4x2 pixels, a byte each: pixel 0 is the lowest bit.
    /// let stream = Packed::new(Geometry::new(4, 2)?, &[0b0000_0001, 0b0001_0000])?;
    /// assert!(stream.get(0, 0, 0) && stream.get(1, 1, 0));
    /// assert_eq!(stream.readouts(), 2);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// When the length is no multiple of [`Geometry::frame_bytes`].
    pub fn new(geometry: Geometry, bytes: &'a [u8]) -> Result<Self> {
        if !bytes.len().is_multiple_of(geometry.frame_bytes()) {
            return Err(Error::new(Kind::Input, "packed stream")
                .found(format_args!("{} bytes", bytes.len()))
                .expected(format_args!(
                    "a multiple of {} bytes, one {geometry} frame",
                    geometry.frame_bytes()
                ))
                .remedy("check width and height"));
        }
        Ok(Self { geometry, bytes })
    }

    /// Width and height.
    #[must_use]
    pub const fn geometry(self) -> Geometry {
        self.geometry
    }

    /// Number of readouts.
    #[must_use]
    pub const fn readouts(self) -> usize {
        self.bytes.len() / self.geometry.frame_bytes()
    }

    /// All bytes.
    #[must_use]
    pub const fn bytes(self) -> &'a [u8] {
        self.bytes
    }

    /// Some of its readouts.
    ///
    /// # Panics
    /// When they lie beyond the end.
    #[must_use]
    pub(crate) fn part(self, readouts: std::ops::Range<usize>) -> Self {
        let frame = self.geometry.frame_bytes();
        Self { bytes: &self.bytes[readouts.start * frame..readouts.end * frame], ..self }
    }

    /// The packed frame of one readout.
    ///
    /// # Panics
    /// When `readout` lies beyond the end.
    #[must_use]
    pub fn frame(self, readout: usize) -> &'a [u8] {
        let n = self.geometry.frame_bytes();
        &self.bytes[readout * n..(readout + 1) * n]
    }

    /// The frames in order.
    pub fn frames(self) -> impl ExactSizeIterator<Item = &'a [u8]> + Clone {
        self.bytes.chunks_exact(self.geometry.frame_bytes())
    }

    /// Whether pixel `(row, col)` fired at `readout`.
    #[must_use]
    pub fn get(self, readout: usize, row: usize, col: usize) -> bool {
        bit(self.frame(readout), row * self.geometry.width() + col)
    }
}

/// Bit `p` of a packed frame.
///
/// # Examples
/// ```
/// assert!(spikelane::spikes::bit(&[0b0000_0100], 2));
/// ```
#[must_use]
pub fn bit(frame: &[u8], p: usize) -> bool {
    frame[p / 8] >> (p % 8) & 1 != 0
}

/// Sets bit `p` of a packed frame.
pub fn set_bit(frame: &mut [u8], p: usize) {
    frame[p / 8] |= 1 << (p % 8);
}

/// The positions of the set bits of `word`, counted from bit 0, in ascending order.
#[inline(always)]
pub fn set_bits(mut word: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let at = (word != 0).then(|| word.trailing_zeros());
        word &= word.wrapping_sub(1);
        at
    })
}

/// The pixels that fire in a packed frame, in ascending order.
#[inline]
pub fn firing_pixels(frame: &[u8]) -> impl Iterator<Item = usize> {
    frame.chunks(8).enumerate().flat_map(|(w, bytes)| {
        let mut word = [0; 8];
        word[..bytes.len()].copy_from_slice(bytes);
        set_bits(u64::from_le_bytes(word)).map(move |bit| 64 * w + bit as usize)
    })
}

/// The rate between a pixel's first and last spike, `(N - 1) / (t_last - t_first)` in spikes per readout, of `spikes`
/// spikes from readout `first` to `last`; `None` below two spikes, which span no time.
///
/// In `(0, 1]` for any pixel, since no two of its spikes share a readout.
#[must_use]
#[inline]
pub fn span_rate(spikes: u32, first: u32, last: u32) -> Option<f64> {
    (spikes > 1 && last > first).then(|| f64::from(spikes - 1) / f64::from(last - first))
}

/// The number of spikes in packed bytes.
///
/// # Examples
/// ```
/// assert_eq!(spikelane::spikes::count(&[0b0000_0111, 0b1000_0000]), 4);
/// ```
#[must_use]
#[inline]
pub fn count(bytes: &[u8]) -> u64 {
    let (words, tail) = bytes.as_chunks::<8>();
    let whole: u64 = words.iter().map(|w| u64::from(u64::from_le_bytes(*w).count_ones())).sum();
    whole + tail.iter().map(|b| u64::from(b.count_ones())).sum::<u64>()
}

//! The form of a bit-packed spike stream in memory.
//!
//! A **packed frame** contains one readout. Pixel `p = row * width + col` is bit `p % 8` (least significant bit first)
//! of byte `p / 8`. Row 0 is the top row. If the number of pixels is not a multiple of 8, a frame ends with zero bits,
//! so every frame starts at a byte. A stream is a sequence of frames without gaps. If a file has another order of bits
//! or rows, its reader converts it to this order.

pub(crate) mod bytes;
mod crop;
mod spike_frames;

pub use bytes::{pack, unpack};
pub use crop::Crop;
pub use spike_frames::{Frames, Spike, SpikeFrame, SpikeFrames, SpikeFramesRef};

use crate::error::{Result, Setting, bail};
use bytes::set_bits;

/// Largest number of pixels of a sensor.
///
/// The random draws address pairs of pixels with 32 bits. 2^28 pixels are 268 times the pixels of a 1000x1000 camera.
pub(crate) const MAX_PIXELS: usize = 1 << 28;

/// Width and height of a sensor in pixels. The text form is `width x height`.
///
/// # Examples
/// ```
/// use spikelane::{ErrorKind, Geometry};
/// let geometry = Geometry::new(13, 3)?;
/// assert_eq!(geometry.to_string(), "13x3");
/// // 39 pixels need five bytes. The last bit of the fifth byte is padding.
/// assert_eq!((geometry.pixels(), geometry.frame_bytes()), (39, 5));
/// assert_eq!(Geometry::new(0, 3).unwrap_err().kind(), ErrorKind::Usage);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Geometry {
    width: u32,
    height: u32,
}

impl Geometry {
    /// Returns the geometry of a sensor with `width` columns and `height` rows.
    ///
    /// # Examples
    /// ```
    /// let geometry = spikelane::Geometry::new(400, 250)?;
    /// assert_eq!((geometry.pixels(), geometry.frame_bytes()), (100_000, 12_500));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if a side is zero or if the sensor has more than 2^28 pixels.
    pub fn new(width: u32, height: u32) -> Result<Self> {
        let pixels = u64::from(width) * u64::from(height);
        if pixels == 0 || pixels > MAX_PIXELS as u64 {
            bail!(Usage, "sensor size"; found "{width}x{height}"; expected "1 to {MAX_PIXELS} pixels";
                remedy "set {} and {} in pixels", Setting("width"), Setting("height"));
        }
        Ok(Self { width, height })
    }

    /// Returns the number of pixels in a row.
    #[must_use]
    pub const fn width(self) -> usize {
        self.width as usize
    }

    /// Returns the number of rows.
    #[must_use]
    pub const fn height(self) -> usize {
        self.height as usize
    }

    /// Returns the number of pixels in a frame.
    #[must_use]
    pub const fn pixels(self) -> usize {
        self.width() * self.height()
    }

    /// Returns the number of bytes of one packed frame, including the padding of the last byte.
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

/// Returns bit `p` of a packed frame.
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
///
/// # Examples
/// ```
/// let mut frame = [0u8; 2];
/// spikelane::spikes::set_bit(&mut frame, 9);
/// assert_eq!(frame, [0b0000_0000, 0b0000_0010]);
/// ```
pub fn set_bit(frame: &mut [u8], p: usize) {
    frame[p / 8] |= 1 << (p % 8);
}

/// Returns the indices of the pixels that fire in a packed frame, in ascending order.
///
/// # Examples
/// ```
/// let frame = [0b0000_0001, 0b1000_0000];
/// assert_eq!(spikelane::spikes::firing_pixels(&frame).collect::<Vec<_>>(), [0, 15]);
/// ```
#[inline]
pub fn firing_pixels(frame: &[u8]) -> impl Iterator<Item = usize> {
    frame.chunks(8).enumerate().flat_map(|(w, bytes)| {
        let mut word = [0; 8];
        word[..bytes.len()].copy_from_slice(bytes);
        set_bits(u64::from_le_bytes(word)).map(move |bit| 64 * w + bit as usize)
    })
}

/// Returns the rate of a pixel from its first and last spike, in spikes per readout: `(spikes - 1) / (last - first)`.
///
/// `first` and `last` are the readouts of the first and the last spike. Returns `None` if there are fewer than two
/// spikes. A pixel has at most one spike per readout, so the rate is in `(0, 1]`.
///
/// # Examples
/// ```
/// use spikelane::spikes::span_rate;
/// // Three spikes at the readouts 10, 20 and 30: two intervals in 20 readouts.
/// assert_eq!(span_rate(3, 10, 30), Some(0.1));
/// assert_eq!(span_rate(1, 10, 10), None);
/// ```
#[must_use]
#[inline]
pub fn span_rate(spikes: u32, first: u32, last: u32) -> Option<f64> {
    (spikes > 1 && last > first).then(|| f64::from(spikes - 1) / f64::from(last - first))
}

/// Returns the number of spikes in packed bytes.
///
/// # Examples
/// ```
/// assert_eq!(spikelane::spikes::count_spikes(&[0b0000_0111, 0b1000_0000]), 4);
/// ```
#[must_use]
#[inline]
pub fn count_spikes(bytes: &[u8]) -> u64 {
    let (words, tail) = bytes.as_chunks::<8>();
    let full_words: u64 = words.iter().map(|w| u64::from(u64::from_le_bytes(*w).count_ones())).sum();
    full_words + tail.iter().map(|b| u64::from(b.count_ones())).sum::<u64>()
}

//! Images of a stream.

use std::str::FromStr;

use spikelane::error::Result;
use spikelane::reconstruct::{span_rates, tfi, tfp};
use spikelane::spikes::SpikeFramesRef;
use spikelane::unstable::inputs;
use spikelane::unstable::spikes::unpack_frame;
use spikelane_io::formats::StreamReader;

/// Largest window in readouts.
pub(crate) const MAX_WINDOW_READOUTS: usize = 4096;

/// How an image is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Method {
    /// Spikes in the window divided by its readouts.
    Tfp,
    /// 1 divided by the interval around the readout.
    Tfi,
    /// Intervals in the window divided by the readouts from its first to its last spike.
    Span,
    /// The bits of one readout.
    Bits,
}

/// The rates that an image can contain.
struct RateTable {
    rates: Vec<f32>,
    /// Returns the index of a rate, given the rate and the number of readouts in the window.
    index: fn(f32, f32) -> f32,
}

impl FromStr for Method {
    type Err = ();

    fn from_str(text: &str) -> std::result::Result<Self, ()> {
        Ok(match text {
            "tfp" => Self::Tfp,
            "tfi" => Self::Tfi,
            "span" => Self::Span,
            "bits" => Self::Bits,
            _ => return Err(()),
        })
    }
}

impl Method {
    /// Returns the number of readouts that are needed before and after the readout of the image.
    ///
    /// A TFI image searches `window` readouts on both sides. The other methods use a centered window.
    fn half_window(self, window: usize) -> usize {
        let window = window.clamp(1, MAX_WINDOW_READOUTS);
        match self {
            Self::Tfp | Self::Span => window / 2,
            Self::Tfi => window,
            Self::Bits => 0,
        }
    }

    /// Returns the rates that an image of this method can contain. `None` if the number of different rates is large.
    /// `counted` is the number of readouts in the window.
    fn table(self, window: usize, counted: usize) -> Option<RateTable> {
        match self {
            Self::Bits => Some(RateTable { rates: vec![0.0, 1.0], index: |rate, _| rate }),
            Self::Tfp => Some(RateTable {
                rates: (0..=counted).map(|n| n as f32 / counted as f32).collect(),
                index: |rate, counted| rate * counted,
            }),
            // Index 0 means that the pixel has no interval.
            Self::Tfi => {
                let search = self.half_window(window);
                let missing = 1.0 / (2.0 * search as f32);
                let rates = (1..=2 * search).map(|n| 1.0 / n as f32);
                let rates = std::iter::once(missing).chain(rates).collect();
                Some(RateTable { rates, index: |rate, _| 1.0 / rate })
            }
            Self::Span => None,
        }
    }

    /// Returns the image at readout `at` in the encoding of [`encode`].
    pub(crate) fn encoded_image(self, reader: &StreamReader, at: usize, window: usize) -> Result<Vec<u8>> {
        let rates = self.image(reader, at, window)?;
        let half = self.half_window(window);
        let counted = at.saturating_add(half + 1).min(reader.readouts()) - at.saturating_sub(half);
        Ok(encode(&rates, self.table(window, counted), counted))
    }

    /// Returns the image at readout `at` in spikes per readout, one value per pixel, top row first.
    pub(crate) fn image(self, reader: &StreamReader, at: usize, window: usize) -> Result<Vec<f32>> {
        if self == Self::Tfi {
            return Ok(reader.tfi(at, self.half_window(window))?.rates);
        }
        let (frames, center) = reader.read_around(at, self.half_window(window))?;
        self.image_of_frames(frames.view(), center, window)
    }

    /// Returns the image of readout `center` of `frames`.
    pub(crate) fn image_of_frames(
        self,
        frames: SpikeFramesRef<'_>,
        center: usize,
        window: usize,
    ) -> Result<Vec<f32>> {
        let half = self.half_window(window);
        match self {
            Self::Tfp => tfp(frames, center, half),
            Self::Span => span_rates(frames, center, half),
            Self::Tfi => tfi(frames, center, half),
            Self::Bits => {
                let mut bits = inputs::zeroed_vec("bits of a readout", frames.geometry().pixels())?;
                unpack_frame(frames.frame(center).as_bytes(), &mut bits);
                Ok(bits.into_iter().map(f32::from).collect())
            }
        }
    }
}

/// Encodes an image as a table of rates and one index per pixel, which is shorter than one float per pixel.
///
/// The encoding consists of little-endian numbers: bytes per index as u32, length of the table as u32, the table as f32, and
/// the indices. If a rate is not in the table, the bytes per index and the length are 0, and the rates follow as f32.
fn encode(rates: &[f32], table: Option<RateTable>, counted: usize) -> Vec<u8> {
    let plain = || {
        let numbers = rates.iter().flat_map(|v| v.to_le_bytes());
        [0; 8].into_iter().chain(numbers).collect()
    };
    let Some(RateTable { rates: table, index }) = table else { return plain() };
    let width: u32 = if table.len() <= 256 { 1 } else { 2 };
    if table.len() > 1 << 16 {
        return plain();
    }
    let mut bytes = Vec::with_capacity(8 + 4 * table.len() + width as usize * rates.len());
    bytes.extend(width.to_le_bytes());
    bytes.extend((table.len() as u32).to_le_bytes());
    bytes.extend(table.iter().flat_map(|v| v.to_le_bytes()));
    for &rate in rates {
        let at = (index(rate, counted as f32) + 0.5) as usize;
        if table.get(at) != Some(&rate) {
            return plain();
        }
        match width {
            1 => bytes.push(at as u8),
            _ => bytes.extend((at as u16).to_le_bytes()),
        }
    }
    bytes
}

/// Decodes the result of [`encode`].
#[cfg(test)]
fn decode(bytes: &[u8]) -> Vec<f32> {
    let word = |i: usize| u32::from_le_bytes(bytes[i..i + 4].try_into().unwrap());
    let float = |i: usize| f32::from_bits(word(i));
    let (width, length) = (word(0) as usize, word(4) as usize);
    if width == 0 {
        return (8..bytes.len()).step_by(4).map(float).collect();
    }
    let indices = bytes[8 + 4 * length..].chunks(width);
    indices.map(|b| float(8 + 4 * b.iter().rev().fold(0, |sum, b| sum << 8 | *b as usize))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a stream of 900 readouts with 15x3 pixels, in which pixel `p` fires with the period `1 + 13 p mod 97`.
    fn reader() -> StreamReader {
        let geometry = spikelane::Geometry::new(15, 3).unwrap();
        let bit = |t: usize, p: usize| u8::from((t + 7 * p).is_multiple_of(1 + 13 * p % 97));
        let dense: Vec<u8> = (0..900).flat_map(|t| (0..45).map(move |p| bit(t, p))).collect();
        let frames = spikelane::SpikeFrames::from_dense(geometry, &dense).unwrap();
        let layout = spikelane_io::formats::Layout::DatTop;
        StreamReader::from_bytes("test", frames.into_bytes(), Some(layout), Some(geometry)).unwrap()
    }

    #[test]
    fn the_encoding_of_every_method_is_exact() {
        let reader = reader();
        for method in [Method::Tfp, Method::Tfi, Method::Span, Method::Bits] {
            for (at, window) in [(0, 1), (450, 41), (3, 161), (899, 300), (500, 900)] {
                let encoded = method.encoded_image(&reader, at, window).unwrap();
                assert_eq!(
                    decode(&encoded),
                    method.image(&reader, at, window).unwrap(),
                    "{method:?} {at} {window}"
                );
            }
        }
    }

    #[test]
    fn a_short_window_needs_one_byte_per_pixel() {
        let reader = reader();
        let bytes = |method: Method, window| method.encoded_image(&reader, 450, window).unwrap().len();
        assert_eq!(bytes(Method::Tfp, 41), 8 + 4 * 42 + 45);
        assert_eq!(bytes(Method::Bits, 1), 8 + 4 * 2 + 45);
        assert_eq!(bytes(Method::Tfi, 300), 8 + 4 * 601 + 2 * 45);
    }
}

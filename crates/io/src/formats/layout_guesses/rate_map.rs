//! Rate maps in the bit order of the file, and the correlation between their pixels.

use crate::formats::{Codec, Layout};
use spikelane::error::Result;
use spikelane::unstable::inputs;
use spikelane::unstable::spikes::unpack_byte;

/// A correlation is significant if it exceeds this number of standard errors. The standard error is computed for
/// independent pixels.
pub(super) const CHANCE_Z_THRESHOLD: f64 = 6.0;

/// Approximate number of pixel pairs per correlation. With so many pairs, independent pixels have a correlation of 0
/// with a standard error of 0.002.
const MAX_PAIRS: usize = 1 << 18;

/// The number of times that each bit of a frame was set. The least significant bit of each byte comes first.
pub(super) struct BitCounts(pub(super) Vec<u8>);

impl BitCounts {
    /// Returns zeroed counters for frames of `bytes` bytes.
    ///
    /// # Errors
    /// [`ErrorKind::Memory`](spikelane::ErrorKind::Memory) if the counters cannot be allocated.
    pub(super) fn new(bytes: usize) -> Result<Self> {
        inputs::zeroed_vec("counts of a frame's bits", 8 * bytes).map(Self)
    }

    /// Adds the bits of one frame. At most 255 frames may be added.
    pub(super) fn add(&mut self, frame: impl IntoIterator<Item = u8>) {
        for (counts, byte) in self.0.as_chunks_mut::<8>().0.iter_mut().zip(frame) {
            // One 64-bit addition increments eight 8-bit counters. At most 255 frames are added, so no counter
            // overflows into the next counter.
            *counts = (u64::from_le_bytes(*counts) + unpack_byte(byte)).to_le_bytes();
        }
    }
}

/// Number of spikes per pixel, row by row, in the bit order of the file.
pub(super) struct RateMap {
    counts: Vec<u8>,
    /// Number of positions between the starts of two consecutive rows, padding included.
    pub(super) stride: usize,
    /// Whether each position of a row is a pixel and not padding.
    is_pixel: Vec<bool>,
}

impl RateMap {
    /// Creates a map without padding between its rows.
    pub(super) fn from_counts(counts: Vec<u8>, width: usize) -> Self {
        Self { counts, stride: width, is_pixel: vec![true; width] }
    }

    /// Creates the map of frames in the layout of `codec`.
    pub(super) fn from_bits(codec: Codec, bits: BitCounts) -> Self {
        let (width, mut counts) = (codec.geometry().width(), bits.0);
        match codec.layout() {
            Layout::Rows416 => Self { counts, stride: 416, is_pixel: (0..416).map(|c| c < 400).collect() },
            Layout::Rows1024 => {
                Self { counts, stride: 1024, is_pixel: (0..1024).map(|c| c % 512 < 500).collect() }
            }
            Layout::NpyBits | Layout::NpyBitsMsb => {
                let stride = 8 * width.div_ceil(8);
                Self { counts, stride, is_pixel: (0..stride).map(|c| c < width).collect() }
            }
            Layout::Dat | Layout::DatTop | Layout::NpyBytes | Layout::DatMsb | Layout::DatTopMsb => {
                counts.truncate(codec.geometry().pixels());
                Self::from_counts(counts, width)
            }
        }
    }

    /// Returns the correlation between pixels `p` and `p + lag`. Returns `None` if the rates of all pixels `p`, or of
    /// all pixels `p + lag`, are equal.
    pub(super) fn correlation(&self, lag: usize) -> Option<f64> {
        let has_all_pixels = self.is_pixel.iter().all(|p| *p);
        let here = |p: usize| {
            has_all_pixels || self.is_pixel[p % self.stride] && self.is_pixel[(p + lag) % self.stride]
        };
        // With an even step, only even columns would be sampled.
        let step = (self.counts.len() / MAX_PAIRS) | 1;
        let pairs = (0..self.counts.len().saturating_sub(lag)).step_by(step);
        self.pearson(pairs.filter(|p| here(*p)).map(|p| (p, p + lag)))
    }

    /// Returns the number of positions in the map, padding included.
    pub(super) fn pixels(&self) -> usize {
        self.counts.len()
    }

    /// Returns the correlation between each pixel and the pixel below.
    pub(super) fn row_correlation(&self) -> Option<f64> {
        self.correlation(self.stride)
    }

    fn pearson(&self, pairs: impl Iterator<Item = (usize, usize)>) -> Option<f64> {
        let (mut n, mut x, mut y, mut xx, mut yy, mut xy) = (0u64, 0u64, 0u64, 0u64, 0u64, 0u64);
        for (p, q) in pairs {
            let (a, b) = (u64::from(self.counts[p]), u64::from(self.counts[q]));
            (n, x, y) = (n + 1, x + a, y + b);
            (xx, yy, xy) = (xx + a * a, yy + b * b, xy + a * b);
        }
        // Sums of integers have no rounding error, so the variance of constant values is exactly 0.
        let moment = |xy: u64, x: u64, y: u64| n as f64 * xy as f64 - x as f64 * y as f64;
        let (vx, vy) = (moment(xx, x, x), moment(yy, y, y));
        (n > 1 && vx > 0.0 && vy > 0.0).then(|| moment(xy, x, y) / (vx * vy).sqrt())
    }

    /// Returns whether the correlation `c` at lag `width` is a peak. The test excludes textures and row noise, which
    /// also correlate at other lags.
    ///
    /// `c` must not be smaller than the correlations at lags near `width`. `c` must exceed 1.1 times the correlation
    /// at every other lag below nearly `2 * width`.
    pub(super) fn is_peak(&self, width: usize, c: f64) -> bool {
        let chance = 2.0 / (self.counts.len() as f64).sqrt();
        let near = (width / 8).max(3);
        let at = |d: usize| [width.checked_sub(d), Some(width + d)].into_iter().flatten();
        // Slanted edges can shift the peak by up to two pixels. Therefore `c` is only compared with lags that differ
        // from `width` by at least 3.
        let highest =
            (3..near).flat_map(at).all(|lag| self.correlation(lag).is_none_or(|side| side <= c + chance));
        let far = near..=width - near;
        highest
            && far.flat_map(at).all(|lag| self.correlation(lag).is_none_or(|side| c > 1.1 * side + chance))
    }

    /// Returns the differences between neighboring pixels in different bytes and in the same byte.
    pub(super) fn byte_edges(&self) -> ByteEdges {
        let bytes = self.counts.len() / 8;
        let is_pixel = |p: usize| self.is_pixel[p % self.stride];
        let difference = |p: usize, q: usize| u64::from(self.counts[p].abs_diff(self.counts[q]));
        let mut seams =
            ByteEdges { edges: 0, lsb_first_sum: 0, msb_first_sum: 0, interior_mean: 0.0, msb_first_wins: 0 };
        let (mut sum, mut pairs) = (0, 0u64);
        for first in (0..bytes).map(|k| 8 * k) {
            for p in (first..first + 7).filter(|&p| p % self.stride < (p + 1) % self.stride) {
                if is_pixel(p) && is_pixel(p + 1) {
                    (sum, pairs) = (sum + difference(p, p + 1), pairs + 1);
                }
            }
            // The last pixel of a row and the first pixel of the next row are not neighbors, so the byte edge between
            // these two pixels is skipped.
            let ends = [first, first + 7, first + 8, first + 15];
            let in_row = ends.windows(2).all(|w| w[0] % self.stride < w[1] % self.stride);
            if ends[3] >= self.counts.len() || !in_row || !ends.into_iter().all(is_pixel) {
                continue;
            }
            let (here, other) = (difference(ends[1], ends[2]), difference(ends[0], ends[3]));
            seams.edges += 1;
            (seams.lsb_first_sum, seams.msb_first_sum) =
                (seams.lsb_first_sum + here, seams.msb_first_sum + other);
            seams.msb_first_wins += i64::from(other < here) - i64::from(here < other);
        }
        seams.interior_mean = sum as f64 / pairs.max(1) as f64;
        seams
    }
}

/// Differences between neighboring pixels at byte edges.
///
/// "LSB first" is the bit order in which the rate map was counted. For MSB-first layouts, the bits of each byte are
/// reversed before counting.
#[derive(Clone, Copy, Debug)]
pub(super) struct ByteEdges {
    edges: u64,
    /// Sum of differences between the most significant bit of a byte and the least significant bit of the next byte.
    /// These bits are neighbors if the least significant bit comes first.
    lsb_first_sum: u64,
    /// Sum of differences between the least significant bit of a byte and the most significant bit of the next byte.
    /// These bits are neighbors if the most significant bit comes first.
    msb_first_sum: u64,
    /// Mean difference between neighboring pixels in the same byte. The mean does not depend on the bit order.
    interior_mean: f64,
    /// Number of byte edges where the differences favor MSB-first order, minus the number where the differences favor
    /// LSB-first order.
    msb_first_wins: i64,
}

impl ByteEdges {
    fn ratio(&self, sum: u64) -> Option<f64> {
        (self.edges > 0 && self.interior_mean > 0.0)
            .then(|| sum as f64 / self.edges as f64 / self.interior_mean)
    }

    /// Returns the mean difference across byte edges divided by the mean difference inside bytes, for LSB-first order.
    pub(super) fn lsb_first_ratio(&self) -> Option<f64> {
        self.ratio(self.lsb_first_sum)
    }

    /// Returns the mean difference across byte edges divided by the mean difference inside bytes, for MSB-first order.
    pub(super) fn msb_first_ratio(&self) -> Option<f64> {
        self.ratio(self.msb_first_sum)
    }

    /// Returns the byte-edge ratio of the reversed bit order if the reversed order is clearly right, or `None`
    /// otherwise.
    ///
    /// The reversed order is clearly right under two conditions. Its byte-edge ratio must be much closer to 1 than the
    /// ratio of the current order. It must also fit better at significantly more byte edges than expected by chance.
    pub(super) fn reversed_order_ratio(&self) -> Option<f64> {
        let (here, other) = (self.ratio(self.lsb_first_sum)?, self.ratio(self.msb_first_sum)?);
        let clear = here > 1.5 && other < 0.7 * here && other < (here + 1.0) / 2.0;
        let chance = CHANCE_Z_THRESHOLD * (self.edges as f64).sqrt();
        let many = self.edges >= 32 && self.msb_first_wins as f64 > chance.min(0.5 * self.edges as f64);
        (clear && many).then_some(other)
    }

    /// Returns whether the bit order in which the map was counted is clearly right.
    pub(super) fn fits_current_order(&self) -> bool {
        let turned = Self {
            lsb_first_sum: self.msb_first_sum,
            msb_first_sum: self.lsb_first_sum,
            msb_first_wins: -self.msb_first_wins,
            ..*self
        };
        turned.reversed_order_ratio().is_some()
    }
}

//! Rate maps in the order of a file's bits, and how their pixels correlate.

use crate::formats::{Codec, Layout};

/// How often each bit of a frame was set, lowest bit first.
pub(super) struct Bits(pub(super) Vec<u8>);

impl Bits {
    /// Counts the bits of at most 255 frames of `bytes` bytes.
    pub(super) fn count<B: AsRef<[u8]>>(frames: impl Iterator<Item = B>, bytes: usize) -> Self {
        let mut counts = vec![0; 8 * bytes];
        for frame in frames {
            for (counts, byte) in counts.as_chunks_mut::<8>().0.iter_mut().zip(frame.as_ref()) {
                // Eight counters of a byte side by side: none can carry into the next.
                *counts = (u64::from_le_bytes(*counts) + spread(*byte)).to_le_bytes();
            }
        }
        Self(counts)
    }
}

/// Bit k of a byte in bit 8 k.
fn spread(byte: u8) -> u64 {
    let kept = (u64::from(byte) * 0x0101_0101_0101_0101) & 0x8040_2010_0804_0201;
    (kept + 0x7f7f_7f7f_7f7f_7f7f) >> 7 & 0x0101_0101_0101_0101
}

/// Spikes per pixel, row by row, in the order of the file.
pub(super) struct Map {
    counts: Vec<u8>,
    /// From one row to the next.
    pub(super) stride: usize,
    /// Which places of a row are pixels.
    is_pixel: Vec<bool>,
}

impl Map {
    /// A map without anything between its rows.
    pub(super) fn plain(counts: Vec<u8>, width: usize) -> Self {
        Self { counts, stride: width, is_pixel: vec![true; width] }
    }

    /// The map of a layout's frames.
    pub(super) fn of(codec: Codec, bits: Bits) -> Self {
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
            _ => {
                counts.truncate(codec.geometry().pixels());
                Self::plain(counts, width)
            }
        }
    }

    /// Correlation of pixels with those `lag` places behind; `None` when one of the sides does not vary.
    pub(super) fn correlation(&self, lag: usize) -> Option<f64> {
        let whole = self.is_pixel.iter().all(|p| *p);
        let here =
            |p: usize| whole || self.is_pixel[p % self.stride] && self.is_pixel[(p + lag) % self.stride];
        self.pearson((0..self.counts.len().saturating_sub(lag)).filter(|p| here(*p)).map(|p| (p, p + lag)))
    }

    /// Correlation with the lower neighbour.
    pub(super) fn rows(&self) -> Option<f64> {
        self.correlation(self.stride)
    }

    fn pearson(&self, pairs: impl Iterator<Item = (usize, usize)>) -> Option<f64> {
        let (mut n, mut x, mut y, mut xx, mut yy, mut xy) = (0u64, 0u64, 0u64, 0u64, 0u64, 0u64);
        for (p, q) in pairs {
            let (a, b) = (u64::from(self.counts[p]), u64::from(self.counts[q]));
            (n, x, y) = (n + 1, x + a, y + b);
            (xx, yy, xy) = (xx + a * a, yy + b * b, xy + a * b);
        }
        // Sums of integers are exact: a side that does not vary has a variance of 0.
        let moment = |xy: u64, x: u64, y: u64| n as f64 * xy as f64 - x as f64 * y as f64;
        let (vx, vy) = (moment(xx, x, x), moment(yy, y, y));
        (n > 1 && vx > 0.0 && vy > 0.0).then(|| moment(xy, x, y) / (vx * vy).sqrt())
    }

    /// Whether `c`, the correlation at `width`, stands above those of widths around it: a texture or the noise of
    /// rows correlates with everything in its row.
    pub(super) fn is_peak(&self, width: usize, c: f64) -> bool {
        let chance = 2.0 / (self.counts.len() as f64).sqrt();
        let (near, far) = ((width / 8).max(2), (width / 3).max(4));
        // Neighbouring offsets, which differ in parity and phase of a texture, and others up to the farthest.
        let spread = (near..=far).step_by(((far - near) / 12).max(1));
        let offsets = (near..(near + 8).min(far + 1)).chain(spread);
        offsets
            .flat_map(|d| [width.checked_sub(d), Some(width + d)])
            .flatten()
            .all(|lag| self.correlation(lag).is_none_or(|side| c > 1.1 * side + chance))
    }

    /// How pixels correlate across the edges of bytes, and inside them.
    pub(super) fn seams(&self) -> Seams {
        let bytes = self.counts.len() / 8;
        let pairs = |a: usize, b: usize| {
            let seam = (0..bytes.saturating_sub(1)).map(|k| (8 * k + a, 8 * k + b));
            self.pearson(
                seam.filter(|&(p, q)| self.is_pixel[p % self.stride] && self.is_pixel[q % self.stride]),
            )
        };
        let chance = super::BEYOND_CHANCE / (bytes as f64).sqrt();
        // The middle of a byte is the same pair in either order.
        Seams { here: pairs(7, 8), other: pairs(0, 15), inside: pairs(3, 4), chance }
    }
}

/// Correlations of neighbours where bytes meet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seams {
    /// The highest bit of a byte with the lowest of the next: neighbours with the lowest bit first.
    pub(super) here: Option<f64>,
    /// The lowest bit of a byte with the highest of the next: neighbours the other way round.
    pub(super) other: Option<f64>,
    /// Neighbours inside bytes.
    inside: Option<f64>,
    chance: f64,
}

impl Seams {
    /// The correlation of the other order, when that is clearly the right one.
    pub(super) fn turned(&self) -> Option<f64> {
        let (here, other, inside) = (self.here.unwrap_or(0.0), self.other?, self.inside?);
        let sign = inside >= super::LEAST && inside > self.chance;
        (sign && other >= inside / 2.0 && here < inside / 2.0 && here < other / 2.0).then_some(other)
    }

    /// Whether the order that was taken is clearly the right one.
    pub(super) fn fits_here(&self) -> bool {
        let turned = Self { here: self.other, other: self.here, ..*self };
        turned.turned().is_some()
    }
}

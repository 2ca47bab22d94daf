//! Rate maps in the order of a file's bits, and how their pixels correlate.

use crate::formats::{Codec, Layout};
use spikelane::error::Result;
use spikelane::spikes::spread;
use spikelane::unstable::inputs;

/// Standard errors of a correlation of chance that one has to exceed.
pub(super) const BEYOND_CHANCE: f64 = 6.0;

/// Pairs of which a correlation is taken, about: its error of chance is then 0.002.
const MOST_PAIRS: usize = 1 << 18;

/// How often each bit of a frame was set, lowest bit first.
pub(super) struct Bits(pub(super) Vec<u8>);

impl Bits {
    /// Counters of frames of `bytes` bytes, at 0.
    ///
    /// # Errors
    /// [`Kind::Memory`](spikelane::Kind::Memory) where memory for them is missing.
    pub(super) fn new(bytes: usize) -> Result<Self> {
        inputs::zeroed("counts of a frame's bits", 8 * bytes).map(Self)
    }

    /// Adds the bits of a frame; at most 255 may be added.
    pub(super) fn add(&mut self, frame: impl IntoIterator<Item = u8>) {
        for (counts, byte) in self.0.as_chunks_mut::<8>().0.iter_mut().zip(frame) {
            // Eight counters of a byte side by side: none can carry into the next.
            *counts = (u64::from_le_bytes(*counts) + spread(byte)).to_le_bytes();
        }
    }
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
        // An odd step meets all columns.
        let step = (self.counts.len() / MOST_PAIRS) | 1;
        let pairs = (0..self.counts.len().saturating_sub(lag)).step_by(step);
        self.pearson(pairs.filter(|p| here(*p)).map(|p| (p, p + lag)))
    }

    /// Places of the map, pixels or not.
    pub(super) fn pixels(&self) -> usize {
        self.counts.len()
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

    /// Whether `c`, the correlation at `width`, is the greatest nearby and stands above those of all widths up to nearly
    /// twice it: a texture or the noise of rows correlates at other distances as well.
    pub(super) fn is_peak(&self, width: usize, c: f64) -> bool {
        let chance = 2.0 / (self.counts.len() as f64).sqrt();
        let near = (width / 8).max(3);
        let at = |d: usize| [width.checked_sub(d), Some(width + d)].into_iter().flatten();
        // Slanted edges move the peak by a pixel or two.
        let highest =
            (3..near).flat_map(at).all(|lag| self.correlation(lag).is_none_or(|side| side <= c + chance));
        let far = near..=width - near;
        highest
            && far.flat_map(at).all(|lag| self.correlation(lag).is_none_or(|side| c > 1.1 * side + chance))
    }

    /// How much pixels differ across the edges of bytes, and inside them.
    pub(super) fn seams(&self) -> Seams {
        let bytes = self.counts.len() / 8;
        let is_pixel = |p: usize| self.is_pixel[p % self.stride];
        let difference = |p: usize, q: usize| u64::from(self.counts[p].abs_diff(self.counts[q]));
        let mut seams = Seams { seams: 0, here: 0, other: 0, inside: 0.0, wins: 0 };
        let (mut sum, mut pairs) = (0, 0u64);
        for first in (0..bytes).map(|k| 8 * k) {
            for p in (first..first + 7).filter(|&p| p % self.stride < (p + 1) % self.stride) {
                if is_pixel(p) && is_pixel(p + 1) {
                    (sum, pairs) = (sum + difference(p, p + 1), pairs + 1);
                }
            }
            // From the end of a row to the start of the next there are no neighbours.
            let ends = [first, first + 7, first + 8, first + 15];
            let in_row = ends.windows(2).all(|w| w[0] % self.stride < w[1] % self.stride);
            if ends[3] >= self.counts.len() || !in_row || !ends.into_iter().all(is_pixel) {
                continue;
            }
            let (here, other) = (difference(ends[1], ends[2]), difference(ends[0], ends[3]));
            seams.seams += 1;
            (seams.here, seams.other) = (seams.here + here, seams.other + other);
            seams.wins += i64::from(other < here) - i64::from(here < other);
        }
        seams.inside = sum as f64 / pairs.max(1) as f64;
        seams
    }
}

/// Mean differences of neighbours where bytes meet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seams {
    seams: u64,
    /// Between the highest bit of a byte and the lowest of the next, neighbours with the lowest bit first; summed.
    here: u64,
    /// Between the lowest bit of a byte and the highest of the next, neighbours the other way round; summed.
    other: u64,
    /// Between neighbours inside bytes, which are the same in either order.
    inside: f64,
    /// Seams at which the other order differs less, minus those at which it differs more.
    wins: i64,
}

impl Seams {
    fn ratio(&self, sum: u64) -> Option<f64> {
        (self.seams > 0 && self.inside > 0.0).then(|| sum as f64 / self.seams as f64 / self.inside)
    }

    /// How many times as much neighbours differ across bytes as inside them, with the lowest bit first.
    pub(super) fn lowest_first(&self) -> Option<f64> {
        self.ratio(self.here)
    }

    /// The same with the highest bit first.
    pub(super) fn highest_first(&self) -> Option<f64> {
        self.ratio(self.other)
    }

    /// The ratio of the other order, when that is clearly the right one: nearer to the inside of bytes, by much and at
    /// many more seams than chance would have it.
    pub(super) fn turned(&self) -> Option<f64> {
        let (here, other) = (self.ratio(self.here)?, self.ratio(self.other)?);
        let clear = here > 1.5 && other < 0.7 * here && other < (here + 1.0) / 2.0;
        let chance = BEYOND_CHANCE * (self.seams as f64).sqrt();
        let many = self.seams >= 32 && self.wins as f64 > chance.min(0.5 * self.seams as f64);
        (clear && many).then_some(other)
    }

    /// Whether the order that was taken is clearly the right one.
    pub(super) fn fits_here(&self) -> bool {
        let turned = Self { here: self.other, other: self.here, wins: -self.wins, ..*self };
        turned.turned().is_some()
    }
}

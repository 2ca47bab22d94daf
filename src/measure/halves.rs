//! Spikes in the halves of rows and columns of one readout.

use super::frames::PairSums;
use super::vertical::{Counters, GROUPS, TILE, load};
use crate::spikes::Geometry;
use wide::u64x4;

/// The word-wise masks of the left and right half of a row.
pub(super) struct RowHalves {
    stride: usize,
    left: Vec<u64>,
    middle: Vec<u64>,
}

/// The spikes of a readout.
#[derive(Default)]
pub(super) struct Spikes {
    pub(super) left: u64,
    pub(super) right: u64,
    pub(super) total: u64,
}

impl RowHalves {
    pub(super) fn new(width: usize, stride: usize) -> Self {
        let first_bits = |bits: usize| -> Vec<u64> {
            let of_word = |word: usize| match bits.saturating_sub(64 * word) {
                0 => 0,
                n if n < 64 => (1 << n) - 1,
                _ => u64::MAX,
            };
            (0..stride).map(of_word).collect()
        };
        let left = first_bits(width / 2);
        let more = first_bits(width.div_ceil(2));
        let middle = left.iter().zip(&more).map(|(l, m)| l ^ m).collect();
        Self {
            stride,
            left,
            middle,
        }
    }

    /// Adds a readout to the sums of each row.
    pub(super) fn add(&self, words: &[u64], rows: &mut [PairSums]) -> Spikes {
        let mut spikes = Spikes::default();
        for (row, sums) in words.chunks_exact(self.stride).zip(rows) {
            let (mut left, mut total, mut middle) = (0, 0, 0);
            for ((word, mask), odd) in row.iter().zip(&self.left).zip(&self.middle) {
                total += u64::from(word.count_ones());
                left += u64::from((word & mask).count_ones());
                middle |= word & odd;
            }
            let right = total - left - u64::from(middle != 0);
            sums.add(left, right);
            spikes.left += left;
            spikes.right += right;
            spikes.total += total;
        }
        spikes
    }
}

/// Per-column counts of the upper and the lower half.
pub(super) struct ColumnHalves {
    geometry: Geometry,
    stride: usize,
    top: Vec<u32>,
    bottom: Vec<u32>,
    sums: Vec<PairSums>,
}

impl ColumnHalves {
    pub(super) fn new(geometry: Geometry, stride: usize) -> Self {
        let columns = stride * 64;
        Self {
            geometry,
            stride,
            top: vec![0; columns],
            bottom: vec![0; columns],
            sums: vec![PairSums::default(); columns],
        }
    }

    /// Adds a readout; returns the spikes in its upper and lower half.
    pub(super) fn add(&mut self, slot: &[u64]) -> (u64, u64) {
        let height = self.geometry.height();
        let half = height / 2;
        count_columns(slot, self.stride, 0..half, &mut self.top);
        count_columns(slot, self.stride, height - half..height, &mut self.bottom);
        let (mut top, mut bottom) = (0, 0);
        for ((sums, a), b) in self.sums.iter_mut().zip(&self.top).zip(&self.bottom) {
            let (a, b) = (u64::from(*a), u64::from(*b));
            sums.add(a, b);
            top += a;
            bottom += b;
        }
        (top, bottom)
    }

    pub(super) fn finish(mut self) -> Vec<PairSums> {
        self.sums.truncate(self.geometry.width());
        self.sums
    }
}

/// Counts the spikes of each column over some rows of a readout.
fn count_columns(slot: &[u64], stride: usize, rows: std::ops::Range<usize>, counts: &mut [u32]) {
    counts.fill(0);
    for at in (0..stride).step_by(TILE) {
        for from in rows.clone().step_by(GROUPS * 8) {
            let to = (from + GROUPS * 8).min(rows.end);
            let counters = count_rows(slot, stride, from..to, at);
            // A tile may reach into the next row, whose words are not wanted.
            for lane in 0..TILE.min(stride - at) {
                let columns = &mut counts[(at + lane) * 64..][..64];
                for (sum, count) in columns.iter_mut().zip(counters.counts(lane)) {
                    *sum += u32::from(count);
                }
            }
        }
    }
}

/// Counts of a tile's columns over at most 248 rows.
fn count_rows(slot: &[u64], stride: usize, rows: std::ops::Range<usize>, at: usize) -> Counters {
    let mut counters = Counters::new();
    for row in rows.clone().step_by(8) {
        let mut inputs = [u64x4::new([0; TILE]); 8];
        for (input, r) in inputs.iter_mut().zip(row..rows.end) {
            *input = load(slot, r * stride + at);
        }
        counters.add8(&inputs);
    }
    counters
}

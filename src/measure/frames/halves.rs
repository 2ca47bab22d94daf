//! Spikes in the halves of rows and columns of one readout.

use super::pair_sums::PairSums;
use crate::kernels::{Counters, GROUPS, TILE, load};
use crate::spikes::Geometry;
use wide::u64x4;

/// Where the halves of a row lie in its words.
pub(super) struct RowHalves {
    stride: usize,
    /// The word in which the left half ends, and its bits.
    left: (usize, u64),
    /// The middle pixel of an odd width: its word and bit, or no bit.
    middle: (usize, u64),
    sums: Vec<PairSums>,
}

impl RowHalves {
    pub(super) fn new(geometry: Geometry, stride: usize) -> Self {
        let width = geometry.width();
        let half = width / 2;
        let bit = 1 << (half % 64);
        Self {
            stride,
            left: (half / 64, bit - 1),
            middle: (half / 64, if width % 2 == 1 { bit } else { 0 }),
            sums: vec![PairSums::default(); geometry.height()],
        }
    }

    /// Adds a readout; returns the spikes in its left and right half.
    pub(super) fn add(&mut self, words: &[u64]) -> (u64, u64) {
        let (mut all_left, mut all_right) = (0, 0);
        for (row, sums) in words.chunks_exact(self.stride).zip(&mut self.sums) {
            let (before, after) = row.split_at(self.left.0);
            let (shared, after) = after.split_first().unwrap_or((&0, &[]));
            let left = ones(before) + u64::from((shared & self.left.1).count_ones());
            let odd = u64::from(row[self.middle.0] & self.middle.1 != 0);
            let right = ones(after) + u64::from((shared & !self.left.1).count_ones()) - odd;
            sums.add(left, right);
            all_left += left;
            all_right += right;
        }
        (all_left, all_right)
    }

    pub(super) fn finish(self) -> Vec<PairSums> {
        self.sums
    }
}

/// The set bits of a few words. Bytes of counts are added over up to 31 words
/// before they are summed, which halves the work on a CPU without a
/// population count.
fn ones(words: &[u64]) -> u64 {
    const PAIRS: u64 = 0x5555_5555_5555_5555;
    const NIBBLES: u64 = 0x3333_3333_3333_3333;
    const BYTES: u64 = 0x0F0F_0F0F_0F0F_0F0F;
    let mut sum = 0;
    for run in words.chunks(31) {
        let mut bytes = 0;
        for word in run {
            let pairs = word - (word >> 1 & PAIRS);
            let nibbles = (pairs & NIBBLES) + (pairs >> 2 & NIBBLES);
            bytes += (nibbles + (nibbles >> 4)) & BYTES;
        }
        // Sums of 31 bytes of at most 8 fit a byte, their total needs 16 bits.
        let halves = (bytes & 0x00FF_00FF_00FF_00FF) + (bytes >> 8 & 0x00FF_00FF_00FF_00FF);
        sum += halves.wrapping_mul(0x0001_0001_0001_0001) >> 48;
    }
    sum
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

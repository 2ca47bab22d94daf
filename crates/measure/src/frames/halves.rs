//! Spikes in the halves of rows and columns of one readout.

use super::pair_sums::{Lines, PairSums};
use spikelane::spikes::Geometry;
use spikelane::unstable::kernels::{Bits, Counters, GROUPS, Shorts, TILE, Work, counting_with, load};

/// Where the halves of a row lie in its words.
pub(super) struct RowHalves {
    stride: usize,
    /// The word in which the left half ends, and its bits.
    left: (usize, u64),
    /// The middle pixel of an odd width: its word and bit, or no bit.
    middle: (usize, u64),
    sums: Lines,
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
            sums: Lines::new(geometry.height(), half),
        }
    }

    /// Adds a readout; returns the spikes in its left and right half.
    pub(super) fn add(&mut self, words: &[u64]) -> (u64, u64) {
        counting_with(Rows(self, words))
    }

    #[inline(always)]
    fn take(&mut self, words: &[u64]) -> (u64, u64) {
        self.sums.begin();
        let (mut all_left, mut all_right) = (0, 0);
        for (line, row) in words.chunks_exact(self.stride).enumerate() {
            let (before, after) = row.split_at(self.left.0);
            let (shared, after) = after.split_first().unwrap_or((&0, &[]));
            let left = ones(before) + (shared & self.left.1).count_ones();
            let odd = u32::from(row[self.middle.0] & self.middle.1 != 0);
            let right = ones(after) + (shared & !self.left.1).count_ones() - odd;
            self.sums.add(line, left, right);
            all_left += u64::from(left);
            all_right += u64::from(right);
        }
        (all_left, all_right)
    }

    pub(super) fn finish(self) -> Vec<PairSums> {
        self.sums.finish()
    }
}

struct Rows<'a>(&'a mut RowHalves, &'a [u64]);

impl Work for Rows<'_> {
    type Out = (u64, u64);

    #[inline(always)]
    fn run<S: Shorts, B: Bits>(self, _: S, _: B) -> (u64, u64) {
        self.0.take(self.1)
    }
}

/// The set bits of a few words.
#[inline(always)]
fn ones(words: &[u64]) -> u32 {
    let mut sum = 0;
    for word in words {
        sum += word.count_ones();
    }
    sum
}

/// Per-column counts of the upper and the lower half.
pub(super) struct ColumnHalves {
    geometry: Geometry,
    stride: usize,
    top: Vec<u32>,
    bottom: Vec<u32>,
    sums: Lines,
}

impl ColumnHalves {
    pub(super) fn new(geometry: Geometry, stride: usize) -> Self {
        let columns = stride * 64;
        Self {
            geometry,
            stride,
            top: vec![0; columns],
            bottom: vec![0; columns],
            sums: Lines::new(columns, geometry.height() / 2),
        }
    }

    /// Adds a readout; returns the spikes in its upper and lower half.
    pub(super) fn add(&mut self, slot: &[u64]) -> (u64, u64) {
        counting_with(Columns(self, slot))
    }

    #[inline(always)]
    fn take<B: Bits>(&mut self, b: B, slot: &[u64]) -> (u64, u64) {
        let height = self.geometry.height();
        let half = height / 2;
        count_columns(b, slot, self.stride, 0..half, &mut self.top);
        count_columns(b, slot, self.stride, height - half..height, &mut self.bottom);
        self.sums.begin();
        self.sums.add_all(&self.top, &self.bottom)
    }

    pub(super) fn finish(self) -> Vec<PairSums> {
        let mut sums = self.sums.finish();
        sums.truncate(self.geometry.width());
        sums
    }
}

struct Columns<'a>(&'a mut ColumnHalves, &'a [u64]);

impl Work for Columns<'_> {
    type Out = (u64, u64);

    #[inline(always)]
    fn run<S: Shorts, B: Bits>(self, _: S, b: B) -> (u64, u64) {
        self.0.take(b, self.1)
    }
}

/// Counts the spikes of each column over some rows of a readout.
#[inline(always)]
fn count_columns<B: Bits>(
    b: B,
    slot: &[u64],
    stride: usize,
    rows: std::ops::Range<usize>,
    counts: &mut [u32],
) {
    counts.fill(0);
    for at in (0..stride).step_by(TILE) {
        for from in rows.clone().step_by(GROUPS * 8) {
            let to = (from + GROUPS * 8).min(rows.end);
            let found = count_rows(b, slot, stride, from..to, at).counts(b);
            // A tile may reach into the next row, whose words are not wanted.
            let columns = counts[at * 64..].chunks_exact_mut(64);
            for (columns, found) in columns.zip(&found) {
                for (sum, count) in columns.iter_mut().zip(found) {
                    *sum += u32::from(*count);
                }
            }
        }
    }
}

/// Counts of a tile's columns over at most 248 rows.
#[inline(always)]
fn count_rows<B: Bits>(
    b: B,
    slot: &[u64],
    stride: usize,
    rows: std::ops::Range<usize>,
    at: usize,
) -> Counters<B> {
    let mut counters = Counters::new(b);
    for row in rows.clone().step_by(8) {
        let mut inputs = [b.row(&[0; TILE]); 8];
        for (input, r) in inputs.iter_mut().zip(row..rows.end) {
            *input = load(b, slot, r * stride + at);
        }
        counters.add8(b, &inputs);
    }
    counters
}

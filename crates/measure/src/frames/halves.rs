//! Counts the spikes in the two halves of each row and of each column of a readout.

use super::pair_sums::{LineSums, PairSums};
use spikelane::spikes::Geometry;
use spikelane::unstable::kernels::{
    BitOps, Counters, I16Lanes, MAX_GROUPS, ROW_WORDS, Task, dispatch_task, load_row,
};

/// Word positions of the halves of a row, and the pair sums of all rows.
pub(super) struct RowHalves {
    stride: usize,
    /// The word in which the left half ends, and the mask of the left half's bits in that word.
    left: (usize, u64),
    /// The word of the middle pixel and the mask of its bit. The mask is 0 if the width is even.
    middle: (usize, u64),
    sums: LineSums,
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
            sums: LineSums::new(geometry.height(), half),
        }
    }

    /// Adds a readout. Returns the number of spikes in its left half and in its right half.
    pub(super) fn add(&mut self, words: &[u64]) -> (u64, u64) {
        dispatch_task(RowTask(self, words))
    }

    #[inline(always)]
    fn add_words(&mut self, words: &[u64]) -> (u64, u64) {
        self.sums.reserve();
        let (mut all_left, mut all_right) = (0, 0);
        for (line, row) in words.chunks_exact(self.stride).enumerate() {
            let (before, after) = row.split_at(self.left.0);
            let (shared, after) = after.split_first().unwrap_or((&0, &[]));
            let left = count_ones(before) + (shared & self.left.1).count_ones();
            let odd = u32::from(row[self.middle.0] & self.middle.1 != 0);
            let right = count_ones(after) + (shared & !self.left.1).count_ones() - odd;
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

struct RowTask<'a>(&'a mut RowHalves, &'a [u64]);

impl Task for RowTask<'_> {
    type Out = (u64, u64);

    #[inline(always)]
    fn run<S: I16Lanes, B: BitOps>(self, _: S, _: B) -> (u64, u64) {
        self.0.add_words(self.1)
    }
}

/// Returns the number of set bits in `words`.
#[inline(always)]
fn count_ones(words: &[u64]) -> u32 {
    let mut sum = 0;
    for word in words {
        sum += word.count_ones();
    }
    sum
}

/// Number of spikes of each column in the upper half and in the lower half, and the pair sums of all columns.
pub(super) struct ColumnHalves {
    geometry: Geometry,
    stride: usize,
    top: Vec<u32>,
    bottom: Vec<u32>,
    sums: LineSums,
}

impl ColumnHalves {
    pub(super) fn new(geometry: Geometry, stride: usize) -> Self {
        let columns = stride * 64;
        Self {
            geometry,
            stride,
            top: vec![0; columns],
            bottom: vec![0; columns],
            sums: LineSums::new(columns, geometry.height() / 2),
        }
    }

    /// Adds a readout. Returns the number of spikes in its upper half and in its lower half.
    pub(super) fn add(&mut self, slot: &[u64]) -> (u64, u64) {
        dispatch_task(ColumnTask(self, slot))
    }

    #[inline(always)]
    fn add_words<B: BitOps>(&mut self, b: B, slot: &[u64]) -> (u64, u64) {
        let height = self.geometry.height();
        let half = height / 2;
        count_columns(b, slot, self.stride, 0..half, &mut self.top);
        count_columns(b, slot, self.stride, height - half..height, &mut self.bottom);
        self.sums.reserve();
        self.sums.add_all(&self.top, &self.bottom)
    }

    pub(super) fn finish(self) -> Vec<PairSums> {
        let mut sums = self.sums.finish();
        sums.truncate(self.geometry.width());
        sums
    }
}

struct ColumnTask<'a>(&'a mut ColumnHalves, &'a [u64]);

impl Task for ColumnTask<'_> {
    type Out = (u64, u64);

    #[inline(always)]
    fn run<S: I16Lanes, B: BitOps>(self, _: S, b: B) -> (u64, u64) {
        self.0.add_words(b, self.1)
    }
}

/// Adds the spikes of each column, in the rows `rows` of a readout, to `counts`.
#[inline(always)]
fn count_columns<B: BitOps>(
    b: B,
    slot: &[u64],
    stride: usize,
    rows: std::ops::Range<usize>,
    counts: &mut [u32],
) {
    counts.fill(0);
    for at in (0..stride).step_by(ROW_WORDS) {
        for from in rows.clone().step_by(MAX_GROUPS * 8) {
            let to = (from + MAX_GROUPS * 8).min(rows.end);
            let row_counts = count_rows(b, slot, stride, from..to, at).counts(b);
            // A tile can extend into the next row. `zip` ignores the surplus columns.
            let columns = counts[at * 64..].chunks_exact_mut(64);
            for (columns, column_counts) in columns.zip(&row_counts) {
                for (sum, count) in columns.iter_mut().zip(column_counts) {
                    *sum += u32::from(*count);
                }
            }
        }
    }
}

/// Counts the spikes of each column of a tile. `rows` contains at most 248 rows, the limit of the 8-bit counters.
#[inline(always)]
fn count_rows<B: BitOps>(
    b: B,
    slot: &[u64],
    stride: usize,
    rows: std::ops::Range<usize>,
    at: usize,
) -> Counters<B> {
    let mut counters = Counters::new(b);
    for row in rows.clone().step_by(8) {
        let mut inputs = [b.row(&[0; ROW_WORDS]); 8];
        for (input, r) in inputs.iter_mut().zip(row..rows.end) {
            *input = load_row(b, slot, r * stride + at);
        }
        counters.add8(b, &inputs);
    }
    counters
}

//! Sums of interval deviations at each readout of a block.

use super::super::block::MAX_BLOCK_READOUTS;

/// Number of intervals in the reference of a pixel. The reference consists of the first intervals of the pixel.
pub(super) const REFERENCE_INTERVALS: usize = 16;

/// A sum for each possible 16-bit time, so that indexing needs no bounds check.
///
/// Entries whose index is past the end of the block stay zero.
pub(super) type Table = [i32; 1 << 16];

/// The sum of the deviations of the intervals that end at one readout.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in super::super) struct DeviationSum {
    /// The sum of the deviations, in units of 1/16 readout.
    pub(super) sum: i64,
    pub(super) spikes: u32,
}

/// Largest number of pixels whose deviations at one readout fit into a 32-bit sum, if no reference exceeds
/// [`LARGEST_REFERENCE`].
pub(super) const MAX_PIXELS_PER_SUM: usize = 2048;

/// Largest reference that the fast path accepts: the sum of 16 intervals of the longest 15-bit length.
pub(super) const LARGEST_REFERENCE: u32 = REFERENCE_INTERVALS as u32 * i16::MAX as u32;

// A deviation is the difference of two numbers in 0..=LARGEST_REFERENCE.
const _: () = assert!(MAX_PIXELS_PER_SUM as u64 * LARGEST_REFERENCE as u64 <= i32::MAX as u64);

/// Sums over the pixels that fire at each readout of a block.
pub(super) struct ReadoutSums {
    start: u32,
    /// Sums of deviations since the last flush. They include at most [`MAX_PIXELS_PER_SUM`] pixels.
    pub(super) table: Box<Table>,
    deviation: [i64; MAX_BLOCK_READOUTS],
    pub(super) spikes: [u32; MAX_BLOCK_READOUTS],
    /// Number of spikes of pixels whose reference is incomplete. Such a spike has no deviation.
    skipped: [u32; MAX_BLOCK_READOUTS],
}

impl ReadoutSums {
    pub(super) fn new() -> Self {
        let table = vec![0; 1 << 16].into_boxed_slice().try_into().expect("as many");
        Self {
            start: 0,
            table,
            deviation: [0; MAX_BLOCK_READOUTS],
            spikes: [0; MAX_BLOCK_READOUTS],
            skipped: [0; MAX_BLOCK_READOUTS],
        }
    }

    /// Begins a block at readout `start`.
    pub(super) fn begin(&mut self, start: u32) {
        self.start = start;
        self.deviation.fill(0);
        self.skipped.fill(0);
    }

    pub(super) fn add_deviation(&mut self, readout: u32, interval: u32, reference: u32) {
        self.deviation[(readout - self.start) as usize] +=
            REFERENCE_INTERVALS as i64 * i64::from(interval) - i64::from(reference);
    }

    /// Adds the table to the 64-bit sums and clears the table. Call this method after at most [`MAX_PIXELS_PER_SUM`] pixels,
    /// and at the end of the block.
    #[inline(always)]
    pub(super) fn flush(&mut self) {
        for (sum, deviation) in self.deviation.iter_mut().zip(self.table.iter_mut()) {
            *sum += i64::from(*deviation);
            *deviation = 0;
        }
    }

    pub(super) fn count_skipped(&mut self, readout: u32) {
        self.skipped[(readout - self.start) as usize] += 1;
    }

    /// Returns the sums of the first `n` readouts of the block.
    pub(super) fn sums(&self, n: usize) -> impl Iterator<Item = DeviationSum> + '_ {
        (0..n).map(|i| DeviationSum { sum: self.deviation[i], spikes: self.spikes[i] - self.skipped[i] })
    }
}

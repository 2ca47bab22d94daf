//! The readouts of a block as the pixels' intervals see them.

use super::super::block::CAPACITY;

/// Intervals that make a pixel's reference: its first ones.
pub(super) const REFERENCE: usize = 16;

/// A sum at each readout of the block. There is a place for every 16-bit time, so that none needs a check; those
/// behind the block are never touched but for nothing.
pub(super) type Table = [i32; 1 << 16];

/// The sum of the deviations of the intervals that end at one readout.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in super::super) struct DeviationSum {
    /// In sixteenths of a readout.
    pub(super) sum: i64,
    pub(super) spikes: u32,
}

/// Pixels whose deviations of one readout 32 bits hold, where their references are within [`LARGEST_REFERENCE`].
pub(super) const MOST: usize = 2048;

/// Sixteen of the longest intervals of 15 bits.
pub(super) const LARGEST_REFERENCE: u32 = REFERENCE as u32 * i16::MAX as u32;

// A deviation is the difference of two numbers up to that.
const _: () = assert!(MOST as u64 * LARGEST_REFERENCE as u64 <= i32::MAX as u64);

/// Sums over the pixels that fire at each readout.
pub(super) struct Readouts {
    start: u32,
    /// Deviations of [`MOST`] pixels at most.
    pub(super) table: Box<Table>,
    deviation: [i64; CAPACITY],
    pub(super) spikes: [u32; CAPACITY],
    /// Spikes without a reference to deviate from.
    skipped: [u32; CAPACITY],
}

impl Readouts {
    pub(super) fn new() -> Self {
        let table = vec![0; 1 << 16].into_boxed_slice().try_into().expect("as many");
        Self { start: 0, table, deviation: [0; CAPACITY], spikes: [0; CAPACITY], skipped: [0; CAPACITY] }
    }

    /// Begins a block at readout `start`.
    pub(super) fn begin(&mut self, start: u32) {
        self.start = start;
        self.deviation.fill(0);
        self.skipped.fill(0);
    }

    pub(super) fn deviate(&mut self, readout: u32, interval: u32, reference: u32) {
        self.deviation[(readout - self.start) as usize] +=
            REFERENCE as i64 * i64::from(interval) - i64::from(reference);
    }

    /// Sums up the table: before more than [`MOST`] pixels have been added, and at the block's end.
    #[inline(always)]
    pub(super) fn sum(&mut self) {
        for (sum, deviation) in self.deviation.iter_mut().zip(self.table.iter_mut()) {
            *sum += i64::from(*deviation);
            *deviation = 0;
        }
    }

    pub(super) fn skip(&mut self, readout: u32) {
        self.skipped[(readout - self.start) as usize] += 1;
    }

    /// The sums of the first `n` readouts of the block.
    pub(super) fn sums(&self, n: usize) -> impl Iterator<Item = DeviationSum> + '_ {
        (0..n).map(|i| DeviationSum { sum: self.deviation[i], spikes: self.spikes[i] - self.skipped[i] })
    }
}

//! The histogram of interval lengths.

use std::ops::Range;

use super::super::estimate::Estimate;
use super::fast::{self, NewIntervals};
use super::pixel::CUMULATIVE_FENCES;
use spikelane::spikes::Geometry;
use spikelane::unstable::kernels::I16Lanes;

/// Number of groups of adjacent rows that are counted separately. Standard errors come from the scatter of the groups.
const ROW_GROUPS: usize = 32;

/// Returns the total variation distance of two distributions: half of the sum of the absolute differences of their shares. It
/// is 0 for equal distributions, and 1 for distributions without a common entry.
///
/// # Examples
/// ```
/// use spikelane_measure::total_variation;
/// assert_eq!(total_variation(&[0.5, 0.5, 0.0], &[0.5, 0.25, 0.25]), 0.25);
/// ```
#[must_use]
pub fn total_variation(a: &[f64], b: &[f64]) -> f64 {
    0.5 * a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>()
}

/// A histogram of interval lengths over all pixels, in up to 32 groups of adjacent rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IntervalHistogram {
    longest_bin: u32,
    /// Entry `groups[g][length]` counts intervals of `length` readouts. The last entry counts intervals longer than
    /// `longest_bin`.
    groups: Vec<Vec<u64>>,
}

impl IntervalHistogram {
    pub(super) fn new(cap: u32) -> Self {
        Self { longest_bin: cap, groups: vec![vec![0; cap as usize + 2]; ROW_GROUPS] }
    }

    /// Returns the index of the group of a sensor row. It does not depend on the band that contains the row.
    pub(super) fn group(row: usize, geometry: Geometry) -> usize {
        row * ROW_GROUPS / geometry.height()
    }

    pub(super) fn merge(&mut self, other: &Self) {
        for (group, more) in self.groups.iter_mut().zip(&other.groups) {
            for (bin, n) in group.iter_mut().zip(more) {
                *bin += n;
            }
        }
    }

    /// Length in readouts of the longest interval that has its own bin.
    #[must_use]
    pub const fn longest_bin(&self) -> u32 {
        self.longest_bin
    }

    /// Returns the number of intervals of each length.
    ///
    /// Entry `n` counts the intervals of `n` readouts, so entry 0 is always 0. The last entry counts intervals longer than
    /// [`Self::longest_bin`].
    #[must_use]
    pub fn counts(&self) -> Vec<u64> {
        let sum = |bin: usize| self.groups.iter().map(|group| group[bin]).sum();
        (0..self.longest_bin as usize + 2).map(sum).collect()
    }

    /// Returns the share of the intervals of each length, with the entries of [`Self::counts`]. All shares are 0 if there are
    /// no intervals.
    #[must_use]
    pub fn shares(&self) -> Vec<f64> {
        let counts = self.counts();
        let all = counts.iter().sum::<u64>().max(1) as f64;
        counts.iter().map(|n| *n as f64 / all).collect()
    }

    /// Returns the number of intervals longer than [`Self::longest_bin`].
    #[must_use]
    pub fn overflow(&self) -> u64 {
        self.groups.iter().map(|group| group[self.longest_bin as usize + 1]).sum()
    }

    /// Returns the number of all intervals.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.groups.iter().flatten().sum()
    }

    /// Returns the share of intervals of `length` readouts. If `length` exceeds [`Self::longest_bin`], returns the share
    /// of all intervals longer than `longest_bin`.
    ///
    /// The standard error comes from the scatter of `B` groups of rows about the ratio `r`,
    /// `sqrt(B/(B-1) sum (x_b - r n_b)^2) / n`. Group `b` has `n_b` intervals, of which `x_b` are in the bin. `n` is the sum
    /// of all `n_b`. A binomial error would be invalid, because the intervals of one pixel are not independent.
    #[must_use]
    pub fn share(&self, length: u32) -> Estimate {
        let bin = length.min(self.longest_bin + 1) as usize;
        let groups: Vec<(f64, f64)> = self
            .groups
            .iter()
            .map(|g| (g[bin] as f64, g.iter().sum::<u64>() as f64))
            .filter(|(_, n)| *n > 0.0)
            .collect();
        let n: f64 = groups.iter().map(|g| g.1).sum();
        let value = groups.iter().map(|g| g.0).sum::<f64>() / n;
        let squares: f64 = groups.iter().map(|(x, n)| (x - value * n).powi(2)).sum();
        let b = groups.len() as f64;
        Estimate { value, error: (b / (b - 1.0) * squares).sqrt() / n, samples: groups.len() }
    }
}

/// If more than one in `BULK_OUTLIER_RATIO` intervals is outside the fences, all intervals are counted one by one.
const BULK_OUTLIER_RATIO: u32 = 8;

/// The histogram of one block and one group of rows.
///
/// Successive intervals are mostly equal. If two successive additions change the same bin, the second waits for the
/// first. Therefore four tables are used in turn.
pub(super) struct BlockHistogram {
    longest_bin: u32,
    bins: [Vec<u32>; 4],
    is_used: bool,
}

impl BlockHistogram {
    pub(super) fn new(cap: u32) -> Self {
        Self { longest_bin: cap, bins: std::array::from_fn(|_| vec![0; cap as usize + 2]), is_used: false }
    }

    /// Counts an interval in table `turn % 4`.
    #[inline(always)]
    pub(super) fn add(&mut self, turn: usize, interval: u32) {
        self.is_used = true;
        self.bins[turn % 4][interval.min(self.longest_bin + 1) as usize] += 1;
    }

    /// Counts the intervals of a pixel in `range`.
    ///
    /// Successive fences around `center` are one readout apart, so the fence counts determine the number of intervals of
    /// each length between the fences. Intervals outside the fences are counted one by one.
    #[inline(always)]
    pub(super) fn add_new_intervals<S: I16Lanes>(
        &mut self,
        s: S,
        new_intervals: &NewIntervals,
        center: i64,
        intervals: &[i16],
        range: Range<usize>,
    ) {
        let (within, n) = (&new_intervals.cumulative, range.len() as u32);
        let beyond = n - (within[CUMULATIVE_FENCES - 1] - within[0]);
        if beyond * BULK_OUTLIER_RATIO > n {
            for (i, interval) in intervals[range].iter().enumerate() {
                self.add(i, *interval as u32);
            }
            return;
        }
        self.is_used = true;
        let lowest = center - 2;
        for (j, ends) in within.windows(2).enumerate() {
            // Counts at the lower clamp are zero. The upper clamp selects the last bin, for intervals longer than `longest_bin`.
            let length = (lowest + j as i64).clamp(0, i64::from(self.longest_bin) + 1);
            self.bins[j % 4][length as usize] += ends[1] - ends[0];
        }
        if beyond > 0 {
            let fence = |length: i64| length.clamp(0, i64::from(i16::MAX)) as i16;
            let (low, high) = (fence(lowest), fence(center + 2));
            fast::for_each_outlier(s, intervals, range, low, high, |x| self.add(0, x as u32));
        }
    }

    /// Adds the counts to group `group` of the histogram and clears them.
    pub(super) fn flush(&mut self, lengths: &mut IntervalHistogram, group: usize) {
        if !std::mem::take(&mut self.is_used) {
            return;
        }
        for bins in &mut self.bins {
            for (sum, n) in lengths.groups[group].iter_mut().zip(bins) {
                *sum += u64::from(std::mem::take(n));
            }
        }
    }
}

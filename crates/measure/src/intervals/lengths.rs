//! How often each interval length occurs.

use std::ops::Range;

use super::super::estimate::Estimate;
use super::fast::{self, Found};
use super::pixel::CUMULATIVE;
use spikelane::spikes::Geometry;
use spikelane::unstable::kernels::Shorts;

/// Groups of rows that are counted apart, for the spread between them.
const GROUPS: usize = 32;

/// A histogram of interval lengths over all pixels, in up to 32 groups of
/// neighbouring rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lengths {
    cap: u32,
    /// `groups[g][length]`; the bin behind the cap holds all longer ones.
    groups: Vec<Vec<u64>>,
}

impl Lengths {
    pub(super) fn new(cap: u32) -> Self {
        Self { cap, groups: vec![vec![0; cap as usize + 2]; GROUPS] }
    }

    /// The group of a row: the same for every band of the sensor.
    pub(super) fn group(row: usize, geometry: Geometry) -> usize {
        row * GROUPS / geometry.height()
    }

    pub(super) fn merge(&mut self, other: &Self) {
        for (group, more) in self.groups.iter_mut().zip(&other.groups) {
            for (bin, n) in group.iter_mut().zip(more) {
                *bin += n;
            }
        }
    }

    /// The longest length with a bin of its own.
    #[must_use]
    pub const fn cap(&self) -> u32 {
        self.cap
    }

    /// Intervals of each length: entry `n` counts the intervals of `n`
    /// readouts (entry 0 is always 0), the last entry those beyond the cap.
    #[must_use]
    pub fn counts(&self) -> Vec<u64> {
        let sum = |bin: usize| self.groups.iter().map(|group| group[bin]).sum();
        (0..self.cap as usize + 2).map(sum).collect()
    }

    /// Intervals longer than the cap.
    #[must_use]
    pub fn overflow(&self) -> u64 {
        self.groups.iter().map(|group| group[self.cap as usize + 1]).sum()
    }

    /// All intervals.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.groups.iter().flatten().sum()
    }

    /// Share of intervals of `length` readouts; `cap + 1` stands for all longer
    /// ones. Standard error: spread of groups of rows about the ratio,
    /// `sqrt(B/(B-1) sum (x_b - r n_b)^2) / n`. Intervals of one pixel are
    /// anything but independent, so a binomial error would be meaningless.
    #[must_use]
    pub fn share(&self, length: u32) -> Estimate {
        let bin = length.min(self.cap + 1) as usize;
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

/// When one interval of that many lies beyond the fences, all are counted one by one.
const MANY: u32 = 8;

/// The counts of one block and group. Successive intervals are mostly equal,
/// and adding to the same place twice in a row waits for the first addition:
/// four tables take turns.
pub(super) struct Tally {
    cap: u32,
    bins: [Vec<u32>; 4],
    used: bool,
}

impl Tally {
    pub(super) fn new(cap: u32) -> Self {
        Self { cap, bins: std::array::from_fn(|_| vec![0; cap as usize + 2]), used: false }
    }

    /// Counts the `turn`-th interval.
    #[inline(always)]
    pub(super) fn add(&mut self, turn: usize, interval: u32) {
        self.used = true;
        self.bins[turn % 4][interval.min(self.cap + 1) as usize] += 1;
    }

    /// Counts the intervals of a pixel in `range`. The counts at the fences around `centre` tell the lengths
    /// between them; those beyond are counted one by one.
    #[inline(always)]
    pub(super) fn add_found<S: Shorts>(
        &mut self,
        s: S,
        found: &Found,
        centre: i64,
        intervals: &[i16],
        range: Range<usize>,
    ) {
        let (within, n) = (&found.within, range.len() as u32);
        let beyond = n - (within[CUMULATIVE - 1] - within[0]);
        if beyond * MANY > n {
            for (i, interval) in intervals[range].iter().enumerate() {
                self.add(i, *interval as u32);
            }
            return;
        }
        self.used = true;
        let lowest = centre - 2;
        for (j, ends) in within.windows(2).enumerate() {
            // No interval is that short where this clamps.
            let length = (lowest + j as i64).clamp(0, i64::from(self.cap) + 1);
            self.bins[j % 4][length as usize] += ends[1] - ends[0];
        }
        if beyond > 0 {
            let fence = |length: i64| length.clamp(0, i64::from(i16::MAX)) as i16;
            let (low, high) = (fence(lowest), fence(centre + 2));
            fast::outliers(s, intervals, range, low, high, |x| self.add(0, x as u32));
        }
    }

    /// Moves the counts into the histogram.
    pub(super) fn empty(&mut self, lengths: &mut Lengths, group: usize) {
        if !std::mem::take(&mut self.used) {
            return;
        }
        for bins in &mut self.bins {
            for (sum, n) in lengths.groups[group].iter_mut().zip(bins) {
                *sum += u64::from(std::mem::take(n));
            }
        }
    }
}

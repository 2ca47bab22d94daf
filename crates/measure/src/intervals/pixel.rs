//! What is kept of one pixel, and the path that takes any pixel.

use super::readouts::{REFERENCE, Readouts};

/// Fences at whole readouts around the reference, from 3 below to 2 above.
pub(super) const CUMULATIVE: usize = 6;

/// The sums of one pixel, all integers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pixel {
    pub(super) spikes: u32,
    /// The first three spikes.
    pub(super) first: [u32; 3],
    pub(super) shortest: u32,
    pub(super) longest: u32,
    /// Sums of products of intervals one and two apart.
    pub(super) products: [u64; 2],
    /// Sum of the first [`REFERENCE`] intervals; 0 until they are known.
    pub(super) reference: u32,
    /// Intervals below 0.6 and above 1.6 of the reference mean.
    pub(super) short: u32,
    pub(super) long: u32,
    /// Intervals of at most `c - 3 + j` readouts, `c` the reference mean.
    pub(super) within: [u32; CUMULATIVE],
}

impl Pixel {
    pub(super) const fn new() -> Self {
        Self {
            spikes: 0,
            first: [u32::MAX; 3],
            shortest: u32::MAX,
            longest: 0,
            products: [0; 2],
            reference: 0,
            short: 0,
            long: 0,
            within: [0; CUMULATIVE],
        }
    }

    /// The reference mean rounded to whole readouts.
    pub(super) const fn centre(&self) -> i64 {
        (self.reference as i64 + REFERENCE as i64 / 2) / REFERENCE as i64
    }

    /// The greatest length that lies *below* each boundary: an interval is
    /// beyond boundary `j` when it is greater than fence `j`. The first is the
    /// lower one at 0.6, the second the upper one at 1.6.
    pub(super) fn fences(&self) -> [i64; 2 + CUMULATIVE] {
        let sum = i64::from(self.reference);
        // x < 0.6 sum/16 is x <= ceil(6 sum/160) - 1; x > 1.6 sum/16 is x > floor(sum/10).
        let short = (6 * sum + 159) / 160 - 1;
        let mut fences = [short, sum / 10, 0, 0, 0, 0, 0, 0];
        for (j, fence) in fences[2..].iter_mut().enumerate() {
            *fence = self.centre() - 3 + j as i64;
        }
        fences
    }

    /// Adds `n` intervals of which `above[j]` lie beyond fence `j`.
    pub(super) fn add_above(&mut self, n: u32, above: [u32; 2 + CUMULATIVE]) {
        self.short += n - above[0];
        self.long += above[1];
        for (within, above) in self.within.iter_mut().zip(&above[2..]) {
            *within += n - above;
        }
    }

    /// Counts an interval at the fences.
    pub(super) fn judge(&mut self, interval: u32) {
        let above = self.fences().map(|f| u32::from(i64::from(interval) > f));
        self.add_above(1, above);
    }

    /// Adds the spikes from `times[known]` on, one by one, with `sums` the first times and the squares of each lag; the entries before
    /// are the spikes just before them (all of them, if the pixel has fired
    /// fewer times than the history holds).
    pub(super) fn add_each(
        &mut self,
        times: &[u32],
        known: usize,
        lags: &[u32],
        sums: &mut [[u64; 2]],
        readouts: &mut Readouts,
    ) {
        for i in known..times.len() {
            for (lag, sum) in lags.iter().zip(sums.iter_mut()) {
                match i.checked_sub(*lag as usize) {
                    Some(before) => sum[1] += u64::from(times[i] - times[before]).pow(2),
                    // One of the first spikes: see `State::finish_sums`.
                    None => sum[0] += u64::from(times[i]),
                }
            }
            if i > 0 {
                self.add_interval(times, i);
            }
            let ordinal = self.spikes as usize;
            if ordinal < 3 {
                self.first[ordinal] = times[i];
            }
            self.spikes += 1;
            if ordinal == REFERENCE {
                self.reference = times[i] - times[i - REFERENCE];
                for k in i - REFERENCE + 1..=i {
                    self.judge(times[k] - times[k - 1]);
                }
            } else if ordinal > REFERENCE {
                let interval = times[i] - times[i - 1];
                self.judge(interval);
                readouts.deviate(times[i], interval, self.reference);
            }
            if ordinal <= REFERENCE {
                readouts.skip(times[i]);
            }
        }
    }

    fn add_interval(&mut self, times: &[u32], i: usize) {
        let interval = |k: usize| u64::from(times[k] - times[k - 1]);
        let x = interval(i);
        self.shortest = self.shortest.min(x as u32);
        self.longest = self.longest.max(x as u32);
        for (apart, product) in self.products.iter_mut().enumerate() {
            if i > apart + 1 {
                *product += x * interval(i - apart - 1);
            }
        }
    }
}

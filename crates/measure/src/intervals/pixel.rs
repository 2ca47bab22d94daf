//! The sums of one pixel, and the exact path, which adds spikes one by one.

/// Number of intervals in the reference of a pixel. The reference consists of the first intervals of the pixel.
pub(super) const REFERENCE_INTERVALS: usize = 16;

/// Number of fences at whole readouts. They range from 3 readouts below to 2 readouts above the rounded reference mean.
pub(super) const CUMULATIVE_FENCES: usize = 6;

/// The integer sums of one pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PixelSums {
    pub(super) spikes: u32,
    /// Readouts of the first three spikes.
    pub(super) first_spikes: [u32; 3],
    pub(super) shortest: u32,
    pub(super) longest_interval: u32,
    /// Sums of the products `x_k x_(k-1)` (entry 0) and `x_k x_(k-2)` (entry 1) over the intervals `x_k` of the pixel.
    pub(super) lag_products: [u64; 2],
    /// Sum of the first [`REFERENCE_INTERVALS`] intervals. It is 0 until the pixel has that many intervals.
    pub(super) reference: u32,
    /// Number of intervals below 0.6 times the reference mean.
    pub(super) short_count: u32,
    pub(super) long_count: u32,
    /// Entry `j` is the number of intervals of at most `c - 3 + j` readouts, where `c` is the rounded reference mean.
    pub(super) cumulative: [u32; CUMULATIVE_FENCES],
}

impl PixelSums {
    pub(super) const fn new() -> Self {
        Self {
            spikes: 0,
            first_spikes: [u32::MAX; 3],
            shortest: u32::MAX,
            longest_interval: 0,
            lag_products: [0; 2],
            reference: 0,
            short_count: 0,
            long_count: 0,
            cumulative: [0; CUMULATIVE_FENCES],
        }
    }

    /// Returns the reference mean, rounded to whole readouts.
    pub(super) const fn center(&self) -> i64 {
        (self.reference as i64 + REFERENCE_INTERVALS as i64 / 2) / REFERENCE_INTERVALS as i64
    }

    /// Returns the fences. An interval is above fence `j` if it is greater than the returned value `j`.
    ///
    /// Fence 0 is the largest length below 0.6 times the reference mean. Fence 1 is the largest length of at most 1.6
    /// times the reference mean. The other fences are successive whole readouts around the reference mean.
    pub(super) fn fences(&self) -> [i64; 2 + CUMULATIVE_FENCES] {
        let sum = i64::from(self.reference);
        // mean = sum/16, so x < 0.6 mean means x <= ceil(6 sum/160) - 1, and x > 1.6 mean means x > floor(sum/10).
        let short = (6 * sum + 159) / 160 - 1;
        let mut fences = [short, sum / 10, 0, 0, 0, 0, 0, 0];
        for (j, fence) in fences[2..].iter_mut().enumerate() {
            *fence = self.center() - 3 + j as i64;
        }
        fences
    }

    /// Adds `n` intervals. `above[j]` of them exceed fence `j`.
    pub(super) fn add_above(&mut self, n: u32, above: [u32; 2 + CUMULATIVE_FENCES]) {
        self.short_count += n - above[0];
        self.long_count += above[1];
        for (within, above) in self.cumulative.iter_mut().zip(&above[2..]) {
            *within += n - above;
        }
    }

    /// Adds one interval to the counts at the fences.
    pub(super) fn count_at_fences(&mut self, interval: u32) {
        let above = self.fences().map(|f| u32::from(i64::from(interval) > f));
        self.add_above(1, above);
    }

    /// Adds the spikes `times[known..]` one by one.
    ///
    /// `times[..known]` are the preceding spikes: the whole history, or all earlier spikes if the pixel has fired fewer
    /// times. For each lag `n`, `sums` contains the sum of the first `n` times and the sum of squared differences.
    /// If `in_readouts` is false, the times are not readouts, and intervals are not counted at the fences.
    pub(super) fn add_each(
        &mut self,
        times: &[u32],
        known: usize,
        lags: &[u32],
        sums: &mut [[u64; 2]],
        in_readouts: bool,
    ) {
        for i in known..times.len() {
            for (lag, sum) in lags.iter().zip(sums.iter_mut()) {
                match i.checked_sub(*lag as usize) {
                    Some(before) => sum[1] += u64::from(times[i] - times[before]).pow(2),
                    // The spike is one of the first `lag` spikes. `IntervalAccumulator::finish_sums` explains this sum.
                    None => sum[0] += u64::from(times[i]),
                }
            }
            if i > 0 {
                self.add_interval(times, i);
            }
            let ordinal = self.spikes as usize;
            if ordinal < 3 {
                self.first_spikes[ordinal] = times[i];
            }
            self.spikes += 1;
            if !in_readouts {
                continue;
            }
            if ordinal == REFERENCE_INTERVALS {
                self.reference = times[i] - times[i - REFERENCE_INTERVALS];
                for k in i - REFERENCE_INTERVALS + 1..=i {
                    self.count_at_fences(times[k] - times[k - 1]);
                }
            } else if ordinal > REFERENCE_INTERVALS {
                self.count_at_fences(times[i] - times[i - 1]);
            }
        }
    }

    fn add_interval(&mut self, times: &[u32], i: usize) {
        let interval = |k: usize| u64::from(times[k] - times[k - 1]);
        let x = interval(i);
        self.shortest = self.shortest.min(x as u32);
        self.longest_interval = self.longest_interval.max(x as u32);
        for (lag, product) in self.lag_products.iter_mut().enumerate() {
            if i > lag + 1 {
                *product += x * interval(i - lag - 1);
            }
        }
    }
}

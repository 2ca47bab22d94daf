//! Interval statistics of a measured stream.

use std::ops::Range;

use super::super::estimate::{Estimate, median};
use super::pixel::{CUMULATIVE_FENCES, PixelSums};
use super::readout_sums::REFERENCE_INTERVALS;
use super::{DeviationSum, IntervalHistogram};
use spikelane::spikes::Geometry;

/// Interval statistics of a band of rows.
///
/// Pixel `p` has spikes at readouts `t_0 < ... < t_N`. It therefore has `N` intervals `x_k = t_k - t_(k-1)` with the
/// mean `m = (t_N - t_0) / N`. All sums are exact integers. Maps are row-major and contain one entry per pixel of the
/// band. An entry is NaN if the pixel has too few spikes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Intervals {
    pub(crate) geometry: Geometry,
    pub(crate) rows: Range<usize>,
    pub(super) readouts: u32,
    pub(super) lags: Vec<u32>,
    pub(super) pixels: Vec<PixelSums>,
    /// Sum of differences and sum of squared differences, for each pixel and lag.
    pub(super) sums: Vec<[u64; 2]>,
    /// Readouts of the last three spikes of each pixel.
    pub(super) latest_spikes: Vec<[u32; 3]>,
    pub(super) histogram: IntervalHistogram,
    pub(super) split: Option<Snapshot>,
    pub(super) deviations: Vec<DeviationSum>,
}

/// Spike count, last spike and sum of squared intervals of each pixel at the split between the halves of the stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Snapshot {
    pub(super) spikes: Vec<u32>,
    pub(super) last: Vec<u32>,
    pub(super) squares: Vec<u64>,
}

/// The intervals of one pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PixelIntervals {
    /// Number of intervals `N`, which is the number of spikes minus one.
    pub intervals: u32,
    /// Sum of the intervals, `t_N - t_0`, in readouts.
    pub sum: u64,
    /// Sum of the squared intervals, in readouts squared.
    pub sum_squares: u64,
    /// The shortest and the longest interval in readouts. `None` if there is no interval.
    pub extremes: Option<(u32, u32)>,
    /// Number of intervals below 0.6 times the reference mean, and number of intervals above 1.6 times the reference
    /// mean. The reference mean is the mean of the pixel's first 16 intervals. `None` with fewer than 16 intervals.
    pub short_and_long_counts: Option<(u32, u32)>,
    /// Number of intervals that are neither `floor(m)` nor `ceil(m)`, where `m` is the mean of the pixel's intervals.
    ///
    /// `None` with fewer than 16 intervals, or if `m` differs by about two readouts or more from the mean of the first
    /// 16 intervals.
    pub off_lattice_count: Option<u32>,
}

/// Maps of the first and of the second half of a stream, for the pixels of a band.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct HalfMaps {
    /// Rates of the first and of the second half, in spikes per readout, computed from spike times. An interval across
    /// the split belongs to the second half.
    pub rate: [Vec<f64>; 2],
    /// Variance of the intervals of each half about the mean of that half, in readouts squared.
    pub variance: [Vec<f64>; 2],
}

/// Mean deviation of the intervals that end at one readout. The deviation of an interval is its length minus the mean
/// of its pixel's first 16 intervals.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct ReadoutDeviation {
    /// The readout.
    pub readout: u32,
    /// Mean deviation at this readout minus the mean deviation over all readouts, in readouts.
    pub mean: f64,
    /// The mean deviation divided by its standard error.
    pub sigmas: f64,
    /// Number of intervals that end at this readout.
    pub intervals: u32,
}

impl Intervals {
    /// Number of readouts that were measured.
    #[must_use]
    pub const fn readouts(&self) -> u32 {
        self.readouts
    }

    /// The lags in intervals, in ascending order. The first lag is 1.
    #[must_use]
    pub fn lags(&self) -> &[u32] {
        &self.lags
    }

    /// Number of pixels of the band.
    #[must_use]
    pub fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Whether the band has no pixels. Always false.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.pixels.is_empty()
    }

    /// Returns the number of spikes of each pixel.
    pub(crate) fn spikes(&self) -> impl Iterator<Item = u32> {
        self.pixels.iter().map(|p| p.spikes)
    }

    /// Returns the readouts of each pixel's first and last spike. Both are [`super::NO_SPIKE`] if the pixel never fired.
    pub(crate) fn first_and_last_spikes(&self) -> impl Iterator<Item = (u32, u32)> {
        self.pixels.iter().zip(&self.latest_spikes).map(|(p, latest)| (p.first_spikes[0], latest[2]))
    }

    /// Returns the number of intervals of pixel `p` and the sum of these intervals.
    pub(super) fn span(&self, p: usize) -> (u32, u32) {
        match self.pixels[p].spikes {
            0 => (0, 0),
            n => (n - 1, self.latest_spikes[p][2] - self.pixels[p].first_spikes[0]),
        }
    }

    /// Returns the intervals of pixel `p` of the band.
    ///
    /// # Panics
    /// If `p` is not below [`Self::len`].
    #[must_use]
    pub fn pixel(&self, p: usize) -> PixelIntervals {
        let pixel = &self.pixels[p];
        let (intervals, sum) = self.span(p);
        let judged = pixel.reference > 0;
        PixelIntervals {
            intervals,
            sum: u64::from(sum),
            sum_squares: self.sums[p * self.lags.len()][1],
            extremes: (intervals > 0).then_some((pixel.shortest, pixel.longest_interval)),
            short_and_long_counts: judged.then_some((pixel.short_count, pixel.long_count)),
            off_lattice_count: judged.then(|| off_lattice_count(pixel, intervals, sum)).flatten(),
        }
    }

    /// Returns the rate of each pixel, computed from its spike times as `N / (t_N - t_0)`, in spikes per readout.
    ///
    /// [`super::super::Counts::rate_by_time`] describes the standard error.
    #[must_use]
    pub fn rate_by_time(&self) -> Vec<f64> {
        let rate = |p| match self.span(p) {
            (0, _) => f64::NAN,
            (n, sum) => f64::from(n) / f64::from(sum),
        };
        (0..self.len()).map(rate).collect()
    }

    /// The histogram of interval lengths over all pixels.
    #[must_use]
    pub const fn histogram(&self) -> &IntervalHistogram {
        &self.histogram
    }

    /// Returns the share of intervals below 0.6 times, and the share of intervals above 1.6 times, the reference mean. The
    /// reference mean is the mean of the pixel's first 16 intervals.
    ///
    /// The shares include the intervals of `pixels`, or of all pixels if `pixels` is `None`. The standard errors come
    /// from the scatter of the pixels about the ratio.
    #[must_use]
    pub fn short_and_long_shares(&self, pixels: Option<&[usize]>) -> (Estimate, Estimate) {
        let share = |which: fn((u32, u32)) -> u32| {
            self.ratio(pixels, |p| {
                let view = self.pixel(p);
                view.short_and_long_counts.map(|both| (f64::from(which(both)), f64::from(view.intervals)))
            })
        };
        (share(|both| both.0), share(|both| both.1))
    }

    /// Returns the share of intervals that are neither `floor(m)` nor `ceil(m)`, where `m` is the mean interval of their
    /// pixel.
    ///
    /// The share is 0 for an ideal integrator in constant light. The standard error comes from the scatter of the pixels
    /// about the ratio.
    #[must_use]
    pub fn off_lattice_share(&self, pixels: Option<&[usize]>) -> Estimate {
        self.ratio(pixels, |p| {
            let view = self.pixel(p);
            view.off_lattice_count.map(|n| (f64::from(n), f64::from(view.intervals)))
        })
    }

    /// Returns maps of the two halves of the stream. Returns `None` if [`super::super::MeasureOptions::split`] was not set,
    /// or if the stream ended before the split.
    #[must_use]
    pub fn half_maps(&self) -> Option<HalfMaps> {
        let split = self.split.as_ref()?;
        let half = |which: usize| {
            let both = (0..self.len()).map(|p| self.half(split, p, which));
            both.unzip()
        };
        let (first, second) = (half(0), half(1));
        Some(HalfMaps { rate: [first.0, second.0], variance: [first.1, second.1] })
    }

    fn half(&self, split: &Snapshot, p: usize, which: usize) -> (f64, f64) {
        let early = match split.spikes[p] {
            0 => (0, 0),
            n => (n - 1, split.last[p] - self.pixels[p].first_spikes[0]),
        };
        let all = self.span(p);
        let squares = self.sums[p * self.lags.len()][1];
        let (n, sum, squares) = match which {
            0 => (early.0, early.1, split.squares[p]),
            _ => (all.0 - early.0, all.1 - early.1, squares - split.squares[p]),
        };
        if n == 0 {
            return (f64::NAN, f64::NAN);
        }
        let (n, sum, squares) = (u128::from(n), u128::from(sum), u128::from(squares));
        // By the Cauchy-Schwarz inequality n * squares >= sum * sum, so the unsigned subtraction cannot underflow.
        let variance = (n * squares - sum * sum) as f64 / (n * n) as f64;
        (n as f64 / sum as f64, variance)
    }

    /// Returns, for each readout, the mean deviation of the intervals that end at this readout. The deviation of an
    /// interval is its length minus the mean of its pixel's first 16 intervals.
    ///
    /// The result covers the first [`super::super::MeasureOptions::series_readouts`] readouts. It omits readouts at which
    /// fewer than `min_intervals` intervals end.
    ///
    /// In a static scene, a lost readout shortens every interval that spans it. A repeated readout adds an interval of
    /// one readout for each pixel that fires in it, and lengthens the current interval of every other pixel. The
    /// standard error of a mean deviation is `sqrt(D(1) / intervals)`, where `D(1)` is the mean interval variance.
    #[must_use]
    pub fn deviations(&self, min_intervals: u32) -> Vec<ReadoutDeviation> {
        let enough = |d: &(usize, &DeviationSum)| d.1.spikes >= min_intervals.max(1);
        let (sum, n) =
            self.deviations.iter().fold((0, 0), |(sum, n), d| (sum + d.sum, n + u64::from(d.spikes)));
        let scale = 1.0 / REFERENCE_INTERVALS as f64;
        let overall = sum as f64 * scale / n as f64;
        let variance = self.lag_variance(1, None).value;
        let deviations = self.deviations.iter().enumerate().filter(enough);
        deviations
            .map(|(readout, d)| {
                let mean = d.sum as f64 * scale / f64::from(d.spikes) - overall;
                ReadoutDeviation {
                    readout: readout as u32,
                    mean,
                    sigmas: mean / (variance / f64::from(d.spikes)).sqrt(),
                    intervals: d.spikes,
                }
            })
            .collect()
    }

    /// Returns the most negative and the most positive deviation. Readouts with fewer than half the median number of
    /// intervals are ignored.
    #[must_use]
    pub fn deviation_extremes(&self) -> Option<(ReadoutDeviation, ReadoutDeviation)> {
        let mut spikes: Vec<f64> = self.deviations.iter().map(|d| f64::from(d.spikes)).collect();
        let min_spikes = median(&mut spikes) / 2.0;
        let all = self.deviations(min_spikes.max(1.0) as u32);
        let order = |a: &&ReadoutDeviation, b: &&ReadoutDeviation| a.sigmas.total_cmp(&b.sigmas);
        Some((*all.iter().min_by(order)?, *all.iter().max_by(order)?))
    }

    /// Returns the ratio `r = sum x / sum y` of two sums over pixels. The standard error comes from the scatter of `P`
    /// pixels, `sqrt(P/(P-1) sum (x - r y)^2) / sum y`.
    fn ratio(&self, pixels: Option<&[usize]>, of_pixel: impl Fn(usize) -> Option<(f64, f64)>) -> Estimate {
        let mut values = Vec::new();
        self.for_each_pixel(pixels, |p| values.extend(of_pixel(p)));
        let y: f64 = values.iter().map(|v| v.1).sum();
        let value = values.iter().map(|v| v.0).sum::<f64>() / y;
        let squares: f64 = values.iter().map(|(x, y)| (x - value * y).powi(2)).sum();
        let n = values.len() as f64;
        Estimate { value, error: (n / (n - 1.0) * squares).sqrt() / y, samples: values.len() }
    }

    /// Returns the mean of `of_pixel` over `pixels`, or over all pixels if `pixels` is `None`. The standard error comes
    /// from the scatter of the pixels.
    pub(super) fn mean(&self, pixels: Option<&[usize]>, of_pixel: impl Fn(usize) -> f64) -> Estimate {
        let mut values = Vec::new();
        self.for_each_pixel(pixels, |p| values.push(of_pixel(p)));
        Estimate::mean(values)
    }

    pub(super) fn for_each_pixel(&self, pixels: Option<&[usize]>, mut visit: impl FnMut(usize)) {
        match pixels {
            Some(pixels) => pixels.iter().for_each(|p| visit(*p)),
            None => (0..self.len()).for_each(visit),
        }
    }

    /// Whether `other` was measured with the same options as `self`.
    pub(crate) fn has_same_options(&self, other: &Self) -> bool {
        self.lags == other.lags
            && self.histogram.longest_bin() == other.histogram.longest_bin()
            && self.split.is_some() == other.split.is_some()
            && self.deviations.len() == other.deviations.len()
    }

    /// Appends the intervals of the band below this band. The caller must check that the two bands are compatible.
    pub(crate) fn append(&mut self, below: Self) {
        self.rows.end = below.rows.end;
        self.pixels.extend(below.pixels);
        self.sums.extend(below.sums);
        self.latest_spikes.extend(below.latest_spikes);
        self.histogram.merge(&below.histogram);
        if let (Some(split), Some(more)) = (&mut self.split, below.split) {
            split.spikes.extend(more.spikes);
            split.last.extend(more.last);
            split.squares.extend(more.squares);
        }
        for (sum, more) in self.deviations.iter_mut().zip(below.deviations) {
            sum.sum += more.sum;
            sum.spikes += more.spikes;
        }
    }
}

/// Returns the number of intervals that are neither the floor nor the ceiling of the pixel's mean interval. Returns
/// `None` if the floor or the ceiling is outside the fences.
fn off_lattice_count(pixel: &PixelSums, intervals: u32, sum: u32) -> Option<u32> {
    let (floor, ceil) = (sum / intervals, sum.div_ceil(intervals));
    let fence = |length: i64| {
        let j = length - (pixel.center() - 3);
        usize::try_from(j).ok().filter(|j| *j < CUMULATIVE_FENCES)
    };
    let below = fence(i64::from(floor) - 1)?;
    let within = fence(i64::from(ceil))?;
    Some(intervals - (pixel.cumulative[within] - pixel.cumulative[below]))
}

//! Interval statistics of a measured stream.

use std::ops::Range;

use super::super::estimate::Estimate;
use super::IntervalHistogram;
use super::pixel::{CUMULATIVE_FENCES, PixelSums};
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
        self.lags == other.lags && self.histogram.longest_bin() == other.histogram.longest_bin()
    }

    /// Appends the intervals of the band below this band. The caller must check that the two bands are compatible.
    pub(crate) fn append(&mut self, below: Self) {
        self.rows.end = below.rows.end;
        self.pixels.extend(below.pixels);
        self.sums.extend(below.sums);
        self.latest_spikes.extend(below.latest_spikes);
        self.histogram.merge(&below.histogram);
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

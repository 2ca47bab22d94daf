//! What a pass over the intervals has found.

use std::ops::Range;

use super::super::estimate::{Estimate, median};
use super::pixel::{CUMULATIVE, Pixel};
use super::readouts::REFERENCE;
use super::{DeviationSum, Lengths};
use spikelane::spikes::Geometry;

/// Interval statistics of a band of rows.
///
/// Per pixel the spikes are at readouts `t_0 < ... < t_N`: `N` intervals
/// `x_k = t_k - t_(k-1)`, mean `m = (t_N - t_0) / N`. All sums are exact
/// integers; maps are row-major, one entry per pixel of the band, NaN where a
/// pixel fired too rarely.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Intervals {
    pub(crate) geometry: Geometry,
    pub(crate) rows: Range<usize>,
    pub(super) readouts: u32,
    pub(super) lags: Vec<u32>,
    pub(super) pixels: Vec<Pixel>,
    /// Sum of differences and of their squares, lag by lag for each pixel.
    pub(super) sums: Vec<[u64; 2]>,
    /// The last three spikes of each pixel.
    pub(super) latest: Vec<[u32; 3]>,
    pub(super) lengths: Lengths,
    pub(super) split: Option<Snapshot>,
    pub(super) deviations: Vec<DeviationSum>,
}

/// Spikes, last spikes and squares at the split.
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
    /// Number of intervals `N`, one less than the spikes.
    pub intervals: u32,
    /// Their sum, `t_N - t_0`, in readouts.
    pub sum: u64,
    /// The sum of their squares.
    pub sum_squares: u64,
    /// The shortest and the longest one; `None` without any.
    pub extremes: Option<(u32, u32)>,
    /// Intervals below 0.6 and above 1.6 times the mean of the pixel's first
    /// 16; `None` with fewer than 16.
    pub short_and_long: Option<(u32, u32)>,
    /// Intervals that are neither `floor(m)` nor `ceil(m)`. `None` with fewer
    /// than 16, or when `m` lies two readouts or more from the mean of the first 16.
    pub off_lattice: Option<u32>,
}

/// The two halves of a stream: maps over the band's pixels.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Halves {
    /// Time-based rates of the first and second half, spikes per readout. An
    /// interval across the split belongs to the second half.
    pub rate: [Vec<f64>; 2],
    /// Interval variances about the half's own mean, readouts squared.
    pub variance: [Vec<f64>; 2],
}

/// How the intervals that end at one readout deviate from their pixels' means.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Deviation {
    /// The readout.
    pub readout: u32,
    /// Mean deviation in readouts, less the mean over all readouts.
    pub mean: f64,
    /// The same in standard errors of that mean.
    pub sigmas: f64,
    /// Intervals that ended there.
    pub intervals: u32,
}

impl Intervals {
    /// Readouts that were measured.
    #[must_use]
    pub const fn readouts(&self) -> u32 {
        self.readouts
    }

    /// The lags in intervals, ascending, the first one 1.
    #[must_use]
    pub fn lags(&self) -> &[u32] {
        &self.lags
    }

    /// Pixels of the band.
    #[must_use]
    pub fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Whether there are no pixels; never so.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.pixels.is_empty()
    }

    /// Spikes of each pixel.
    pub(crate) fn spikes(&self) -> impl Iterator<Item = u32> {
        self.pixels.iter().map(|p| p.spikes)
    }

    /// The readouts of each pixel's first and last spike, or [`super::NEVER`] without one.
    pub(crate) fn ends(&self) -> impl Iterator<Item = (u32, u32)> {
        self.pixels.iter().zip(&self.latest).map(|(p, latest)| (p.first[0], latest[2]))
    }

    /// Number of intervals and their sum.
    pub(super) fn span(&self, p: usize) -> (u32, u32) {
        match self.pixels[p].spikes {
            0 => (0, 0),
            n => (n - 1, self.latest[p][2] - self.pixels[p].first[0]),
        }
    }

    /// The intervals of pixel `p` of the band.
    ///
    /// # Panics
    /// When `p` is not below [`Self::len`].
    #[must_use]
    pub fn pixel(&self, p: usize) -> PixelIntervals {
        let pixel = &self.pixels[p];
        let (intervals, sum) = self.span(p);
        let judged = pixel.reference > 0;
        PixelIntervals {
            intervals,
            sum: u64::from(sum),
            sum_squares: self.sums[p * self.lags.len()][1],
            extremes: (intervals > 0).then_some((pixel.shortest, pixel.longest)),
            short_and_long: judged.then_some((pixel.short, pixel.long)),
            off_lattice: judged.then(|| off_lattice(pixel, intervals, sum)).flatten(),
        }
    }

    /// Rates by time, `N / (t_N - t_0)`, in spikes per readout. The standard
    /// error is that of [`super::super::Counts::rate_by_time`].
    #[must_use]
    pub fn rate_by_time(&self) -> Vec<f64> {
        let rate = |p| match self.span(p) {
            (0, _) => f64::NAN,
            (n, sum) => f64::from(n) / f64::from(sum),
        };
        (0..self.len()).map(rate).collect()
    }

    /// How often each interval length occurs, over all pixels.
    #[must_use]
    pub const fn lengths(&self) -> &Lengths {
        &self.lengths
    }

    /// Share of the intervals below 0.6 and above 1.6 of the pixel's mean, the
    /// mean of its first 16 intervals, over `pixels` (all when `None`).
    /// Standard errors: spread of pixels about the ratio.
    #[must_use]
    pub fn short_and_long(&self, pixels: Option<&[usize]>) -> (Estimate, Estimate) {
        let share = |which: fn((u32, u32)) -> u32| {
            self.ratio(pixels, |p| {
                let view = self.pixel(p);
                view.short_and_long.map(|both| (f64::from(which(both)), f64::from(view.intervals)))
            })
        };
        (share(|both| both.0), share(|both| both.1))
    }

    /// Share of the intervals that are neither `floor(m)` nor `ceil(m)` of
    /// their pixel: 0 for an ideal integrator in constant light. Standard
    /// error: spread of pixels about the ratio.
    #[must_use]
    pub fn off_lattice(&self, pixels: Option<&[usize]>) -> Estimate {
        self.ratio(pixels, |p| {
            let view = self.pixel(p);
            view.off_lattice.map(|n| (f64::from(n), f64::from(view.intervals)))
        })
    }

    /// The halves of the stream, when [`super::super::MeasureOptions::split`] was set
    /// and reached.
    #[must_use]
    pub fn halves(&self) -> Option<Halves> {
        let split = self.split.as_ref()?;
        let half = |which: usize| {
            let both = (0..self.len()).map(|p| self.half(split, p, which));
            both.unzip()
        };
        let (first, second) = (half(0), half(1));
        Some(Halves { rate: [first.0, second.0], variance: [first.1, second.1] })
    }

    fn half(&self, split: &Snapshot, p: usize, which: usize) -> (f64, f64) {
        let early = match split.spikes[p] {
            0 => (0, 0),
            n => (n - 1, split.last[p] - self.pixels[p].first[0]),
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
        // Sum of squares about the mean is never negative (Cauchy).
        let variance = (n * squares - sum * sum) as f64 / (n * n) as f64;
        (n as f64 / sum as f64, variance)
    }

    /// Readout by readout, how the intervals that end there deviate from the
    /// mean of their pixel's first 16, for readouts with at least `least`
    /// intervals, of the first [`super::super::MeasureOptions::series_readouts`].
    ///
    /// In a static scene a lost readout shortens all intervals around it, and a
    /// repeated one splits or lengthens them. Standard error of a mean: the root of
    /// (mean interval variance / intervals).
    #[must_use]
    pub fn deviations(&self, least: u32) -> Vec<Deviation> {
        let enough = |d: &(usize, &DeviationSum)| d.1.spikes >= least.max(1);
        let (sum, n) =
            self.deviations.iter().fold((0, 0), |(sum, n), d| (sum + d.sum, n + u64::from(d.spikes)));
        let scale = 1.0 / REFERENCE as f64;
        let overall = sum as f64 * scale / n as f64;
        let variance = self.lag_variance(1, None).value;
        let kept = self.deviations.iter().enumerate().filter(enough);
        kept.map(|(readout, d)| {
            let mean = d.sum as f64 * scale / f64::from(d.spikes) - overall;
            Deviation {
                readout: readout as u32,
                mean,
                sigmas: mean / (variance / f64::from(d.spikes)).sqrt(),
                intervals: d.spikes,
            }
        })
        .collect()
    }

    /// The readouts of the most negative and most positive deviation, among
    /// those with at least half the median number of intervals.
    #[must_use]
    pub fn deviation_extremes(&self) -> Option<(Deviation, Deviation)> {
        let mut spikes: Vec<f64> = self.deviations.iter().map(|d| f64::from(d.spikes)).collect();
        let least = median(&mut spikes) / 2.0;
        let all = self.deviations(least.max(1.0) as u32);
        let order = |a: &&Deviation, b: &&Deviation| a.sigmas.total_cmp(&b.sigmas);
        Some((*all.iter().min_by(order)?, *all.iter().max_by(order)?))
    }

    /// Sum over sum over pixels; standard error from the spread of pixels,
    /// `sqrt(P/(P-1) sum (x - r y)^2) / sum y`.
    fn ratio(&self, pixels: Option<&[usize]>, of_pixel: impl Fn(usize) -> Option<(f64, f64)>) -> Estimate {
        let mut values = Vec::new();
        self.each(pixels, |p| values.extend(of_pixel(p)));
        let y: f64 = values.iter().map(|v| v.1).sum();
        let value = values.iter().map(|v| v.0).sum::<f64>() / y;
        let squares: f64 = values.iter().map(|(x, y)| (x - value * y).powi(2)).sum();
        let n = values.len() as f64;
        Estimate { value, error: (n / (n - 1.0) * squares).sqrt() / y, samples: values.len() }
    }

    /// Mean over pixels, with the standard error from their spread.
    pub(super) fn mean(&self, pixels: Option<&[usize]>, of_pixel: impl Fn(usize) -> f64) -> Estimate {
        let mut values = Vec::new();
        self.each(pixels, |p| values.push(of_pixel(p)));
        Estimate::mean(values)
    }

    pub(super) fn each(&self, pixels: Option<&[usize]>, mut visit: impl FnMut(usize)) {
        match pixels {
            Some(pixels) => pixels.iter().for_each(|p| visit(*p)),
            None => (0..self.len()).for_each(visit),
        }
    }

    /// Whether another band was measured with the same options.
    pub(crate) fn fits(&self, other: &Self) -> bool {
        self.lags == other.lags
            && self.lengths.cap() == other.lengths.cap()
            && self.split.is_some() == other.split.is_some()
            && self.deviations.len() == other.deviations.len()
    }

    /// Appends the band below; the caller has checked that they fit.
    pub(crate) fn append(&mut self, below: Self) {
        self.rows.end = below.rows.end;
        self.pixels.extend(below.pixels);
        self.sums.extend(below.sums);
        self.latest.extend(below.latest);
        self.lengths.merge(&below.lengths);
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

/// Intervals that are neither the floor nor the ceiling of the mean, when both
/// lie within the fences.
fn off_lattice(pixel: &Pixel, intervals: u32, sum: u32) -> Option<u32> {
    let (floor, ceil) = (sum / intervals, sum.div_ceil(intervals));
    let fence = |length: i64| {
        let j = length - (pixel.centre() - 3);
        usize::try_from(j).ok().filter(|j| *j < CUMULATIVE)
    };
    let below = fence(i64::from(floor) - 1)?;
    let within = fence(i64::from(ceil))?;
    Some(intervals - (pixel.within[within] - pixel.within[below]))
}

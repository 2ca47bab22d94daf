//! Contributions of each pixel to statistics that are means or shares over pixels.

use crate::{Intervals, Statistics};

/// A statistic that is a mean or a share over pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    MeanRate,
    Signal,
    /// `D(n)` at lag `n`.
    Variance(u32),
    PhaseNoise,
    Quantization,
    Autocovariance(usize),
    OffLattice,
    ShortIntervals,
    LongIntervals,
}

impl Quantity {
    /// Returns all quantities of a recording. `lags` are the measured lags.
    pub(super) fn all(lags: &[u32]) -> Vec<Self> {
        let mut all = vec![Self::MeanRate, Self::Signal];
        all.extend(lags.iter().map(|lag| Self::Variance(*lag)));
        all.extend([Self::PhaseNoise, Self::Quantization, Self::Autocovariance(1), Self::Autocovariance(2)]);
        all.extend([Self::OffLattice, Self::ShortIntervals, Self::LongIntervals]);
        all
    }

    /// Returns the key of the quantity in [`crate::statistics()`].
    pub(super) fn key(self) -> String {
        match self {
            Self::MeanRate => "mean-rate".to_owned(),
            Self::Signal => "signal".to_owned(),
            Self::Variance(lag) => format!("interval-variance-{lag}"),
            Self::PhaseNoise => "phase-noise".to_owned(),
            Self::Quantization => "quantization".to_owned(),
            Self::Autocovariance(lag) => format!("autocovariance-{lag}"),
            Self::OffLattice => "off-lattice".to_owned(),
            Self::ShortIntervals => "short-intervals".to_owned(),
            Self::LongIntervals => "long-intervals".to_owned(),
        }
    }

    /// Returns the number of intervals that a pixel needs in a part of a recording. A pixel with fewer intervals does not
    /// contribute to the scatter of this statistic.
    fn min_intervals(self, max_lag: u32) -> u32 {
        match self {
            Self::MeanRate => 0,
            Self::Signal => 1,
            Self::Variance(lag) => 2 * lag,
            // With fewer intervals, the fit for a part would use fewer lags than the fit for the whole recording.
            Self::PhaseNoise | Self::Quantization => 2 * max_lag,
            Self::Autocovariance(_) => 4,
            Self::OffLattice | Self::ShortIntervals | Self::LongIntervals => 16,
        }
    }

    /// Returns the contribution of each pixel to the statistic, and the value of the statistic.
    ///
    /// The contributions to a mean are the values of the pixels. [`Self::ratio_shares`] defines the contributions to a
    /// share. A contribution is NaN if the pixel has too few spikes. If `part` is true, a pixel also needs
    /// [`Self::min_intervals`] intervals.
    pub(super) fn pixel_shares(self, statistics: &Statistics, part: bool) -> (Vec<f64>, f64) {
        let pixels = statistics.geometry.pixels();
        let nothing = || (vec![f64::NAN; pixels], f64::NAN);
        let (Some(counts), Some(intervals)) = (&statistics.counts, &statistics.intervals) else {
            return nothing();
        };
        let max_lag = intervals.lags().last().copied().unwrap_or(1);
        let min_intervals = if part { self.min_intervals(max_lag) } else { 0 };
        let enough = |p: usize| counts.count[p].saturating_sub(1) >= min_intervals;
        let filtered = |map: Vec<f64>| -> Vec<f64> {
            map.iter().enumerate().map(|(p, x)| if enough(p) { *x } else { f64::NAN }).collect()
        };
        let map = match self {
            Self::MeanRate => counts.rate(),
            Self::Signal => filtered(counts.rate_by_time()),
            Self::Variance(lag) => filtered(intervals.lag_variance_map(lag)),
            Self::PhaseNoise => filtered(intervals.noise_map(0)),
            Self::Quantization => filtered(intervals.noise_map(1)),
            Self::Autocovariance(lag) => filtered(intervals.autocovariance_map(lag)),
            Self::OffLattice | Self::ShortIntervals | Self::LongIntervals => {
                return self.ratio_shares(intervals, &enough);
            }
        };
        let mean = mean(&map);
        (map, mean)
    }

    /// Returns the contributions to a ratio of sums, `r = X / Y`, and the ratio. `x` and `y` are what a pixel adds to `X`
    /// and to `Y`. The contribution of the pixel to the deviation of the ratio is `(x - r y) / mean(y)`.
    fn ratio_shares(self, intervals: &Intervals, enough: &dyn Fn(usize) -> bool) -> (Vec<f64>, f64) {
        let of_pixel = |p: usize| {
            let view = intervals.pixel(p);
            let part = match self {
                Self::OffLattice => view.off_lattice_count,
                Self::ShortIntervals => view.short_and_long_counts.map(|s| s.0),
                _ => view.short_and_long_counts.map(|s| s.1),
            };
            part.filter(|_| enough(p)).map(|n| (f64::from(n), f64::from(view.intervals)))
        };
        let all: Vec<Option<(f64, f64)>> = (0..intervals.len()).map(of_pixel).collect();
        let valid = all.iter().flatten();
        let (x, y, n) = valid.fold((0.0, 0.0, 0.0), |s, v| (s.0 + v.0, s.1 + v.1, s.2 + 1.0));
        let r = x / y;
        let map = all.iter().map(|v| v.map_or(f64::NAN, |(a, b)| (a - r * b) / (y / n))).collect();
        (map, r)
    }
}

/// Returns the mean of the finite entries of `map`.
pub(super) fn mean(map: &[f64]) -> f64 {
    let (sum, n) = map.iter().filter(|x| x.is_finite()).fold((0.0, 0.0), |(s, n), x| (s + x, n + 1.0));
    sum / n
}

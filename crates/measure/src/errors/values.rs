//! What each pixel adds to the statistics that are means, or shares, over pixels.

use crate::{Intervals, Statistics};

/// A statistic over pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    MeanRate,
    Signal,
    /// `D(n)` of this lag.
    Variance(u32),
    PhaseNoise,
    Quantisation,
    Autocovariance(usize),
    OffLattice,
    Short,
    Long,
}

impl Quantity {
    /// All of a recording measured at `lags`.
    pub(super) fn all(lags: &[u32]) -> Vec<Self> {
        let mut all = vec![Self::MeanRate, Self::Signal];
        all.extend(lags.iter().map(|lag| Self::Variance(*lag)));
        all.extend([Self::PhaseNoise, Self::Quantisation, Self::Autocovariance(1), Self::Autocovariance(2)]);
        all.extend([Self::OffLattice, Self::Short, Self::Long]);
        all
    }

    /// The key in [`crate::list`].
    pub(super) fn key(self) -> String {
        match self {
            Self::MeanRate => "mean-rate".to_owned(),
            Self::Signal => "signal".to_owned(),
            Self::Variance(lag) => format!("interval-variance-{lag}"),
            Self::PhaseNoise => "phase-noise".to_owned(),
            Self::Quantisation => "quantisation".to_owned(),
            Self::Autocovariance(apart) => format!("autocovariance-{apart}"),
            Self::OffLattice => "off-lattice".to_owned(),
            Self::Short => "short-intervals".to_owned(),
            Self::Long => "long-intervals".to_owned(),
        }
    }

    /// The intervals that a part of a recording must have of a pixel, to tell how this statistic scatters.
    fn least(self, longest: u32) -> u32 {
        match self {
            Self::MeanRate => 0,
            Self::Signal => 1,
            Self::Variance(lag) => 2 * lag,
            // With fewer, other lags are fitted than in the whole.
            Self::PhaseNoise | Self::Quantisation => 2 * longest,
            Self::Autocovariance(_) => 4,
            Self::OffLattice | Self::Short | Self::Long => 16,
        }
    }

    /// Each pixel's share in the statistic and the statistic itself, or the mean of the shares; NaN where a pixel tells nothing.
    ///
    /// A part of a recording wants more intervals than the whole ([`Self::least`]).
    pub(super) fn of(self, statistics: &Statistics, part: bool) -> (Vec<f64>, f64) {
        let pixels = statistics.geometry.pixels();
        let nothing = || (vec![f64::NAN; pixels], f64::NAN);
        let (Some(counts), Some(intervals)) = (&statistics.counts, &statistics.intervals) else {
            return nothing();
        };
        let longest = intervals.lags().last().copied().unwrap_or(1);
        let least = if part { self.least(longest) } else { 0 };
        let enough = |p: usize| counts.count[p].saturating_sub(1) >= least;
        let kept = |map: Vec<f64>| -> Vec<f64> {
            map.iter().enumerate().map(|(p, x)| if enough(p) { *x } else { f64::NAN }).collect()
        };
        let map = match self {
            Self::MeanRate => counts.rate(),
            Self::Signal => kept(counts.rate_by_time()),
            Self::Variance(lag) => kept(intervals.lag_variance_map(lag)),
            Self::PhaseNoise => kept(intervals.noise_map(0)),
            Self::Quantisation => kept(intervals.noise_map(1)),
            Self::Autocovariance(apart) => kept(intervals.autocovariance_map(apart)),
            Self::OffLattice | Self::Short | Self::Long => return self.shares(intervals, &enough),
        };
        let mean = mean(&map);
        (map, mean)
    }

    /// A ratio of sums, `r = X / Y`: a pixel adds `(x - r y) / mean y` to its deviation.
    fn shares(self, intervals: &Intervals, enough: &dyn Fn(usize) -> bool) -> (Vec<f64>, f64) {
        let of_pixel = |p: usize| {
            let view = intervals.pixel(p);
            let part = match self {
                Self::OffLattice => view.off_lattice,
                Self::Short => view.short_and_long.map(|s| s.0),
                _ => view.short_and_long.map(|s| s.1),
            };
            part.filter(|_| enough(p)).map(|n| (f64::from(n), f64::from(view.intervals)))
        };
        let all: Vec<Option<(f64, f64)>> = (0..intervals.len()).map(of_pixel).collect();
        let told = all.iter().flatten();
        let (x, y, n) = told.fold((0.0, 0.0, 0.0), |s, v| (s.0 + v.0, s.1 + v.1, s.2 + 1.0));
        let r = x / y;
        let map = all.iter().map(|v| v.map_or(f64::NAN, |(a, b)| (a - r * b) / (y / n))).collect();
        (map, r)
    }
}

/// Mean of the finite entries.
pub(super) fn mean(map: &[f64]) -> f64 {
    let (sum, n) = map.iter().filter(|x| x.is_finite()).fold((0.0, 0.0), |(s, n), x| (s + x, n + 1.0));
    sum / n
}

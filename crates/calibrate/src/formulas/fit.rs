//! The fitted line `x = a light + d` of one pixel, and the mathematics of fits.
//!
//! * `x`: charge per readout, in thresholds of the pixel.
//! * `light`: light level. Light 1 is full light and causes one spike per readout.
//! * `a`: gain in thresholds per readout at full light. `d`: dark rate in thresholds per readout.
//! * `f`: rate in spikes per readout, computed from the spike times of `N` intervals.
//! * `s`: phase variance per spike, in thresholds squared.
//! * `K`: quanta of light per spike.

use nalgebra::{DMatrix, DVector};

/// The noise of a rate `f` from `N` intervals. The variance of the rate is `f^2 s / N + f^4 / (6 N^2)`, where `s` is
/// the phase variance per spike.
///
/// The term `f^2 s / N` is the phase noise. The term `f^4 / (6 N^2)` is the rounding of the first and last spike to
/// whole readouts.
///
/// # Examples
/// ```
/// use spikelane_calibrate::RateWeighting;
/// // Without noise, only the rounding of spikes to readouts remains: f^4 / (6 N^2).
/// let noiseless = RateWeighting { threshold_variance: 0.0, light_variance: 0.0, dark_variance: 0.0 };
/// assert!((noiseless.variance(0.2, 100.0, 1.0) - 0.2f64.powi(4) / (6.0 * 100.0 * 100.0)).abs() < 1e-18);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateWeighting {
    /// Variance per spike that the threshold noise causes, in thresholds squared.
    pub threshold_variance: f64,
    /// Variance per spike that the quanta of light cause, in thresholds squared. It is `1 / K` for `K` quanta per
    /// spike.
    pub light_variance: f64,
    /// Variance per spike that the quanta of the dark current cause, in thresholds squared.
    pub dark_variance: f64,
}

impl RateWeighting {
    /// Returns the variance of a rate `f` that was computed from the spike times of `intervals` intervals. `lit` is the
    /// share of the charge that comes from light, 0 to 1.
    #[must_use]
    pub fn variance(&self, f: f64, intervals: f64, lit: f64) -> f64 {
        let lit = lit.clamp(0.0, 1.0);
        let s = self.threshold_variance + self.light_variance * lit + self.dark_variance * (1.0 - lit);
        f * f * s / intervals + (f * f / intervals).powi(2) / 6.0
    }
}

/// Returns a corrected rate. The rate `f` was computed from the spike times of `intervals` intervals. The rounding of
/// the first and the last spike to readouts causes a bias of `f`.
///
/// A spike is read up to one readout after the charge crosses the threshold. For the first and the last spike of a
/// window, this delay is not uniformly distributed. Write the period as `1/f = k + r` with `k` whole readouts and a
/// remainder `r`. The first crossing is uniform over one period after the start, and the last crossing is uniform over
/// one period before the end. The remainder of `r` readouts favors late first crossings and early last crossings. The
/// time from the first to the last spike is therefore too short by `f r (1 - r)` readouts on average. The bias is up to
/// 0.4 standard errors of a single rate. It is equal for all pixels of a level.
#[must_use]
pub(crate) fn correct_end_bias(f: f64, intervals: f64) -> f64 {
    let r = (1.0 / f).fract();
    f / (1.0 + f * f * r * (1.0 - r) / intervals)
}

/// The fitted line of one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct PixelFit {
    /// Gain in thresholds per readout at full light.
    pub a: f64,
    /// Dark rate in thresholds per readout.
    pub d: f64,
    /// Variance of `a`.
    pub var_a: f64,
    /// Variance of `d`.
    pub var_d: f64,
    /// Covariance of `a` and `d`.
    pub cov: f64,
    /// Sum of the squared residuals, each divided by its variance.
    pub chi2: f64,
    /// Number of used levels minus 2.
    pub degrees_of_freedom: u32,
    /// Whether the fit of least absolute residuals replaced the weighted fit.
    pub is_robust: bool,
    /// Changes of `a` and `d` if the unknown threshold of the pixel changes by its standard deviation.
    pub threshold_sensitivity: [f64; 2],
}

impl PixelFit {
    /// Returns chi-square divided by the median of its distribution (cube root of Wilson and Hilferty). Returns `None` if
    /// there is no degree of freedom.
    pub(crate) fn chi2_ratio(&self) -> Option<f64> {
        let n = f64::from(self.degrees_of_freedom);
        (self.degrees_of_freedom > 0 && self.chi2.is_finite())
            .then(|| self.chi2 / n / (1.0 - 2.0 / (9.0 * n)).powi(3))
    }

    /// Returns whether chi-square exceeds its expectation by more than five standard deviations (Wilson and Hilferty).
    /// `scale` is the ratio of the typical chi-square of a pixel to its expectation.
    pub(crate) fn is_poor_fit(&self, scale: f64) -> bool {
        if self.degrees_of_freedom < 2 {
            return false;
        }
        let n = f64::from(self.degrees_of_freedom);
        let c = 2.0 / (9.0 * n);
        ((self.chi2 / n / scale).cbrt() - 1.0 + c) / c.sqrt() > 5.0
    }

    /// The fit of a pixel that could not be fitted. All values are NaN.
    pub const NAN: Self = Self {
        a: f64::NAN,
        d: f64::NAN,
        var_a: f64::NAN,
        var_d: f64::NAN,
        cov: f64::NAN,
        chi2: f64::NAN,
        degrees_of_freedom: 0,
        is_robust: false,
        threshold_sensitivity: [0.0; 2],
    };
}

/// Fits a line to points `(light, x, variance)` by weighted least squares. Returns `None` if the points have fewer than
/// two different light levels.
///
/// # Examples
/// ```
/// use spikelane_calibrate::fit_line;
/// // Points (light, charge per readout, variance) on the line x = 0.9 light + 0.01.
/// let line = |light: f64| (light, 0.9 * light + 0.01, 1e-6);
/// let fit = fit_line(&[0.0, 0.3, 0.6].map(line)).expect("three light levels");
/// assert!((fit.a - 0.9).abs() < 1e-9 && (fit.d - 0.01).abs() < 1e-9);
/// assert_eq!(fit.degrees_of_freedom, 1);
/// assert!(fit_line(&[line(0.3), line(0.3)]).is_none());
/// ```
#[must_use]
pub fn fit_line(points: &[(f64, f64, f64)]) -> Option<PixelFit> {
    let (mut s0, mut s1, mut s2, mut y0, mut y1) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (m, x, v) in points {
        let w = 1.0 / v;
        s0 += w;
        s1 += w * m;
        s2 += w * m * m;
        y0 += w * x;
        y1 += w * m * x;
    }
    let det = s0 * s2 - s1 * s1;
    if points.len() < 2 || det <= 1e-9 * s0 * s2 {
        return None;
    }
    let (a, d) = ((s0 * y1 - s1 * y0) / det, (s2 * y0 - s1 * y1) / det);
    let chi2 = points.iter().map(|(m, x, v)| (x - a * m - d).powi(2) / v).sum();
    let freedom = points.len() as u32 - 2;
    Some(PixelFit {
        a,
        d,
        var_a: s0 / det,
        var_d: s2 / det,
        cov: -s1 / det,
        chi2,
        degrees_of_freedom: freedom,
        is_robust: false,
        threshold_sensitivity: [0.0; 2],
    })
}

/// Returns the line `(a, d)` with the least sum of weighted absolute residuals for points `(light, x, variance)`.
///
/// The line is an exact optimum, because an optimum of this linear program passes through two of the points. The points
/// are few enough to try all pairs. Returns `None` if the points have fewer than two different light levels.
///
/// # Examples
/// ```
/// use spikelane_calibrate::fit_line_least_absolute;
/// // One of four points is wrong. The line passes through the others.
/// let points = [(0.0, 0.0, 1.0), (0.25, 0.5, 1.0), (0.5, 7.0, 1.0), (1.0, 2.0, 1.0)];
/// assert_eq!(fit_line_least_absolute(&points), Some((2.0, 0.0)));
/// ```
#[must_use]
pub fn fit_line_least_absolute(points: &[(f64, f64, f64)]) -> Option<(f64, f64)> {
    let mut best: Option<(f64, f64, f64)> = None;
    for (i, p) in points.iter().enumerate() {
        for q in points[i + 1..].iter().filter(|q| q.0 != p.0) {
            let a = (q.1 - p.1) / (q.0 - p.0);
            let d = p.1 - a * p.0;
            let sum: f64 = points.iter().map(|(m, x, v)| (x - a * m - d).abs() / v.sqrt()).sum();
            if best.is_none_or(|b| sum < b.0) {
                best = Some((sum, a, d));
            }
        }
    }
    best.map(|(_, a, d)| (a, d))
}

/// Solves `h x = g` for a symmetric, positive definite `k` x `k` matrix `h`.
///
/// Returns `x` and the diagonal of the inverse of `h`, or `None` if `h` is not positive definite.
pub(crate) fn solve_cholesky(h: &[f64], g: &[f64], k: usize) -> Option<(Vec<f64>, Vec<f64>)> {
    let factor = DMatrix::from_row_slice(k, k, h).cholesky()?;
    let solution = factor.solve(&DVector::from_column_slice(g));
    Some((solution.as_slice().to_vec(), factor.inverse().diagonal().as_slice().to_vec()))
}

/// Returns the limit of chi-square over its degrees of freedom that corresponds to the normal quantile `z`, by the cube root
/// of Wilson and Hilferty.
///
/// The upper limit with a probability of 0.001 (`z` = 3.09) is 3 % too large for one degree of freedom and 0.6 % for ten. A
/// lower limit needs at least three.
#[must_use]
pub fn chi_square_over_freedom(freedom: f64, z: f64) -> f64 {
    let c = 2.0 / (9.0 * freedom);
    (1.0 - c + z * c.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corrected_rate_of_an_integrator_is_unbiased() {
        // The test computes the mean over all start phases of an integrator with rate 0.7 in 100 readouts. Without the
        // correction the mean rate is too high by 1.7e-3.
        let (rate, readouts, phases) = (0.7_f64, 100, 10_000);
        let (mut uncorrected, mut corrected) = (0.0, 0.0);
        for i in 0..phases {
            let start = (f64::from(i) + 0.5) / f64::from(phases);
            let fires = |t: &i32| {
                let before = (start + rate * f64::from(*t)).floor();
                (start + rate * f64::from(t + 1)).floor() > before
            };
            let times: Vec<i32> = (0..readouts).filter(fires).collect();
            let intervals = times.len() as f64 - 1.0;
            let f = intervals / f64::from(times[times.len() - 1] - times[0]);
            uncorrected += f / rate - 1.0;
            corrected += correct_end_bias(f, intervals) / rate - 1.0;
        }
        let n = f64::from(phases);
        assert!((uncorrected / n - 1.7e-3).abs() < 2e-4, "{}", uncorrected / n);
        assert!((corrected / n).abs() < 1e-4, "{}", corrected / n);
    }

    #[test]
    fn one_wild_level_does_not_move_the_least_absolute_line() {
        let mut points: Vec<_> =
            (0..8).map(|k| (f64::from(k) / 8.0, 0.9 * f64::from(k) / 8.0 + 0.01, 1e-8)).collect();
        points[5].1 += 0.3;
        let (a, d) = fit_line_least_absolute(&points).unwrap();
        assert!((a - 0.9).abs() < 1e-12 && (d - 0.01).abs() < 1e-12);
        assert!((fit_line(&points).unwrap().a - 0.9).abs() > 0.01);
    }

    /// Limits of the tables: 10.828 and 29.588 at 0.001, and 0.352 and 3.940 at 0.95.
    #[test]
    fn limits_are_those_of_tables() {
        for (freedom, z, limit, tolerance) in [
            (1.0, 3.0902, 10.828, 0.04),
            (10.0, 3.0902, 29.588, 0.007),
            (3.0, -1.6449, 0.352, 0.07),
            (10.0, -1.6449, 3.940, 0.003),
        ] {
            let found = freedom * chi_square_over_freedom(freedom, z);
            assert!((found / limit - 1.0_f64).abs() < tolerance, "{freedom} {z}: {found}");
        }
    }
}

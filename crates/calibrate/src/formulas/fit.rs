//! The line `x = a light + d` of one pixel.

/// What determines the weight of a rate: `var f = f^2 s / N + f^4 / (6 N^2)` for `N`
/// intervals, phase noise `s` per spike and the quantisation of the two ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighting {
    /// Variance per spike, in thresholds squared, of threshold noise.
    pub threshold: f64,
    /// Variance per spike of the light's quanta, `1 / K`.
    pub light: f64,
    /// Variance per spike of the dark current's quanta.
    pub dark: f64,
}

impl Weighting {
    /// Variance of a time-based rate `f` over `intervals` intervals; `lit` is the share of
    /// the charge that light brought.
    #[must_use]
    pub fn variance(&self, f: f64, intervals: f64, lit: f64) -> f64 {
        let lit = lit.clamp(0.0, 1.0);
        let s = self.threshold + self.light * lit + self.dark * (1.0 - lit);
        f * f * s / intervals + (f * f / intervals).powi(2) / 6.0
    }
}

/// A time-based rate `f` over `intervals` intervals without the bias of its ends.
///
/// The first spike of a window lies up to one readout behind its crossing of the threshold, and the
/// last one too, but not evenly: crossings are uniform over one period `1/f = k + r` after the start and
/// before the end, and the odd `r` readouts belong to late crossings at the start and to early
/// ones at the end. The span is short by `f r (1 - r)`, which is up to 0.4 standard errors of a single rate
/// and the same for all pixels of a level.
#[must_use]
pub(crate) fn without_end_bias(f: f64, intervals: f64) -> f64 {
    let r = (1.0 / f).fract();
    f / (1.0 + f * f * r * (1.0 - r) / intervals)
}

/// One pixel's line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct PixelFit {
    /// Thresholds per readout at full-scale light.
    pub a: f64,
    /// Thresholds per readout in the dark.
    pub d: f64,
    /// Variance of `a`.
    pub var_a: f64,
    /// Variance of `d`.
    pub var_d: f64,
    /// Covariance of `a` and `d`.
    pub cov: f64,
    /// Sum of squared residuals over their variances.
    pub chi2: f64,
    /// Levels used, less two.
    pub freedom: u32,
    /// Whether the least-absolute fit replaced the weighted one.
    pub robust: bool,
    /// How far `a` and `d` move when the pixel's unknown threshold moves by its standard deviation.
    pub by_threshold: [f64; 2],
}

impl PixelFit {
    /// Chi-square over the median of its law (Wilson and Hilferty's cube root); `None` without a degree of freedom.
    pub(crate) fn misfit(&self) -> Option<f64> {
        let n = f64::from(self.freedom);
        (self.freedom > 0 && self.chi2.is_finite()).then(|| self.chi2 / n / (1.0 - 2.0 / (9.0 * n)).powi(3))
    }

    /// Whether the chi-square is beyond five deviations (Wilson and Hilferty), where that of the typical pixel is `scale` times
    /// what it should be.
    pub(crate) fn is_misfit(&self, scale: f64) -> bool {
        if self.freedom < 2 {
            return false;
        }
        let n = f64::from(self.freedom);
        let c = 2.0 / (9.0 * n);
        ((self.chi2 / n / scale).cbrt() - 1.0 + c) / c.sqrt() > 5.0
    }

    /// A pixel that could not be fitted: NaN.
    pub const UNKNOWN: Self = Self {
        a: f64::NAN,
        d: f64::NAN,
        var_a: f64::NAN,
        var_d: f64::NAN,
        cov: f64::NAN,
        chi2: f64::NAN,
        freedom: 0,
        robust: false,
        by_threshold: [0.0; 2],
    };
}

/// Weighted least squares over `(light, x, variance)`; `None` below two different levels.
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
        freedom,
        robust: false,
        by_threshold: [0.0; 2],
    })
}

/// The line of least weighted absolute residuals, exactly: an optimum of this linear
/// program passes through two of the points, and there are few enough to try all pairs.
#[must_use]
pub fn least_absolute(points: &[(f64, f64, f64)]) -> Option<(f64, f64)> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_by_time_of_an_integrator_has_no_bias_left() {
        // All start phases of an integrator of rate 0.7 in 100 readouts: by time alone 1.7e-3 too fast.
        let (rate, readouts, phases) = (0.7_f64, 100, 10_000);
        let (mut plain, mut corrected) = (0.0, 0.0);
        for i in 0..phases {
            let start = (f64::from(i) + 0.5) / f64::from(phases);
            let fires = |t: &i32| {
                let before = (start + rate * f64::from(*t)).floor();
                (start + rate * f64::from(t + 1)).floor() > before
            };
            let times: Vec<i32> = (0..readouts).filter(fires).collect();
            let intervals = times.len() as f64 - 1.0;
            let f = intervals / f64::from(times[times.len() - 1] - times[0]);
            plain += f / rate - 1.0;
            corrected += without_end_bias(f, intervals) / rate - 1.0;
        }
        let n = f64::from(phases);
        assert!((plain / n - 1.7e-3).abs() < 2e-4, "{}", plain / n);
        assert!((corrected / n).abs() < 1e-4, "{}", corrected / n);
    }

    #[test]
    fn one_wild_level_does_not_move_the_least_absolute_line() {
        let mut points: Vec<_> =
            (0..8).map(|k| (f64::from(k) / 8.0, 0.9 * f64::from(k) / 8.0 + 0.01, 1e-8)).collect();
        points[5].1 += 0.3;
        let (a, d) = least_absolute(&points).unwrap();
        assert!((a - 0.9).abs() < 1e-12 && (d - 0.01).abs() < 1e-12);
        assert!((fit_line(&points).unwrap().a - 0.9).abs() > 0.01);
    }
}

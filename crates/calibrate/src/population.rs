//! Means and spreads of a population of pixels. The noise of the estimates is subtracted from the spreads.

use serde::Serialize;

use crate::formulas::fit::PixelFit;
use spikelane_measure::Estimate;

/// Moments over the pixels. Each moment has a standard error.
///
/// # Examples
/// ```
/// use spikelane_calibrate::{Population, fit_line};
/// // Two pixels whose gains are 0.9 and 1.1.
/// let fits = [0.9, 1.1].map(|a| fit_line(&[(0.0, 0.0, 1e-9), (1.0, a, 1e-9)]).expect("two light levels"));
/// let population = Population::from_fits(fits.iter());
/// assert!((population.mean_a.value - 1.0).abs() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct Population {
    /// Mean of the gain `a`, in thresholds per readout at full light.
    pub mean_a: Estimate,
    /// Standard deviation of `a`.
    pub sd_a: Estimate,
    /// Mean of the dark rate `d`, in thresholds per readout.
    pub mean_d: Estimate,
    /// Standard deviation of `d`.
    pub sd_d: Estimate,
    /// Covariance of `a` and `d`, divided by the product of their means.
    pub covariance: Estimate,
    /// Relative spread of the threshold `phi`. If the data do not determine the spread, the error is an upper bound.
    pub sigma_phi: Estimate,
}

impl Population {
    /// Returns the moments of the fits whose `a` and `d` are finite.
    ///
    /// The standard errors are those of a sample of `n` pixels: `sd / sqrt(n)` for a mean and
    /// `sqrt((m4 - v^2) / n) / (2 sd)` for a standard deviation. Here `v = sd^2` is the variance and `m4` the fourth
    /// central moment.
    #[must_use]
    pub fn from_fits<'a>(fits: impl Iterator<Item = &'a PixelFit> + Clone) -> Self {
        let good = fits.filter(|f| f.a.is_finite() && f.d.is_finite());
        let mean_a = Estimate::mean(good.clone().map(|f| f.a));
        let mean_d = Estimate::mean(good.clone().map(|f| f.d));
        let (ma, md) = (mean_a.value, mean_d.value);
        let products = || good.clone().map(|f| (f.a - ma) * (f.d - md) - f.cov);
        let covariance = Estimate::mean(products());
        let scale = 1.0 / (ma * md);
        let covariance = Estimate {
            value: covariance.value * scale,
            error: covariance.error * scale.abs(),
            samples: covariance.samples,
        };
        Self {
            sd_a: corrected_spread(good.clone().map(|f| (f.a - ma, f.var_a))),
            sd_d: corrected_spread(good.map(|f| (f.d - md, f.var_d))),
            mean_a,
            mean_d,
            covariance,
            sigma_phi: threshold_spread(covariance),
        }
    }

    /// Adds the errors that all pixels share. `scale` is the relative error of the scale of the light. `shift` is the
    /// error of the zero point of the light.
    pub(super) fn add_shared_errors(&mut self, scale: f64, shift: f64) {
        for e in [&mut self.mean_a, &mut self.sd_a] {
            e.error = e.error.hypot(scale * e.value);
        }
        self.mean_d.error = self.mean_d.error.hypot(self.mean_a.value * shift);
        self.sd_d.error = self.sd_d.error.hypot(self.sd_a.value * shift);
    }
}

/// Returns the square root of the mean of `x^2 - variance`. This is the spread without the variance of the estimates.
fn corrected_spread(deviations: impl Iterator<Item = (f64, f64)>) -> Estimate {
    let mean = Estimate::mean(deviations.map(|(x, v)| x * x - v));
    let value = mean.value.max(0.0).sqrt();
    let error = if value > 0.0 { mean.error / (2.0 * value) } else { mean.error.sqrt() };
    Estimate { value, error, samples: mean.samples }
}

/// Returns the relative spread `s` of the thresholds, computed from the relative covariance of `a = g/phi` and
/// `d = D/phi`.
///
/// `g` is the gain and `D` the dark current, in nominal thresholds per readout. `g`, `D` and the threshold `phi` are
/// independent of each other. The relative covariance of `a` and `d` is then `E(1/phi^2) / E(1/phi)^2 - 1`. For a
/// normal `phi` it is `s^2 + 6 s^4` plus terms of the sixth power.
///
/// If the covariance does not exceed its own error, the returned error is an upper bound. The value is still computed
/// from the covariance. It is 0 if the covariance is negative.
#[must_use]
pub fn threshold_spread(covariance: Estimate) -> Estimate {
    let c = covariance.value;
    let square = if c > 0.0 { ((1.0 + 24.0 * c).sqrt() - 1.0) / 12.0 } else { 0.0 };
    let value = square.sqrt();
    let error = if c > covariance.error { covariance.error / (2.0 * value) } else { covariance.error.sqrt() };
    Estimate { value, error, samples: covariance.samples }
}

/// Returns the mean and the standard deviation of the finite entries.
pub(super) fn mean_and_sd(map: &[f64]) -> (f64, f64) {
    let all = Estimate::mean(map.iter().copied());
    (all.value, all.error * (all.samples as f64).sqrt())
}

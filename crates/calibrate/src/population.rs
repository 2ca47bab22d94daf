//! The population of pixels: means and spreads with the noise of estimation taken out.

use serde::Serialize;

use crate::formulas::fit::PixelFit;
use spikelane_measure::Estimate;

/// Moments over the pixels, each with its standard error.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct Population {
    /// Mean of `a`.
    pub mean_a: Estimate,
    /// Standard deviation of `a`.
    pub sd_a: Estimate,
    /// Mean of `d`, thresholds per readout.
    pub mean_d: Estimate,
    /// Standard deviation of `d`.
    pub sd_d: Estimate,
    /// Covariance of `a` and `d`, over the product of their means.
    pub covariance: Estimate,
    /// Relative spread of the threshold `phi`; its error is infinite where nothing tells it.
    pub sigma_phi: Estimate,
}

impl Population {
    /// Moments of the fits whose `a` and `d` are finite.
    ///
    /// Standard errors are those of a sample of pixels: `sd / sqrt(n)` of a mean,
    /// `sqrt((m4 - v^2) / n) / (2 sd)` of a standard deviation.
    #[must_use]
    pub fn of<'a>(fits: impl Iterator<Item = &'a PixelFit> + Clone) -> Self {
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
            sd_a: spread(good.clone().map(|f| (f.a - ma, f.var_a))),
            sd_d: spread(good.map(|f| (f.d - md, f.var_d))),
            mean_a,
            mean_d,
            covariance,
            sigma_phi: threshold_spread(covariance),
        }
    }

    /// Adds to the errors what all pixels share: the relative error of the light's scale, and the error of its shift.
    pub(super) fn widen(&mut self, scale: f64, shift: f64) {
        for e in [&mut self.mean_a, &mut self.sd_a] {
            e.error = e.error.hypot(scale * e.value);
        }
        self.mean_d.error = self.mean_d.error.hypot(self.mean_a.value * shift);
        self.sd_d.error = self.sd_d.error.hypot(self.sd_a.value * shift);
    }
}

/// Root of the mean of `x^2 - variance`.
fn spread(deviations: impl Iterator<Item = (f64, f64)>) -> Estimate {
    let mean = Estimate::mean(deviations.map(|(x, v)| x * x - v));
    let value = mean.value.max(0.0).sqrt();
    let error = if value > 0.0 { mean.error / (2.0 * value) } else { mean.error.sqrt() };
    Estimate { value, error, samples: mean.samples }
}

/// The relative spread of thresholds from the relative covariance of `a = g/phi` and
/// `d = D/phi` with independent gains and currents: `cov = E(1/phi^2) / E(1/phi)^2 - 1`, which is
/// `s^2 + 6 s^4` for a normal `phi` of relative spread `s`, up to the sixth power.
///
/// Where the covariance is not above zero by its own error, the value is that of
/// the covariance or 0, and the error that of an upper bound.
#[must_use]
pub fn threshold_spread(covariance: Estimate) -> Estimate {
    let c = covariance.value;
    let square = if c > 0.0 { ((1.0 + 24.0 * c).sqrt() - 1.0) / 12.0 } else { 0.0 };
    let value = square.sqrt();
    let error = if c > covariance.error { covariance.error / (2.0 * value) } else { covariance.error.sqrt() };
    Estimate { value, error, samples: covariance.samples }
}

/// Mean and standard deviation of the finite entries.
pub(super) fn mean_and_sd(map: &[f64]) -> (f64, f64) {
    let all = Estimate::mean(map.iter().copied());
    (all.value, all.error * (all.samples as f64).sqrt())
}

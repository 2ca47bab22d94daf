//! Limits of the light that reaches the sensor in the dark recording.
//!
//! Shot noise of such light looks like threshold noise, and the mean light looks like dark current. Let the light be `L` and let a
//! nominal pixel need `K` quanta per spike. A pixel with the gain `a`, the rate `x` and the charge `q` of a quantum has the
//! variance per spike `V = sigma^2 u + (L / K) h` with `h = q a / x`. Here `u` is the variance per spike for `sigma^2 = 1`.
//! Three properties of the pixels limit `L / K`:
//!
//! * **Variance.** Light adds more variance to pixels with a lower dark rate, because `h` is larger. The weighted line of `V`
//!   through `u` and `h` has the slope `L / K`.
//! * **Single intervals.** If noise is redrawn at every readout, the variance of single intervals shows `sigma^2` without shot
//!   noise. The redraw share is then below 1 by the share of the shot noise.
//! * **Rate.** The dark rate `d` of a pixel contains the light, so `L` is at most `d / a`.
//!
//! Without light, both threshold noise and quanta keep their values. With the largest light, threshold noise is lower and the
//! variance of a quantum higher. The stated errors cover both cases.

use super::state::{DarkLightRange, Fitter, VarianceGrowth};
use crate::formulas::fit::PixelFit;
use crate::recordings::observations::Flicker;
use spikelane::pixel::NoiseSampling;
use spikelane_measure::Estimate;

/// Share of the pixels whose dark rate may be below the rate that light causes, for example because of a fault.
const EXCEPTION_SHARE: f64 = 0.005;

/// Smallest part of the variance of the threshold noise for which a note is added. It changes the noise by a twentieth.
const MIN_NOTED_SHARE: f64 = 0.1;

/// The variance per spike of a dark pixel, with its expected parts.
pub(super) struct DarkVariance {
    pub(super) weight: f64,
    /// Measured variance per spike, in squared thresholds.
    pub(super) variance: f64,
    /// Variance for `sigma^2 = 1`.
    pub(super) threshold: f64,
    /// Variance for `L / K = 1`.
    pub(super) light: f64,
}

/// Returns the slope `L / K` of the weighted line. The standard error is computed from the residuals.
pub(super) fn light_slope(pixels: &[DarkVariance]) -> Estimate {
    let sum = |term: &dyn Fn(&DarkVariance) -> f64| pixels.iter().map(|p| p.weight * term(p)).sum::<f64>();
    let tt = sum(&|p| p.threshold * p.threshold);
    let tl = sum(&|p| p.threshold * p.light);
    let ll = sum(&|p| p.light * p.light);
    let tv = sum(&|p| p.threshold * p.variance);
    let lv = sum(&|p| p.light * p.variance);
    let determinant = tt * ll - tl * tl;
    let value = (tt * lv - tl * tv) / determinant;
    let square = (ll * tv - tl * lv) / determinant;
    let influence = |p: &DarkVariance| {
        let residual = p.variance - square * p.threshold - value * p.light;
        p.weight * (tt * p.light - tl * p.threshold) * residual / determinant
    };
    let error = pixels.iter().map(|p| influence(p).powi(2)).sum::<f64>().sqrt();
    Estimate { value, error, samples: pixels.len() }
}

impl Fitter<'_> {
    /// Returns the largest light that the dark recording may contain: with few exceptions, no pixel has a lower dark rate than
    /// this light causes. It is infinite before the first fit.
    fn max_dark_light(&self) -> f64 {
        let limit = |f: &PixelFit| (f.d.max(0.0) + 2.0 * f.var_d.sqrt()) / f.a;
        let mut limits: Vec<f64> = self.fits.iter().map(limit).filter(|l| l.is_finite()).collect();
        limits.sort_by(f64::total_cmp);
        limits.get((EXCEPTION_SHARE * limits.len() as f64) as usize).copied().unwrap_or(f64::INFINITY)
    }

    /// Returns the changes for the largest light in the dark. `square` is the variance of the threshold noise without such
    /// light, and `quanta` the variance per spike that quanta of light cause.
    pub(super) fn dark_light_range(
        &self,
        dark: &VarianceGrowth,
        lit: &[VarianceGrowth],
        square: f64,
        quanta: Estimate,
    ) -> DarkLightRange {
        let of_threshold = dark.dark_light_coefficient / dark.threshold_coefficient;
        let (mut of_quanta, mut weight) = (0.0, 0.0);
        for g in lit {
            let w = (g.light_coefficient / g.variance_per_spike.error).powi(2);
            of_quanta +=
                w * (of_threshold * g.threshold_coefficient - g.dark_light_coefficient) / g.light_coefficient;
            weight += w;
        }
        let of_quanta = of_quanta / weight;
        let slope = dark.dark_light_slope;
        let by_variance = slope.value.max(0.0) + 1.96 * slope.error;
        // `L = (L / K) K`, and `1 / K` is `quanta + of_quanta (L / K)`.
        let light = self.max_dark_light();
        let by_rate = match 1.0 - light * of_quanta {
            share if share > 0.0 => light * (quanta.value + 1.96 * quanta.error).max(0.0) / share,
            _ => f64::INFINITY,
        };
        let shot_share = match self.noise.noise_sampling {
            NoiseSampling::EveryReadout if self.redraw_share.error.is_finite() => {
                let share = self.redraw_share;
                (1.0 - share.value + self.redraw_flicker).max(0.0) + 1.96 * share.error
            }
            _ => 1.0,
        };
        let largest = by_variance.min(by_rate).min(shot_share.min(1.0) * square / of_threshold);
        if !largest.is_finite() {
            return DarkLightRange::default();
        }
        DarkLightRange {
            max_light: light.min(largest / (quanta.value - 1.96 * quanta.error).max(0.0)),
            threshold_variance: of_threshold * largest,
            quanta_variance: of_quanta.max(0.0) * largest,
        }
    }

    /// Returns the variance of an interval, in readouts squared, that light in the dark recording may cause if it flickers like
    /// the lamps. `rate` is the dark rate of the pixel.
    ///
    /// A sinusoid of amplitude `m` and angular frequency `w` changes an interval `T` by the difference of two values of its
    /// integral. The mean square of this difference is `(m / w)^2 (1 - cos(w T))`.
    pub(super) fn flicker_excess(&self, rate: f64) -> f64 {
        let lit = self.observed.levels.iter().filter(|l| l.light > 0.0);
        let excess = |flicker: Flicker| {
            let w = std::f64::consts::TAU * flicker.frequency_hz / self.observed.readout_hz;
            let depth = flicker.depth * (self.dark_light.max_light / rate).min(1.0);
            (depth / w).powi(2) * (1.0 - libm::cos(w / rate))
        };
        lit.filter_map(|l| l.flicker).map(excess).fold(0.0, f64::max)
    }

    /// Adds a note if shot noise of light in the dark recording may have a large part of the threshold noise.
    pub(super) fn note_dark_light(&mut self) {
        let light = self.dark_light.max_light;
        if self.dark_light.threshold_variance < MIN_NOTED_SHARE * self.noise.threshold_variance {
            return;
        }
        self.notes.push(format!(
            "The dark recording may contain light, at most {light:.1e} of full light: no pixel has a lower dark rate, and pixels with little dark current do not have more noise. The shot noise of such light looks like threshold noise. The errors of threshold noise and electrons include it."
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line through the coefficients has residuals of 0. Residuals of `+-0.1` that are orthogonal to both coefficients keep the
    /// slope and give it an error.
    #[test]
    fn the_slope_is_that_of_the_pixels_with_more_light() {
        let pixel = |light: f64, residual: f64| DarkVariance {
            weight: 2.0,
            variance: 3.0 + 0.5 * light + residual,
            threshold: 1.0,
            light,
        };
        let exact = light_slope(&[1.0, 2.0, 4.0].map(|light| pixel(light, 0.0)));
        assert!((exact.value - 0.5).abs() < 1e-12 && exact.error < 1e-12, "{exact:?}");
        let scattered =
            light_slope(&[(1.0, 0.1), (1.0, -0.1), (3.0, 0.1), (3.0, -0.1)].map(|(l, r)| pixel(l, r)));
        // The influence of a pixel is its residual times its distance of 1 from the mean, divided by the sum of squares, 4.
        assert!((scattered.value - 0.5).abs() < 1e-12, "{scattered:?}");
        assert!((scattered.error - 0.05).abs() < 1e-12, "{scattered:?}");
    }
}

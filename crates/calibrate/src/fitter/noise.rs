//! Estimates threshold noise and quanta from the growth of the variance of spike times.
//!
//! * `sigma`: standard deviation of the threshold noise of a nominal pixel, in thresholds.
//! * `K`: quanta of light per spike of a nominal pixel.

use super::state::Fitter;
use crate::formulas::phase::{interval_growth_ratio, mean_draw_ratio};
use crate::formulas::selection;
use crate::recordings::observations::LightLevel;
use spikelane::pixel::NoiseSampling;
use spikelane::sensor::Sensor;
use spikelane::unstable::threads;
use spikelane_measure::{Estimate, median, median_and_spread};

/// The growth of the interval variance of a level, and the contributions of the noise sources to this growth.
struct VarianceGrowth {
    /// Phase variance per spike, in squared thresholds of the pixel itself.
    variance_per_spike: Estimate,
    /// Variance per spike that `sigma^2 = 1` would cause, where `sigma` is the noise of a nominal pixel.
    threshold_coefficient: f64,
    /// Variance per spike that `1 / K = 1` would cause.
    light_coefficient: f64,
}

impl Fitter<'_> {
    /// Estimates threshold noise and quanta from the interval variance. Dark levels contain no quanta of light. Dim levels
    /// contain both kinds of noise.
    pub(super) fn measure_noise(&mut self) {
        selection::prepare_tables();
        // Hot pixels have the most intervals in the dark, but their noise is not typical.
        let defect_free = self.defect_free_mask();
        let (mut dark, mut lit) = (None, Vec::new());
        // A drift of 1 % doubles the variance of spans of 16 intervals. It would be mistaken for quanta.
        for level in self.observed.levels.iter().filter(|l| !l.drifts()) {
            let Some(mean) = self.variance_growth(level, &defect_free) else { continue };
            if level.light == 0.0 { dark = Some(mean) } else { lit.push(mean) }
        }
        // `excess` subtracts the threshold noise from the variance of each dim level and returns the weighted mean of the rest.
        let excess = |square: f64| {
            let of_level = |g: &VarianceGrowth| {
                (
                    (g.variance_per_spike.value - square * g.threshold_coefficient) / g.light_coefficient,
                    g.variance_per_spike.error / g.light_coefficient,
                )
            };
            let terms = lit.iter().map(of_level);
            let (sum, weight) = terms.fold((0.0, 0.0), |(a, w), (v, e)| (a + v / (e * e), w + 1.0 / (e * e)));
            Estimate { value: sum / weight, error: weight.sqrt().recip(), samples: lit.len() }
        };
        let nominal = Sensor::electrons_from_fc(self.sensor.capacitance_ff * self.sensor.swing_v);
        match dark {
            Some(VarianceGrowth { variance_per_spike: s, threshold_coefficient: threshold, .. })
                if s.value > 0.0 =>
            {
                let square = s.value / threshold;
                let quanta = excess(square);
                let same = quanta.value < 3.0 * quanta.error.hypot(s.error);
                if self.noise.noise_sampling == NoiseSampling::EveryReset && same && !lit.is_empty() {
                    self.noise.inverse_dark_quanta = 1.0 / nominal;
                    self.noise.inverse_light_quanta = 1.0 / nominal;
                    self.set_noise((square - 1.0 / nominal).max(0.0), s.error / threshold);
                    self.electrons = Estimate { value: nominal, error: f64::NAN, samples: 0 };
                } else {
                    self.noise.inverse_dark_quanta = 0.0;
                    self.set_noise(square, s.error / threshold);
                    self.set_quanta(quanta, s.error / threshold, nominal);
                }
            }
            _ => self.assume_nominal_noise(&lit, nominal),
        }
        self.phase_corrections =
            threads::map(&self.observed.levels, |level| self.draw_phase_correction(level));
    }

    /// Returns a correction factor for correlated phases, at the median rate of a level. It multiplies the rate that
    /// low threshold draws add.
    ///
    /// The factor is the mean over all periods. It is therefore applied only if the periods of the pixels differ by
    /// half a readout or more. In brighter light the factor is 1, because low draws then add only a ten-thousandth of
    /// the rate.
    fn draw_phase_correction(&self, level: &LightLevel) -> f64 {
        let fitted =
            level.rate.iter().zip(&self.fits).filter(|(rate, fit)| **rate > 0.0 && fit.d.is_finite());
        let mut rates: Vec<f64> = fitted.map(|(rate, _)| *rate).collect();
        if self.noise.noise_sampling == NoiseSampling::EveryReset
            || rates.len() < 16
            || self.noise.threshold_variance <= 0.0
        {
            return 1.0;
        }
        let (f, spread) = median_and_spread(&mut rates);
        if spread < 0.5 * f * f {
            return 1.0;
        }
        let sigma = self.noise.threshold_variance.sqrt();
        let x = self.increment(f, sigma);
        let mut dark: Vec<f64> = self.fits.iter().map(|fit| fit.d).filter(|d| d.is_finite()).collect();
        let lit = if level.light == 0.0 { 0.0 } else { (1.0 - median(&mut dark) / f).max(0.0) };
        ratio_or_one(mean_draw_ratio(sigma / x, (lit * self.noise.inverse_light_quanta).sqrt() / x))
    }

    fn set_noise(&mut self, square: f64, error: f64) {
        self.noise.threshold_variance = square;
        let value = square.sqrt();
        let error = if value > 0.0 || error.is_nan() { error / (2.0 * value) } else { error.sqrt() };
        self.sigma_t = Estimate { value, error, samples: self.fits.len() };
    }

    fn set_quanta(&mut self, quanta: Estimate, dark_error: f64, nominal: f64) {
        let error = quanta.error.hypot(dark_error);
        if quanta.value > 3.0 * error {
            self.noise.inverse_light_quanta = quanta.value;
            let value = 1.0 / quanta.value;
            self.electrons = Estimate { value, error: value * value * error, samples: quanta.samples };
        } else {
            self.noise.inverse_light_quanta = 1.0 / nominal;
            self.electrons = Estimate { value: nominal, error: f64::NAN, samples: 0 };
        }
    }

    /// Returns the variance of the thermal noise of the nominal capacitor at room temperature, divided by the squared
    /// threshold.
    pub(super) fn nominal_noise_variance(&self) -> f64 {
        let square = spikelane::units::BOLTZMANN_J_PER_K * 293.0 / (self.sensor.capacitance_ff * 1e-15);
        square / self.sensor.swing_v.powi(2)
    }

    /// Estimates threshold noise without the variance of dark intervals. The quanta are assumed to be those of the nominal
    /// circuit. The remaining variance is attributed to threshold noise.
    fn assume_nominal_noise(&mut self, lit: &[VarianceGrowth], nominal: f64) {
        self.electrons = Estimate { value: nominal, error: f64::NAN, samples: 0 };
        self.noise.inverse_light_quanta = 1.0 / nominal;
        match lit.first() {
            Some(g) => {
                // An error of the assumed quanta changes the threshold noise by an unknown amount, so the error of the
                // threshold noise is NaN.
                self.set_noise(
                    ((g.variance_per_spike.value - g.light_coefficient / nominal) / g.threshold_coefficient)
                        .max(0.0),
                    f64::NAN,
                );
            }
            None => {
                self.noise.threshold_variance = self.nominal_noise_variance();
                self.sigma_t =
                    Estimate { value: self.noise.threshold_variance.sqrt(), error: f64::NAN, samples: 0 };
            }
        }
    }

    fn variance_growth(&self, level: &LightLevel, defect_free: &[bool]) -> Option<VarianceGrowth> {
        let map = &level.interval_noise.as_ref()?.map;
        // The variance of a pixel's estimate decreases as its number of intervals grows. With few intervals it decreases
        // faster, because few intervals hardly separate the growth from the constant.
        let weight = |p: usize| match f64::from(level.spikes[p]) {
            n if n < 32.0 => (n - 4.0).max(0.0).powi(2) / 28.0,
            n => n - 4.0,
        };
        let good: Vec<usize> = (0..map.len())
            .filter(|p| defect_free[*p] && map[*p].is_finite() && level.rate[*p] < 0.2)
            .collect();
        let total: f64 = good.iter().map(|p| weight(*p)).sum();
        if good.len() < 16 || total <= 0.0 {
            return None;
        }
        // The first guess attributes half of the mean to threshold noise.
        let raw = good.iter().map(|p| weight(*p) * map[*p]).sum::<f64>() / total;
        let mut square = if self.noise.threshold_variance > 0.0 {
            self.noise.threshold_variance
        } else {
            0.5 * raw.max(1e-12)
        };
        let (mut mean, mut unit) = (raw, 1.0);
        // A dark level contains only threshold noise. Its variance is refined in each iteration, so dark levels need
        // more iterations.
        for _ in 0..if level.light == 0.0 { 8 } else { 1 } {
            let of_pixel = |p: &usize| {
                let [charge, unit] = self.unit_noise_means(*p, level.rate[*p], square.sqrt());
                [weight(*p) * map[*p] * charge, weight(*p) * unit]
            };
            // The terms are added in the order of the pixels, so the sum does not depend on the number of threads.
            let each: Vec<[f64; 2]> = threads::map(&good, of_pixel);
            [mean, unit] = [0, 1].map(|i| each.iter().map(|both| both[i]).sum::<f64>() / total);
            if level.light == 0.0 {
                square = (mean / unit).max(1e-16);
            }
        }
        let squares = good.iter().map(|p| (weight(*p) * (map[*p] - raw)).powi(2)).sum::<f64>();
        let of_light =
            |p: &usize| weight(*p) * self.light_share(*p, level, level.rate[*p]) * self.quantum(*p);
        let light = good.iter().map(of_light).sum::<f64>() / total;
        let ratio = self.growth_phase_correction(level, &good, square.sqrt(), light);
        let s = Estimate { value: mean / ratio, error: squares.sqrt() / total / ratio, samples: good.len() };
        Some(VarianceGrowth { variance_per_spike: s, threshold_coefficient: unit, light_coefficient: light })
    }

    /// Returns a correction factor for correlated phases, at the median rate of the pixels `good`. It divides the
    /// growth of the interval variance of a level.
    ///
    /// The correction is 0.1 % at 24 readouts per spike, 0.4 % at 12 and 1 % at 8. It varies little from pixel to pixel,
    /// so all pixels use the same value.
    fn growth_phase_correction(&self, level: &LightLevel, good: &[usize], sigma: f64, light: f64) -> f64 {
        let lags = level.interval_noise.as_ref().map_or(&[][..], |noise| &noise.lags);
        if self.noise.noise_sampling == NoiseSampling::EveryReset || lags.len() < 2 {
            return 1.0;
        }
        let mut rates: Vec<f64> = good.iter().map(|p| level.rate[*p]).collect();
        let x = self.increment(median(&mut rates), sigma);
        ratio_or_one(interval_growth_ratio(
            sigma / x,
            (light * self.noise.inverse_light_quanta).max(0.0).sqrt() / x,
            lags,
        ))
    }

    /// Returns two means over the posterior of a pixel's threshold, by three-point Gauss-Hermite quadrature.
    ///
    /// The first mean is the squared ratio of the increment to the rate `f`. It converts the variance of a span from
    /// readouts to charge. The increment is smaller than the rate, because low draws save charge (0.5 % in the dark). The
    /// second mean is the variance of the charge per spike for `sigma^2 = 1`, in the pixel's own thresholds squared.
    fn unit_noise_means(&self, p: usize, f: f64, sigma: f64) -> [f64; 2] {
        let at = |phi: f64| {
            let relative_sigma = sigma / phi;
            let x = self.increment(f, relative_sigma);
            [(x / f).powi(2), self.variance_share(x, relative_sigma) / (phi * phi)]
        };
        self.mean_over_threshold(p, at).map(|(mean, _)| mean)
    }
}

/// Returns `ratio` if it is plausible, otherwise 1. `ratio` is a quantity for correlated phases divided by the same
/// quantity for independent phases. If the noise is too small for the integrals, the computed ratio can be implausible.
fn ratio_or_one(ratio: f64) -> f64 {
    if (0.5..2.0).contains(&ratio) { ratio } else { 1.0 }
}

//! Estimates threshold noise and quanta from the growth of the variance of spike times.
//!
//! * `sigma`: standard deviation of the threshold noise of a nominal pixel, in thresholds.
//! * `K`: quanta of light per spike of a nominal pixel.

use super::dark_light::{DarkVariance, light_slope};
use super::state::{DarkLightRange, Fitter, VarianceGrowth, ZERO_ESTIMATE};
use crate::formulas::phase::{interval_growth_ratio, mean_draw_ratio};
use crate::formulas::selection::{self, redraw_end_variance};
use crate::recordings::observations::{LightLevel, MAX_GROWTH_RATE};
use spikelane::pixel::NoiseSampling;
use spikelane::sensor::Sensor;
use spikelane::unstable::threads;
use spikelane_measure::{Estimate, median, median_and_spread};

/// Largest part of a change of the light that remains after its removal. The filter of the frame totals transmits the change
/// without loss at low frequencies, and the dark rates of the pixels are known to a percent.
const MAX_REMAINING_CHANGE: f64 = 0.02;

/// Smallest significant difference between the shot noise of light and of dark current, in standard errors. If the standard
/// error is correct, one choice in thirty thousand is wrong.
const SHOT_NOISE_Z_THRESHOLD: f64 = 4.0;

/// Largest plausible number of electrons per threshold, divided by that of the nominal circuit.
const MAX_RELATIVE_ELECTRONS: f64 = 4.0;

/// Returns the relative inverse variance of the interval noise of a pixel.
///
/// The variance of an estimate decreases as its number of intervals grows. With few intervals it decreases faster, because
/// few intervals hardly separate the growth from the constant.
fn growth_precision(level: &LightLevel, p: usize) -> f64 {
    match f64::from(level.spikes[p]) {
        n if n < 32.0 => (n - 4.0).max(0.0).powi(2) / 28.0,
        n => n - 4.0,
    }
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
        for (k, level) in self.observed.levels.iter().enumerate().filter(|(_, l)| !l.has_unsteady_intervals())
        {
            let Some(mean) = self.variance_growth(k, &defect_free) else { continue };
            if level.light == 0.0 { dark = Some(mean) } else { lit.push(mean) }
        }
        // `excess` subtracts the threshold noise from the variance of each dim level and returns the weighted mean of the
        // rest. `square_error` is the error of the variance of the threshold noise, which all levels share.
        let excess = |square: f64, square_error: f64| {
            let (mut sum, mut shared, mut weight) = (0.0, 0.0, 0.0);
            for g in &lit {
                let w = (g.light_coefficient / g.variance_per_spike.error).powi(2);
                sum +=
                    w * (g.variance_per_spike.value - square * g.threshold_coefficient) / g.light_coefficient;
                shared += w * square_error * g.threshold_coefficient / g.light_coefficient;
                weight += w;
            }
            Estimate {
                value: sum / weight,
                error: weight.sqrt().recip().hypot(shared / weight),
                samples: lit.len(),
            }
        };
        let [nominal, photons] = self.nominal_quanta();
        self.dark_light = DarkLightRange::default();
        match dark {
            Some(dark) if dark.variance_per_spike.value > 0.0 => {
                let square = dark.variance_per_spike.value / dark.threshold_coefficient;
                let square_error = dark.variance_per_spike.error / dark.threshold_coefficient;
                let quanta = excess(square, square_error);
                let shot = 1.0 / nominal;
                let frozen = self.noise.noise_sampling == NoiseSampling::EveryReset;
                let reach = SHOT_NOISE_Z_THRESHOLD * quanta.error;
                let has_quiet_dark = quanta.value > reach;
                if frozen && !has_quiet_dark {
                    // Without shot noise of the dark current, `quanta` would be the variance of a plausible quantum or more.
                    let is_certain = quanta.value + reach < 1.0 / (MAX_RELATIVE_ELECTRONS * photons);
                    let value = (square - shot).max(0.0);
                    let above = if is_certain { 0.0 } else { square - value };
                    self.noise.inverse_dark_quanta = shot;
                    self.assume_quanta(photons);
                    self.set_noise(value, square_error, [0.0, above]);
                } else {
                    let range = self.dark_light_range(&dark, &lit, square, quanta);
                    self.dark_light = range;
                    self.noise.inverse_dark_quanta = 0.0;
                    // The largest light is itself a limit of an estimate, so both parts are added in squares.
                    let random = 1.96 * square_error;
                    let below = range.threshold_variance.hypot(random) - random;
                    self.set_noise(square, square_error, [below, 0.0]);
                    self.set_quanta(quanta, range.quanta_variance, photons);
                }
            }
            _ => self.assume_nominal_noise(&lit, photons),
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

    /// Sets the threshold noise from the estimate of its variance. `range` contains how far below and above the estimate the
    /// variance can be for other reasons than its random error, such as shot noise in the dark. The 95 % interval of the
    /// noise covers the square roots of both ends.
    fn set_noise(&mut self, square: f64, error: f64, range: [f64; 2]) {
        self.noise.threshold_variance = square;
        let value = square.sqrt();
        let end = |change: f64| ((square + change).max(0.0).sqrt() - value).abs() / 1.96;
        let error = match error.is_nan() {
            true => f64::NAN,
            false => end(-range[0] - 1.96 * error).max(end(range[1] + 1.96 * error)),
        };
        self.sigma_t = Estimate { value, error, samples: self.fits.len() };
    }

    /// Returns the electrons per threshold of the nominal circuit, and the photons at full light that cause as many
    /// electrons in a pixel with the mean gain.
    pub(super) fn nominal_quanta(&self) -> [f64; 2] {
        let electrons = Sensor::electrons_from_fc(self.sensor.capacitance_ff * self.sensor.swing_v);
        let relative = |p: usize| self.shape.relative_fit(p, &self.fits[p]).a;
        let mut gains: Vec<f64> = (0..self.fits.len()).map(relative).filter(|a| a.is_finite()).collect();
        let gain = if gains.is_empty() { 1.0 } else { median(&mut gains) };
        [electrons, electrons * gain]
    }

    /// Assumes a number of photons at full light.
    pub(super) fn assume_quanta(&mut self, photons: f64) {
        self.noise.inverse_light_quanta = 1.0 / photons;
        self.electrons = Estimate { value: photons, error: f64::NAN, samples: 0 };
    }

    /// Sets the quanta of light from the variance per spike that they cause. This variance can be higher by `above` for other
    /// reasons than its random error.
    fn set_quanta(&mut self, quanta: Estimate, above: f64, nominal: f64) {
        if quanta.value > 3.0 * quanta.error {
            self.noise.inverse_light_quanta = quanta.value;
            let value = 1.0 / quanta.value;
            let error = value * value * quanta.error.hypot(above / 1.96);
            self.electrons = Estimate { value, error, samples: quanta.samples };
        } else {
            self.assume_quanta(nominal);
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
        self.assume_quanta(nominal);
        match lit.first() {
            Some(g) => {
                // An error of the assumed quanta changes the threshold noise by an unknown amount, so the error of the
                // threshold noise is NaN.
                self.set_noise(
                    ((g.variance_per_spike.value - g.light_coefficient / nominal) / g.threshold_coefficient)
                        .max(0.0),
                    f64::NAN,
                    [0.0; 2],
                );
            }
            None => {
                self.noise.threshold_variance = self.nominal_noise_variance();
                self.sigma_t =
                    Estimate { value: self.noise.threshold_variance.sqrt(), error: f64::NAN, samples: 0 };
            }
        }
    }

    fn variance_growth(&self, k: usize, defect_free: &[bool]) -> Option<VarianceGrowth> {
        let level = &self.observed.levels[k];
        let map = &level.interval_noise.as_ref()?.map;
        let weight = |p: usize| self.noise_weights[k][p] * growth_precision(level, p);
        let good: Vec<usize> = (0..map.len())
            .filter(|p| defect_free[*p] && map[*p].is_finite() && level.rate[*p] < MAX_GROWTH_RATE)
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
        let (mut mean, mut unit, mut each) = (raw, 1.0, Vec::new());
        // A dark level contains only threshold noise. Its variance is refined in each iteration, so dark levels need
        // more iterations.
        for _ in 0..if level.light == 0.0 { 8 } else { 1 } {
            let of_pixel = |p: &usize| {
                let [charge, unit] = self.unit_noise_means(*p, level.rate[*p], square.sqrt());
                [weight(*p) * map[*p] * charge, weight(*p) * unit]
            };
            // The terms are added in the order of the pixels, so the sum does not depend on the number of threads.
            each = threads::map(&good, of_pixel);
            [mean, unit] = [0, 1].map(|i| each.iter().map(|both: &[f64; 2]| both[i]).sum::<f64>() / total);
            if level.light == 0.0 {
                square = (mean / unit).max(1e-16);
            }
        }
        let squares = good.iter().map(|p| (weight(*p) * (map[*p] - raw)).powi(2)).sum::<f64>();
        let of_light =
            |p: &usize| weight(*p) * self.light_share(*p, level, level.rate[*p]) * self.quantum(*p);
        let light = good.iter().map(of_light).sum::<f64>() / total;
        let of_dark_light = |p: &usize| {
            let a = self.fits[*p].a;
            if a.is_finite() { self.quantum(*p) * a / level.rate[*p] } else { 0.0 }
        };
        let dark_light = good.iter().map(|p| weight(*p) * of_dark_light(p)).sum::<f64>() / total;
        let ratio = self.growth_phase_correction(level, &good, square.sqrt(), light);
        let dark_light_slope = match level.light == 0.0 {
            true => {
                let of_pixel = |(p, [variance, threshold]): (&usize, &[f64; 2])| {
                    let (weight, light) = (weight(*p), of_dark_light(p));
                    DarkVariance {
                        weight,
                        variance: variance / weight / ratio,
                        threshold: threshold / weight,
                        light,
                    }
                };
                let used = good.iter().zip(&each).filter(|(p, _)| weight(**p) > 0.0);
                light_slope(&used.map(of_pixel).collect::<Vec<_>>())
            }
            false => ZERO_ESTIMATE,
        };
        // If the rate rises linearly by the share `rise`, a span of `n` intervals has the variance `(n rise)^2 / 12`.
        let of_drift =
            square_growth(&level.interval_noise.as_ref()?.lags) / 12.0 * level.undetected_rise_variance();
        let remaining = MAX_REMAINING_CHANGE.powi(2) * level.removed_variance;
        let error = (squares.sqrt() / total / ratio).hypot(of_drift).hypot(remaining);
        let s = Estimate { value: mean / ratio, error, samples: good.len() };
        Some(VarianceGrowth {
            variance_per_spike: s,
            threshold_coefficient: unit,
            light_coefficient: light,
            dark_light_coefficient: dark_light,
            dark_light_slope,
        })
    }

    /// Estimates the share of the threshold noise that is redrawn at every readout, from the variance of single dark
    /// intervals. Call this method while the noise is redrawn at every readout.
    ///
    /// Let `e` be the end variance of a pixel in readouts squared. Noise that is constant between resets only rounds both
    /// ends to whole readouts, so `e` is 1/6. Noise that is redrawn at every readout adds `Q`, because a pixel fires at a
    /// low draw and keeps the charge that this draw saved. The share is the slope of `e - 1/6` over `Q`. It does not depend
    /// on the light or on the gains.
    pub(super) fn measure_redraw_share(&mut self) {
        selection::prepare_tables();
        let defect_free = self.defect_free_mask();
        let (k, level) = (0, &self.observed.levels[0]);
        let Some(noise) =
            level.interval_noise.as_ref().filter(|_| level.light == 0.0 && !level.has_unsteady_intervals())
        else {
            return;
        };
        let sigma = self.noise.threshold_variance.sqrt();
        let is_used = |p: &usize| {
            defect_free[*p] && noise.end_variance[*p].is_finite() && level.rate[*p] < MAX_GROWTH_RATE
        };
        let used: Vec<usize> = (0..self.fits.len()).filter(is_used).collect();
        struct Sample {
            /// Weight of the pixel in the slope.
            weight: f64,
            redrawn: f64,
            /// `e - 1/6`.
            excess: f64,
            /// Weight of the pixel in the estimate of the threshold noise.
            growth_weight: f64,
            growth: f64,
            /// Measured growth minus `growth`.
            growth_residual: f64,
            /// Largest excess that a flicker of light in the dark causes.
            flicker: f64,
        }
        let of_pixel = |p: &usize| {
            let f = level.rate[*p];
            let at = |phi: f64| {
                let relative_sigma = sigma / phi;
                let x = self.increment(f, relative_sigma);
                let growth = relative_sigma * relative_sigma * self.variance_share(x, relative_sigma);
                [redraw_end_variance(x / relative_sigma), growth]
            };
            let [(redrawn, _), (growth, _)] = self.mean_over_threshold(*p, at);
            let (rounding, regular) = (1.0 / 6.0, self.noise_weights[k][*p]);
            let variance = growth / (f * f) + rounding + redrawn;
            Sample {
                weight: regular * f64::from(level.spikes[*p] - 1) / (variance * variance),
                redrawn,
                excess: noise.end_variance[*p] - rounding,
                growth_weight: regular * growth_precision(level, *p),
                growth,
                growth_residual: noise.map[*p] - growth,
                flicker: self.flicker_excess(f),
            }
        };
        let samples: Vec<Sample> = threads::map(&used, of_pixel);
        let sum = |term: &dyn Fn(&Sample) -> f64| samples.iter().map(term).sum::<f64>();
        let total = sum(&|s| s.weight * s.redrawn * s.redrawn);
        let value = sum(&|s| s.weight * s.redrawn * s.excess) / total;
        let all_growth = sum(&|s| s.growth_weight * s.growth);
        // The error of `Q` follows from the error of the threshold noise. `Q` is nearly proportional to the variance of the
        // noise. If a pixel has too large a growth, its end variance is too small, so both errors are correlated.
        let influence = |s: &Sample| {
            s.weight * s.redrawn * (s.excess - value * s.redrawn) / total
                - value * s.growth_weight * s.growth_residual / all_growth
        };
        let error = sum(&|s| influence(s).powi(2)).sqrt();
        if value.is_finite() && error.is_finite() {
            self.redraw_share = Estimate { value, error, samples: samples.len() };
            // The share is inversely proportional to the variance of the threshold noise.
            let kept = 1.0 - self.dark_light.threshold_variance / self.noise.threshold_variance;
            let above = value.max(0.0) * (1.0 / kept - 1.0);
            self.redraw_flicker = sum(&|s| s.weight * s.redrawn * s.flicker) / total;
            self.redraw_share_error = (error + above.max(self.redraw_flicker) / 1.96) / kept;
        }
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

/// Returns the slope of the line that is fitted to the squares of the lags.
fn square_growth(lags: &[u32]) -> f64 {
    let lags = || lags.iter().map(|l| f64::from(*l));
    let mean = lags().sum::<f64>() / lags().count() as f64;
    let slope =
        lags().map(|l| (l - mean) * l * l).sum::<f64>() / lags().map(|l| (l - mean).powi(2)).sum::<f64>();
    if slope.is_finite() { slope } else { 0.0 }
}

/// Returns `ratio` if it is plausible, otherwise 1. `ratio` is a quantity for correlated phases divided by the same
/// quantity for independent phases. If the noise is too small for the integrals, the computed ratio can be implausible.
fn ratio_or_one(ratio: f64) -> f64 {
    if (0.5..2.0).contains(&ratio) { ratio } else { 1.0 }
}

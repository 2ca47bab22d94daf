//! Threshold noise and quanta, from how the variance of spike times grows.

use super::state::Fitter;
use crate::formulas::phase::{draw_ratio, growth_ratio};
use crate::formulas::selection;
use crate::result::Redrawn;
use crate::sets::observed::Level;
use spikelane::sensor::Sensor;
use spikelane::unstable::threads;
use spikelane_measure::{Estimate, median, median_and_spread};

/// What the interval variance of a level says.
struct Growth {
    /// Phase variance per spike, in the pixels' own thresholds.
    s: Estimate,
    /// What one unit of a nominal pixel's `sigma^2` gives in its place.
    threshold: f64,
    /// What one unit of `1 / K` gives.
    light: f64,
}

impl Fitter<'_> {
    /// Threshold noise and quanta from interval variance: dark levels have no light's
    /// quanta, dim ones have both.
    pub(super) fn measure_noise(&mut self) {
        selection::prepare();
        // A hot pixel has the most intervals of all in the dark, and noise of its own.
        let usual = self.usual();
        let (mut dark, mut lit) = (None, Vec::new());
        // A drift of 1 % doubles the variance of spans of 16 intervals: it would pass for quanta.
        for level in self.observed.levels.iter().filter(|l| !l.drifts()) {
            let Some(mean) = self.level_noise(level, &usual) else { continue };
            if level.light == 0.0 { dark = Some(mean) } else { lit.push(mean) }
        }
        // Weighted mean over the dim levels of what thresholds leave to the quanta.
        let excess = |square: f64| {
            let of_level = |g: &Growth| ((g.s.value - square * g.threshold) / g.light, g.s.error / g.light);
            let terms = lit.iter().map(of_level);
            let (sum, weight) = terms.fold((0.0, 0.0), |(a, w), (v, e)| (a + v / (e * e), w + 1.0 / (e * e)));
            Estimate { value: sum / weight, error: weight.sqrt().recip(), samples: lit.len() }
        };
        let nominal = Sensor::electrons(self.sensor.capacitance_ff * self.sensor.swing_v);
        match dark {
            Some(Growth { s, threshold, .. }) if s.value > 0.0 => {
                let square = s.value / threshold;
                let quanta = excess(square);
                let same = quanta.value < 3.0 * quanta.error.hypot(s.error);
                if self.noise.redrawn == Redrawn::EveryReset && same && !lit.is_empty() {
                    self.noise.dark = 1.0 / nominal;
                    self.noise.light = 1.0 / nominal;
                    self.set_noise((square - 1.0 / nominal).max(0.0), s.error / threshold);
                    self.electrons = Estimate { value: nominal, error: f64::NAN, samples: 0 };
                } else {
                    self.noise.dark = 0.0;
                    self.set_noise(square, s.error / threshold);
                    self.set_quanta(quanta, s.error / threshold, nominal);
                }
            }
            _ => self.assume_noise(&lit, nominal),
        }
        self.remembered = threads::map(&self.observed.levels, |level| self.remembered_draws(level));
    }

    /// What remembered phases make of the rate that low draws add, at a level's median rate. It is the mean over all periods, so
    /// it serves where the pixels' periods differ by half a readout and more; elsewhere the rate that is added is a ten-thousandth.
    fn remembered_draws(&self, level: &Level) -> f64 {
        let fitted =
            level.rate.iter().zip(&self.fits).filter(|(rate, fit)| **rate > 0.0 && fit.d.is_finite());
        let mut rates: Vec<f64> = fitted.map(|(rate, _)| *rate).collect();
        if self.noise.redrawn == Redrawn::EveryReset || rates.len() < 16 || self.noise.square <= 0.0 {
            return 1.0;
        }
        let (f, spread) = median_and_spread(&mut rates);
        if spread < 0.5 * f * f {
            return 1.0;
        }
        let sigma = self.noise.square.sqrt();
        let x = self.increment(f, sigma);
        let mut dark: Vec<f64> = self.fits.iter().map(|fit| fit.d).filter(|d| d.is_finite()).collect();
        let lit = if level.light == 0.0 { 0.0 } else { (1.0 - median(&mut dark) / f).max(0.0) };
        plausible(draw_ratio(sigma / x, (lit * self.noise.light).sqrt() / x))
    }

    fn set_noise(&mut self, square: f64, error: f64) {
        self.noise.square = square;
        let value = square.sqrt();
        let error = if value > 0.0 || error.is_nan() { error / (2.0 * value) } else { error.sqrt() };
        self.sigma_t = Estimate { value, error, samples: self.fits.len() };
    }

    fn set_quanta(&mut self, quanta: Estimate, dark_error: f64, nominal: f64) {
        let error = quanta.error.hypot(dark_error);
        if quanta.value > 3.0 * error {
            self.noise.light = quanta.value;
            let value = 1.0 / quanta.value;
            self.electrons = Estimate { value, error: value * value * error, samples: quanta.samples };
        } else {
            self.noise.light = 1.0 / nominal;
            self.electrons = Estimate { value: nominal, error: f64::NAN, samples: 0 };
        }
    }

    /// The nominal capacitor's thermal noise at room temperature, over the square of the threshold.
    pub(super) fn nominal_square(&self) -> f64 {
        let square = spikelane::units::BOLTZMANN_J_PER_K * 293.0 / (self.sensor.capacitance_ff * 1e-15);
        square / self.sensor.swing_v.powi(2)
    }

    /// Without the variance of dark intervals: the quanta of the nominal circuit, and what remains.
    fn assume_noise(&mut self, lit: &[Growth], nominal: f64) {
        self.electrons = Estimate { value: nominal, error: f64::NAN, samples: 0 };
        self.noise.light = 1.0 / nominal;
        match lit.first() {
            Some(g) => {
                // As far from the truth as the assumed quanta are: its error is not known.
                self.set_noise(((g.s.value - g.light / nominal) / g.threshold).max(0.0), f64::NAN);
            }
            None => {
                self.noise.square = self.nominal_square();
                self.sigma_t = Estimate { value: self.noise.square.sqrt(), error: f64::NAN, samples: 0 };
            }
        }
    }

    fn level_noise(&self, level: &Level, usual: &[bool]) -> Option<Growth> {
        let map = &level.noise.as_ref()?.map;
        // The variance of a pixel's estimate falls with the number of its intervals; of few, it falls
        // faster, as they tell growth badly from the constant.
        let weight = |p: usize| match f64::from(level.spikes[p]) {
            n if n < 32.0 => (n - 4.0).max(0.0).powi(2) / 28.0,
            n => n - 4.0,
        };
        let good: Vec<usize> =
            (0..map.len()).filter(|p| usual[*p] && map[*p].is_finite() && level.rate[*p] < 0.2).collect();
        let total: f64 = good.iter().map(|p| weight(*p)).sum();
        if good.len() < 16 || total <= 0.0 {
            return None;
        }
        // Half of the mean is noise, before anything is known.
        let raw = good.iter().map(|p| weight(*p) * map[*p]).sum::<f64>() / total;
        let mut square = if self.noise.square > 0.0 { self.noise.square } else { 0.5 * raw.max(1e-12) };
        let (mut mean, mut unit) = (raw, 1.0);
        // More rounds where the level is dark, and its noise is the threshold's alone.
        for _ in 0..if level.light == 0.0 { 8 } else { 1 } {
            let of_pixel = |p: &usize| {
                let [charge, unit] = self.unit_noise(*p, level.rate[*p], square.sqrt());
                [weight(*p) * map[*p] * charge, weight(*p) * unit]
            };
            // Added in the pixels' order: a sum must not depend on which thread took what.
            let each: Vec<[f64; 2]> = threads::map(&good, of_pixel);
            [mean, unit] = [0, 1].map(|i| each.iter().map(|both| both[i]).sum::<f64>() / total);
            if level.light == 0.0 {
                square = (mean / unit).max(1e-16);
            }
        }
        let squares = good.iter().map(|p| (weight(*p) * (map[*p] - raw)).powi(2)).sum::<f64>();
        let of_light = |p: &usize| weight(*p) * self.lit(*p, level, level.rate[*p]) * self.quantum(*p);
        let light = good.iter().map(of_light).sum::<f64>() / total;
        let ratio = self.remembered_growth(level, &good, square.sqrt(), light);
        let s = Estimate { value: mean / ratio, error: squares.sqrt() / total / ratio, samples: good.len() };
        Some(Growth { s, threshold: unit, light })
    }

    /// What remembered phases make of the growth of a level's variance, at the median rate of `good`: 0.1 % at 24
    /// readouts a spike, 0.4 % at 12 and 1 % at 8. It changes so little from pixel to pixel that one for all will do.
    fn remembered_growth(&self, level: &Level, good: &[usize], sigma: f64, light: f64) -> f64 {
        let lags = level.noise.as_ref().map_or(&[][..], |noise| &noise.lags);
        if self.noise.redrawn == Redrawn::EveryReset || lags.len() < 2 {
            return 1.0;
        }
        let mut rates: Vec<f64> = good.iter().map(|p| level.rate[*p]).collect();
        let x = self.increment(median(&mut rates), sigma);
        plausible(growth_ratio(sigma / x, (light * self.noise.light).max(0.0).sqrt() / x, lags))
    }

    /// Two means over the posterior of a pixel's threshold, by Gauss and Hermite's three points. First the square of the charge
    /// that a readout brings over that of the rate: a span's variance in readouts becomes one of charge by the increment, which
    /// is less than the rate by what low draws save (0.5 % in the dark). Then the variance of that charge per spike, in the
    /// pixel's own thresholds, for each unit of a nominal pixel's `sigma^2`.
    fn unit_noise(&self, p: usize, f: f64, sigma: f64) -> [f64; 2] {
        let at = |phi: f64| {
            let own = sigma / phi;
            let x = self.increment(f, own);
            [(x / f).powi(2), self.share(x, own) / (phi * phi)]
        };
        self.over_threshold(p, at).map(|(mean, _)| mean)
    }
}

/// A ratio of remembered phases to even ones. Noise too small for the integrals tells no phase either.
fn plausible(ratio: f64) -> f64 {
    if (0.5..2.0).contains(&ratio) { ratio } else { 1.0 }
}

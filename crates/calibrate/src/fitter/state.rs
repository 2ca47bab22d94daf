//! State of the estimator, and the quantities that it computes for one pixel.
//!
//! * `f`: rate in spikes per readout.
//! * `x`: charge per readout, in thresholds of the pixel.
//! * `sigma`: standard deviation of the threshold noise of the pixel, in thresholds of the pixel.
//! * `phi`: threshold of the pixel, divided by the nominal threshold.
//! * `K`: quanta of light per spike of a nominal pixel.
//! * `psi`: rate that redrawn noise adds, divided by the variance of the noise. [`noise_rate_gain`] returns it.

use super::alignment::Alignment;
use crate::formulas::fit::{PixelFit, RateWeighting, correct_end_bias};
use crate::formulas::selection::{firing_draw_variance, noise_rate_gain};
use crate::recordings::color_filters::PixelClasses;
use crate::recordings::light_unit::SATURATION_RATE;
use crate::recordings::observations::{LightLevel, MIN_TIMED_SPIKES, Observations};
use crate::result::{CalibrateOptions, LightField};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::pixel::NoiseSampling;
use spikelane::sensor::Sensor;
use spikelane_measure::Estimate;

/// Current estimate of the noise.
#[derive(Clone, Copy, Debug)]
pub(super) struct NoiseEstimate {
    /// Variance of the threshold noise of a nominal pixel, in thresholds squared.
    pub(super) threshold_variance: f64,
    /// Variance per spike that the quanta of light cause, in thresholds squared. It is `1 / K` for `K` quanta per
    /// spike.
    pub(super) inverse_light_quanta: f64,
    pub(super) inverse_dark_quanta: f64,
    pub(super) noise_sampling: NoiseSampling,
    pub(super) dead_time_fraction: f64,
}

/// One light level of one pixel. `level` is the index of the level. `increment` is `x`, and `variance` is the variance of
/// `x`.
pub(super) struct LevelPoint {
    pub(super) level: usize,
    pub(super) light: f64,
    pub(super) increment: f64,
    pub(super) variance: f64,
    /// Change of `x` if the threshold of the pixel changes by its standard deviation.
    pub(super) threshold_sensitivity: f64,
}

/// Factors of the gain that pixels share. The means of both factors over the pixels are 1.
#[derive(Clone, Debug)]
pub(super) struct GainShape {
    /// Relative light on each pixel.
    pub(super) field: Vec<f64>,
    /// Relative gain of the class of each pixel.
    pub(super) class: Vec<f64>,
    /// Largest relative gain of a class.
    pub(super) max_class: f64,
    /// The fitted shape of the light. `None` if it is not significant.
    pub(super) light_field: Option<LightField>,
    /// Mean gain of each class. Empty if the classes do not differ significantly and are not filters.
    pub(super) class_gains: Vec<Estimate>,
    /// Number of fitted coefficients without the mean.
    pub(super) coefficients: usize,
}

impl GainShape {
    /// Returns the shape of uniform light on a sensor without classes.
    pub(super) fn uniform(pixels: usize) -> Self {
        Self {
            field: vec![1.0; pixels],
            class: vec![1.0; pixels],
            max_class: 1.0,
            light_field: None,
            class_gains: Vec::new(),
            coefficients: 0,
        }
    }

    /// Returns the fit of pixel `p` without the shared gain.
    pub(super) fn relative_fit(&self, p: usize, fit: &PixelFit) -> PixelFit {
        let fit = self.fit_without_field(p, fit);
        let factor = self.class[p];
        PixelFit { a: fit.a / factor, var_a: fit.var_a / (factor * factor), cov: fit.cov / factor, ..fit }
    }

    /// Returns the fit of pixel `p` without the shape of the light.
    pub(super) fn fit_without_field(&self, p: usize, fit: &PixelFit) -> PixelFit {
        let factor = self.field[p];
        PixelFit { a: fit.a / factor, var_a: fit.var_a / (factor * factor), cov: fit.cov / factor, ..*fit }
    }
}

/// Changes of the estimated noise for the largest light that the dark recording may contain.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DarkLightRange {
    /// Largest light that the dark recording may contain. Light 1 causes one spike per readout.
    pub(super) max_light: f64,
    /// Part of the variance of the threshold noise that may be shot noise of light, in squared thresholds.
    pub(super) threshold_variance: f64,
    /// Increase of the variance per spike that the quanta of light cause, in squared thresholds.
    pub(super) quanta_variance: f64,
}

/// The growth of the interval variance of a level, and the contributions of the noise sources to this growth.
pub(super) struct VarianceGrowth {
    /// Phase variance per spike, in squared thresholds of the pixel itself.
    pub(super) variance_per_spike: Estimate,
    /// Variance per spike that `sigma^2 = 1` would cause, where `sigma` is the noise of a nominal pixel.
    pub(super) threshold_coefficient: f64,
    /// Variance per spike that `1 / K = 1` would cause.
    pub(super) light_coefficient: f64,
    /// Variance per spike that light `L` in the dark recording would cause for `L / K = 1`.
    pub(super) dark_light_coefficient: f64,
    /// Estimate of `L / K` from the pixels of a dark level. It is 0 for a lit level.
    pub(super) dark_light_slope: Estimate,
}

pub(super) struct Fitter<'a> {
    pub(super) observed: &'a Observations,
    pub(super) sensor: Sensor,
    pub(super) noise: NoiseEstimate,
    pub(super) light_uncertainty: Option<f64>,
    pub(super) fits: Vec<PixelFit>,
    pub(super) threshold_posteriors: Vec<[f64; 2]>,
    pub(super) level_offsets: Vec<Estimate>,
    /// Standard deviation of each level about its stated light. It is large if the fit ignores the stated light.
    pub(super) level_sd: Vec<f64>,
    /// Whether each level is off the line through the other levels.
    pub(super) is_outlier: Vec<bool>,
    /// Classes of the pixels: the filters, or the positions in a cell of 2x2 pixels.
    pub(super) classes: PixelClasses,
    /// For each level and each class, whether most pixels fire at nearly every readout. The few slow pixels
    /// of such a class are not used, because their noise made them slow.
    pub(super) saturated_classes: Vec<Vec<bool>>,
    /// For each level, whether all classes are saturated. The light of such a level cannot be determined.
    pub(super) is_saturated: Vec<bool>,
    /// Gain that pixels share: the shape of the light and the gains of the classes.
    pub(super) shape: GainShape,
    pub(super) alignment: Option<Alignment>,
    /// Ratio of the typical chi-square of a pixel to its expectation. It is 1 if the model fits.
    pub(super) chi2_scale: f64,
    /// [`Fitter::chi2_scale`] of each class of pixels. Without filters, all classes have the same scale. A lamp that changes its
    /// color is not a fault of the pixels behind one filter.
    pub(super) class_chi2_scales: Vec<f64>,
    pub(super) is_noise_sampling_identified: bool,
    /// For each level, the correction factor for correlated phases. It multiplies the rate that low threshold draws
    /// add.
    pub(super) phase_corrections: Vec<f64>,
    /// For each level, the probability that the interval noise of each pixel has no outlier. Empty without interval noise.
    pub(super) noise_weights: Vec<Vec<f64>>,
    /// Effect of light that the dark recording may contain.
    pub(super) dark_light: DarkLightRange,
    /// Share of the threshold noise that is redrawn at every readout, if the dark recording is dark.
    pub(super) redraw_share: Estimate,
    /// Largest part of the redraw share that flicker of light in the dark recording may cause.
    pub(super) redraw_flicker: f64,
    /// Error of the redraw share that includes light in the dark recording.
    pub(super) redraw_share_error: f64,
    pub(super) sigma_t: Estimate,
    pub(super) electrons: Estimate,
    pub(super) notes: Vec<String>,
}

pub(super) const ZERO_ESTIMATE: Estimate = Estimate { value: 0.0, error: 0.0, samples: 0 };

impl<'a> Fitter<'a> {
    pub(super) fn new(observed: &'a Observations, options: &CalibrateOptions) -> Result<Self> {
        let geometry = observed.geometry;
        let classes = observed.checked_pixel_classes()?;
        let usable = observed.levels.iter().filter(|l| !l.is_saturated(&classes)).count();
        if usable < 2 || observed.levels.iter().all(|l| l.light == 0.0) {
            return Err(Error::new(ErrorKind::Input, "recording set")
                .found(format_args!("{usable} usable levels"))
                .expected("at least two below saturation, of which at least one is lit"));
        }
        let saturated_classes = |level: &LightLevel| {
            level.class_median_rates(&classes).iter().map(|rate| *rate > SATURATION_RATE).collect()
        };
        let mut sensor = Sensor::new(geometry.width() as u32, geometry.height() as u32, observed.readout_hz)?;
        sensor.capacitance_ff = options.capacitance_ff;
        sensor.swing_v = options.swing_v;
        let electrons = Sensor::electrons_from_fc(sensor.capacitance_ff * sensor.swing_v);
        if options.light_uncertainty.is_some_and(|u| !(u > 0.0 && u < 1.0)) {
            return Err(Error::new(ErrorKind::Usage, "light uncertainty")
                .expected("a relative standard deviation above 0 and below 1, such as 0.01"));
        }
        let redrawn = options.noise_sampling.unwrap_or(NoiseSampling::EveryReadout);
        Ok(Self {
            observed,
            sensor: sensor.validate()?,
            noise: NoiseEstimate {
                threshold_variance: 0.0,
                inverse_light_quanta: 1.0 / electrons,
                inverse_dark_quanta: 0.0,
                noise_sampling: redrawn,
                dead_time_fraction: options.dead_time_fraction,
            },
            light_uncertainty: options.light_uncertainty,
            fits: vec![PixelFit::NAN; geometry.pixels()],
            threshold_posteriors: vec![[1.0, 0.0]; geometry.pixels()],
            level_offsets: vec![ZERO_ESTIMATE; observed.levels.len()],
            level_sd: vec![0.0; observed.levels.len()],
            is_outlier: vec![false; observed.levels.len()],
            saturated_classes: observed.levels.iter().map(saturated_classes).collect(),
            is_saturated: observed.levels.iter().map(|l| l.is_saturated(&classes)).collect(),
            class_chi2_scales: vec![1.0; classes.count()],
            classes,
            shape: GainShape::uniform(geometry.pixels()),
            alignment: None,
            chi2_scale: 1.0,
            is_noise_sampling_identified: options.noise_sampling.is_some(),
            phase_corrections: vec![1.0; observed.levels.len()],
            noise_weights: observed.levels.iter().map(LightLevel::interval_weights).collect(),
            dark_light: DarkLightRange::default(),
            redraw_share: Estimate { value: f64::NAN, error: f64::INFINITY, samples: 0 },
            redraw_flicker: 0.0,
            redraw_share_error: f64::INFINITY,
            sigma_t: ZERO_ESTIMATE,
            electrons: ZERO_ESTIMATE,
            notes: Vec::new(),
        })
    }

    /// Returns the variance per spike divided by `sigma^2`, at an increment of `x` thresholds per readout.
    pub(super) fn variance_share(&self, x: f64, sigma: f64) -> f64 {
        match self.noise.noise_sampling {
            NoiseSampling::EveryReadout if sigma > 0.0 => firing_draw_variance(x / sigma),
            _ => 1.0,
        }
    }

    /// Returns the charge per readout at which a pixel fires at the rate `f`. The charge is computed from the charge
    /// balance, in thresholds of the pixel.
    pub(super) fn increment(&self, f: f64, sigma: f64) -> f64 {
        (f - self.rate_bias(f, sigma)) / (1.0 - self.noise.dead_time_fraction * f)
    }

    /// Returns the part of the rate `f` that low draws of the noise add.
    pub(super) fn rate_bias(&self, f: f64, sigma: f64) -> f64 {
        match self.noise.noise_sampling {
            NoiseSampling::EveryReadout => sampling_rate_bias(f, sigma),
            NoiseSampling::EveryReset => 0.0,
        }
    }

    pub(super) fn points(&self, p: usize) -> Vec<LevelPoint> {
        let levels = self.observed.levels.iter().enumerate();
        levels.filter_map(|(k, level)| self.point(p, k, level)).collect()
    }

    /// Returns two values for each result of `function`: its mean and its sensitivity. The mean is over the posterior
    /// of the threshold of pixel `p`, by three-point Gauss-Hermite quadrature. The sensitivity is the change of the
    /// result if the threshold changes by its standard deviation.
    pub(super) fn mean_over_threshold<const N: usize>(
        &self,
        p: usize,
        function: impl Fn(f64) -> [f64; N],
    ) -> [(f64, f64); N] {
        let [mean, sd] = self.threshold_posteriors[p];
        let step = (3.0_f64.sqrt() * sd).min(0.5 * mean);
        let middle = function(mean);
        if step == 0.0 {
            return middle.map(|value| (value, 0.0));
        }
        let (low, high) = (function(mean - step), function(mean + step));
        std::array::from_fn(|i| {
            ((4.0 * middle[i] + low[i] + high[i]) / 6.0, (high[i] - low[i]) * sd / (2.0 * step))
        })
    }

    /// Returns the share of the charge that comes from light, for a pixel that fires at the rate `f`.
    pub(super) fn light_share(&self, p: usize, level: &LightLevel, f: f64) -> f64 {
        let known = self.fits[p].d;
        let dark = if known.is_finite() { known } else { self.observed.levels[0].rate[p] };
        if level.light == 0.0 { 0.0 } else { 1.0 - dark / f }
    }

    /// Returns the charge of a quantum of light in thresholds of the pixel, divided by the charge for a nominal pixel.
    /// Quanta are photons, and they are counted before the gain is applied. The published model does the same. The shape
    /// of the light and the filters change the number of photons, but not their charge.
    pub(super) fn quantum(&self, p: usize) -> f64 {
        let a = self.fits[p].a;
        if a.is_finite() { a / (self.shape.field[p] * self.transmission(p)) } else { 1.0 }
    }

    /// Returns the ratio of the typical chi-square of the pixels like `p` to its expectation.
    pub(super) fn typical_chi2(&self, p: usize) -> f64 {
        self.class_chi2_scales[self.classes.class(p)]
    }

    /// Returns the light behind the filter of pixel `p`, relative to the light behind the filter that transmits the most. It
    /// is 1 if the classes of the pixels are not filters.
    pub(super) fn transmission(&self, p: usize) -> f64 {
        if self.classes.are_filters { self.shape.class[p] / self.shape.max_class } else { 1.0 }
    }

    pub(super) fn point(&self, p: usize, k: usize, level: &LightLevel) -> Option<LevelPoint> {
        let (f, n) = (level.rate[p], level.spikes[p]);
        let of_length = level.readouts > 0;
        // A silent pixel in the dark has a small dark current, so its rate of 0 is used. A dark rate that is fitted to the
        // lit levels alone scatters about zero, and a camera file stores only positive values. A silent pixel in light is
        // dead and is skipped.
        if self.saturated_classes[k][self.classes.class(p)]
            || f.is_nan()
            || f > SATURATION_RATE
            || (of_length && n == 0 && level.light > 0.0)
        {
            return None;
        }
        let by_time = of_length && n >= MIN_TIMED_SPIKES;
        let f = if by_time { correct_end_bias(f, f64::from(n - 1)) } else { f };
        // The noise is a voltage. The spread of thresholds is almost entirely a spread of voltages too.
        let relative_sigma = |phi: f64| self.noise.threshold_variance.sqrt() / phi;
        let added = |phi: f64| [self.phase_corrections[k] * sampling_rate_bias(f, relative_sigma(phi))];
        let [(bias, by_threshold)] = self.mean_over_threshold(p, added);
        let draw_bias = if self.noise.noise_sampling == NoiseSampling::EveryReadout { bias } else { 0.0 };
        let live_share = 1.0 - self.noise.dead_time_fraction * f;
        let x = (f - draw_bias) / live_share;
        let lit = self.light_share(p, level, f);
        let sigma = relative_sigma(self.threshold_posteriors[p][0]);
        let weighting = RateWeighting {
            threshold_variance: sigma * sigma * self.variance_share(x, sigma),
            light_variance: self.noise.inverse_light_quanta * self.quantum(p),
            dark_variance: self.noise.inverse_dark_quanta,
        };
        let variance = match (of_length, by_time) {
            (true, true) => weighting.variance(f, f64::from(n - 1), lit),
            // With at most one spike and a random phase, the spike count is wrong by at most half a spike.
            (true, false) => 0.25 / (f64::from(level.readouts)).powi(2),
            // A map does not contain its number of readouts, so the variance after a thousand spikes is assumed.
            (false, _) => weighting.variance(f, 1000.0, lit) + 1e-14,
        };
        let light = level.light + self.level_offsets[k].value;
        Some(LevelPoint {
            level: k,
            light,
            increment: x,
            variance,
            threshold_sensitivity: -by_threshold / live_share,
        })
    }
}

/// Returns the rate that noise redrawn at every readout adds to a pixel that fires at the rate `f`.
///
/// At a charge of `x` thresholds per readout, an average spike consumes the share `1 - sigma^2 psi(x / sigma) / x` of
/// the threshold. Therefore `x = f - sigma^2 psi(x / sigma) f / x`. Two iterations suffice, because the added rate is
/// only half a percent.
fn sampling_rate_bias(f: f64, sigma: f64) -> f64 {
    if sigma <= 0.0 || f <= 0.0 {
        return 0.0;
    }
    let added = |x: f64| sigma * sigma * noise_rate_gain(x / sigma) * f / x;
    let left = |x: f64| f - added(x);
    added(left(left(f)))
}

//! Options of a calibration, and its results: maps, moments, and the calibrated camera.

use super::population::Population;
use super::recordings::observations::Flicker;
use super::recordings::recorded_camera::RecordedCamera;
use super::snee::SneeMaps;
use crate::formulas::fit::PixelFit;
use spikelane::effects::{Camera, Maps, find};
use spikelane::error::Result;
use spikelane::pixel::NoiseSampling;
use spikelane::sensor::{Mosaic, Sensor};
use spikelane::unstable::draws::pattern_rng::PatternRng;
use spikelane::unstable::draws::{RandomStream, Seeds};
use spikelane_measure::Estimate;

/// A stated light level and the level that the calibration found.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Lamp {
    /// File name of the recording.
    pub file: String,
    /// Light that the set states. Light 1 causes one spike per readout.
    pub stated_light: f64,
    /// Relative standard deviation of the stated light.
    pub stated_uncertainty: f64,
    /// Found light minus stated light. The error includes the error of the scale that all levels share. No recording
    /// determines this scale.
    pub deviation: Estimate,
    /// Whether the level is off the line through the other levels by more than 3.5 times its uncertainty. The fit gives
    /// such a level an uncertainty of 30 %.
    pub is_outlier: bool,
    /// Change of the light between the first and the second half of the recording, divided by the mean light. `None` if
    /// unknown.
    pub light_change: Option<Estimate>,
    /// Whether `light_change` is significant and exceeds a thousandth.
    pub drifts: bool,
    /// Strongest oscillation of the light. `None` if there is none, or if it is unknown.
    pub flicker: Option<Flicker>,
    /// Whether the change of the light was removed from the rates and intervals. If the light drifts or flickers and the
    /// change was not removed, the intervals are not used to estimate the noise.
    pub is_light_change_removed: bool,
    /// Whether most pixels fire at nearly every readout. The found light is then unknown.
    pub is_saturated: bool,
    /// Number of readouts of the recording. It is 0 for a rate map of unknown length.
    pub readouts: u32,
    /// Mean rate of the pixels that have a fitted line, in spikes per readout.
    pub mean_rate: f64,
    /// Robust spread of the rates about the fitted lines at the found light, divided by the mean rate. Pixels without a
    /// fitted line are excluded.
    pub rate_scatter: f64,
}

impl Lamp {
    /// Returns the found light.
    #[must_use]
    pub fn found_light(&self) -> f64 {
        self.stated_light + self.deviation.value
    }

    /// Returns the relative deviation divided by the uncertainty of the stated light. Returns `None` for a dark or
    /// saturated level.
    #[must_use]
    pub fn pull(&self) -> Option<f64> {
        self.relative_deviation().map(|[value, _]| value / self.stated_uncertainty)
    }

    /// Returns the deviation and its error, divided by the stated light. Returns `None` for a dark or saturated level.
    #[must_use]
    pub fn relative_deviation(&self) -> Option<[f64; 2]> {
        let known = self.stated_light > 0.0 && !self.is_saturated;
        known.then(|| [self.deviation.value, self.deviation.error].map(|x| x / self.stated_light))
    }
}

/// Whether the responses to sources of light add up.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Additivity {
    /// The recordings of several sources.
    pub sums: Vec<AdditiveSum>,
    /// The number `b` of the response `a light (1 + b light)` that the sums show. It is 0 for a linear response, and it does not
    /// depend on the stated light.
    pub curvature: Estimate,
}

/// The response to several sources, compared with the responses to each source.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct AdditiveSum {
    /// File name of the recording of all sources.
    pub file: String,
    /// Names of the sources.
    pub sources: Vec<String>,
    /// Response to all sources minus the sum of the responses to each source, divided by the response to all sources. The
    /// error includes the repeatability of the sources.
    pub residual: Estimate,
}

/// The shape of the light on the sensor, which all recordings share. It is the product of the lamp and the lens.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct LightField {
    /// Relative difference between the mean light of the four corner pixels and the light of the center, with the opposite
    /// sign.
    pub corner_falloff: Estimate,
    /// Terms of the logarithm of the light relative to the center.
    pub terms: Vec<FieldTerm>,
}

/// The pixels behind the filters of one channel of a mosaic.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ChannelFit {
    /// Letter of the channel in [`Calibration::mosaic`].
    pub name: char,
    /// Number of pixels.
    pub pixels: usize,
    /// Light of the lamps behind this filter, divided by the light behind the filter that transmits the most.
    pub light: Estimate,
    /// Light of each level in this channel minus the light that all channels show, divided by that light. The order is that
    /// of [`Calibration::lamps`]. An unknown deviation is NaN. Lamps that change their color with the
    /// level have such deviations.
    pub light_deviations: Vec<Estimate>,
    /// Moments over the pixels without defects. The gains contain the filter, but not the shape of the light.
    pub population: Population,
}

impl ChannelFit {
    /// Returns the largest significant deviation of a level, or `None` if no deviation is significant. A deviation is
    /// significant if it exceeds 1 % and 3.5 standard errors.
    #[must_use]
    pub fn largest_light_deviation(&self) -> Option<Estimate> {
        let is_significant = |e: &&Estimate| e.value.abs() > 0.01_f64.max(3.5 * e.error);
        let significant = self.light_deviations.iter().filter(is_significant);
        significant.max_by(|x, y| x.value.abs().total_cmp(&y.value.abs())).copied()
    }
}

/// The term `coefficient * u^column_power * v^row_power`. `u` and `v` are the column and the row of a pixel, from -1 to 1
/// between the edges of the sensor.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct FieldTerm {
    /// Power of `u`.
    pub column_power: i32,
    /// Power of `v`.
    pub row_power: i32,
    /// Coefficient of the term.
    pub coefficient: f64,
}

/// Options of the default estimator.
///
/// # Examples
/// ```
/// use spikelane_calibrate::{CalibrateOptions, NoiseSampling};
/// let options = CalibrateOptions::default()
///     .with_light_uncertainty(Some(0.005))
///     .with_noise_sampling(Some(NoiseSampling::EveryReset));
/// assert_eq!((options.capacitance_ff, options.swing_v), (4.348, 1.1));
/// assert_eq!(options.light_uncertainty, Some(0.005));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct CalibrateOptions {
    /// Dead time: the first charge increment after a spike is reduced by this share.
    pub dead_time_fraction: f64,
    /// Relative standard deviation of every light level. `None` selects the value of the set, or 0.01 if the set has none.
    pub light_uncertainty: Option<f64>,
    /// When the threshold noise is redrawn. `None` selects the rule that agrees with the data.
    pub noise_sampling: Option<NoiseSampling>,
    /// Nominal capacitance in femtofarads. It determines the units of the camera. If the data do not determine the
    /// noise, it also determines the assumed noise.
    pub capacitance_ff: f64,
    /// Nominal swing in volts. It determines the units of the camera. If the data do not determine the noise, it also
    /// determines the assumed noise.
    pub swing_v: f64,
    /// Largest accepted relative standard error of the gain `a` of the median pixel. `None` accepts any error.
    pub max_gain_error: Option<f64>,
}

spikelane::unstable::with_methods!(CalibrateOptions {
    with_dead_time_fraction: dead_time_fraction: f64,
    with_light_uncertainty: light_uncertainty: Option<f64>,
    with_noise_sampling: noise_sampling: Option<NoiseSampling>,
    with_capacitance_ff: capacitance_ff: f64,
    with_swing_v: swing_v: f64,
    with_max_gain_error: max_gain_error: Option<f64>,
});

impl Default for CalibrateOptions {
    fn default() -> Self {
        Self {
            dead_time_fraction: 0.002,
            light_uncertainty: None,
            noise_sampling: None,
            capacitance_ff: 4.348,
            swing_v: 1.1,
            max_gain_error: None,
        }
    }
}

/// Result of a calibration. Maps are row-major and have one entry per pixel.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Calibration {
    /// The sensor. Its nominal circuit is the circuit in the options.
    pub sensor: Sensor,
    /// The line of every pixel, or NaN for a pixel without a fit. The output files contain the means of the population for
    /// such a pixel.
    pub fits: Vec<PixelFit>,
    /// Mean and standard deviation of the posterior of each threshold, both divided by the nominal threshold.
    pub threshold_posteriors: Vec<[f64; 2]>,
    /// Moments over the pixels without defects.
    pub population: Population,
    /// Standard deviation of the threshold noise, divided by the nominal threshold.
    pub sigma_t: Estimate,
    /// Number of electrons that fill the threshold of a pixel with the mean gain. It does not depend on the unit of light.
    pub electrons_per_threshold: Estimate,
    /// Number of photons per readout at light 1 and gain 1, a parameter of the camera file. It changes with the unit of
    /// light. It is the number of electrons per threshold, multiplied by the mean gain.
    pub photons_at_full_light: Estimate,
    /// Strength of the shot noise of the dark current. 1 is full shot noise, and 0 is no shot noise.
    pub dark_shot_noise: f64,
    /// When the threshold noise is redrawn.
    pub noise_sampling: NoiseSampling,
    /// Whether the data or the options determine when the noise is redrawn. If false, the nominal rule applies: the
    /// noise is redrawn at every reset.
    pub is_noise_sampling_identified: bool,
    /// Share of the threshold noise that is redrawn at every readout, 0 to 1. The rest is constant from reset to reset. The
    /// value is NaN if the recordings do not determine the share.
    pub redraw_share: Estimate,
    /// Shape of the light on the sensor. `None` if the light is uniform within the errors.
    pub light_field: Option<LightField>,
    /// Relative light on each pixel, with the mean 1. The gains of the camera are relative to this light.
    pub light_field_map: Vec<f64>,
    /// Mean gain of each class of pixels. The classes of a declared mosaic are its channels. Other cameras have the
    /// classes of a cell of 2x2 pixels: even row and even column, even row and odd column, odd row and even column, odd row
    /// and odd column. Empty if the classes do not differ significantly and are not filters.
    pub class_gains: Vec<Estimate>,
    /// Relative gain of the class of each pixel, with the mean 1.
    pub class_gain_map: Vec<f64>,
    /// The color filters. If they are detected and not declared, each letter of the pattern `KLMN` is a position in a cell
    /// of 2x2 pixels, and its color is unknown. `None` for a camera without filters.
    pub mosaic: Option<Mosaic>,
    /// Whether the recording set states the color filters.
    pub is_mosaic_declared: bool,
    /// The channels of `mosaic`. Empty for a camera without filters.
    pub channels: Vec<ChannelFit>,
    /// The light levels in ascending order of light.
    pub lamps: Vec<Lamp>,
    /// Relative standard error of the scale that all levels share. No recording determines this scale.
    ///
    /// `light_scale_error` is included in the errors of the population's gain and of the electrons. It is not included
    /// in the errors of single pixels.
    pub light_scale_error: f64,
    /// Nonlinearity of the found levels as a function of the stated levels: the relative deviation at light 1 minus the
    /// relative deviation in the dark. `None` with fewer than three lit levels. With recordings of several sources, it is
    /// the curvature of [`Additivity`].
    pub nonlinearity: Option<Estimate>,
    /// Whether the nonlinearity exceeds what the uncertainty of the levels explains.
    pub is_nonlinear: bool,
    /// Whether the responses to several sources add up. `None` without recordings of several sources.
    pub additivity: Option<Additivity>,
    /// Pixels that never fired in lit recordings.
    pub dead_pixels: Vec<usize>,
    /// Pixels whose dark rate is more than six robust standard deviations above the median.
    pub hot_pixels: Vec<usize>,
    /// Pixels whose rates are not a linear function of the light.
    pub poor_fit_pixels: Vec<usize>,
    /// Assumed dead time: the first charge increment after a spike is reduced by this share.
    pub dead_time_fraction: f64,
    /// Sentences about the quantities that the data identify or do not identify.
    pub notes: Vec<String>,
    /// Description of the recorded camera, if the set has one.
    pub recorded_camera: Option<RecordedCamera>,
    /// Result of the estimator of the SCSim paper for the same data, if this estimator was run. Reports compare it with
    /// the default estimator.
    pub snee: Option<SneeMaps>,
}

impl Calibration {
    /// Returns the calibrated camera. It contains maps of gain, dark current and threshold voltage, and the noise.
    ///
    /// The gains are relative to the shape of the light, because the shape belongs to the lamp and the lens.
    ///
    /// If the recorded camera has color filters, the camera has their mosaic. The gain of each channel is chosen so that
    /// white light, linear sRGB (1, 1, 1), causes the rates that the lamps caused. The recordings of one kind of lamp do not
    /// determine the response to other colors.
    ///
    /// Pixels without a fit have the means of the population. Dead pixels have a gain and a dark current of zero.
    ///
    /// No recording determines how `a` and `d` of a single pixel split into gain, dark current and threshold `phi`.
    /// Each threshold is therefore drawn from its posterior, with one fixed seed. The noise of the drawn threshold
    /// changes the rate, so `a` and `d` are adjusted.
    ///
    /// If the camera used the posterior means, its thresholds would have too small a spread. The mean of the resulting
    /// noise, `E[1 / phi^2]`, would be too small by three times the variance of the posterior. This is 0.4 % for the
    /// published spreads. The whole spread of the thresholds is assigned to the voltage.
    ///
    /// # Errors
    /// If a value is out of the range of its effect.
    pub fn camera(&self) -> Result<Camera> {
        let sensor = self.sensor;
        let to_pa = sensor.capacitance_ff * sensor.swing_v / (sensor.period_s() * 1e3);
        let brightest = self.class_gain_map.iter().copied().fold(0.0, f64::max);
        let transmission =
            |p: usize| self.mosaic.as_ref().map_or(1.0, |_| self.class_gain_map[p] / brightest);
        let mut maps = [Vec::new(), Vec::new(), Vec::new()];
        for (p, ((fit, [mean, sd]), z)) in
            self.fits.iter().zip(&self.threshold_posteriors).zip(self.threshold_posterior_draws()).enumerate()
        {
            let known = fit.a.is_finite();
            let a = if known {
                (fit.a + z * fit.threshold_sensitivity[0]) / (self.light_field_map[p] * transmission(p))
            } else {
                self.population.mean_a.value * self.class_gain_map[p] / transmission(p)
            };
            let d =
                if known { fit.d + z * fit.threshold_sensitivity[1] } else { self.population.mean_d.value };
            let phi = mean + z * sd;
            maps[0].push(a * phi);
            maps[1].push(d * phi * to_pa);
            maps[2].push(sensor.swing_v * phi);
        }
        for p in &self.dead_pixels {
            maps[0][*p] = 0.0;
            maps[1][*p] = 0.0;
        }
        let [gain, dark, swing] = maps;
        let noise_sampling = if self.noise_sampling == NoiseSampling::EveryReadout { 1.0 } else { 0.0 };
        let mut camera = Camera::ideal(sensor)
            .with_effect(
                find("shot_noise")?
                    .neutral()
                    .with_value("strength", 1.0)?
                    .with_value("counts", 1.0)?
                    .with_value("photons_at_full_scale", self.photons_at_full_light.value)?,
            )
            .with_effect(
                find("thermal_noise")?
                    .neutral()
                    .with_value("sigma", self.sigma_t.value * sensor.swing_v)?
                    .with_value("noise_sampling", noise_sampling)?,
            )
            .with_effect(find("start_phase")?.neutral().with_value("share", 1.0)?);
        if self.dead_time_fraction > 0.0 {
            camera = camera.with_effect(
                find("dead_time")?.neutral().with_value("lost_fraction", self.dead_time_fraction)?,
            );
        }
        if self.dark_shot_noise > 0.0 {
            camera = camera.with_effect(
                find("dark_shot_noise")?.neutral().with_value("strength", self.dark_shot_noise)?,
            );
        }
        camera.mosaic = self.calibrated_mosaic()?;
        camera.name = "calibrated".to_owned();
        camera.source = "fitted by calibrate; see calibration.json and report.html".to_owned();
        camera.maps =
            Maps { gain: Some(gain), dark_pa: Some(dark), swing_v: Some(swing), capacitance_ff: None };
        Ok(camera)
    }

    /// Returns the mosaic whose channels have the found light for white.
    fn calibrated_mosaic(&self) -> Result<Option<Mosaic>> {
        let Some(mut mosaic) = self.mosaic.clone() else { return Ok(None) };
        let width = self.sensor.geometry.width();
        let brightest = self.class_gain_map.iter().copied().fold(0.0, f64::max);
        for (index, declared) in mosaic.clone().channels().iter().enumerate() {
            let is_here = |p: &usize| mosaic.channel_at(p / width, p % width) == index;
            // A sensor that is smaller than the pattern has no pixel of some channels.
            let Some(pixel) = (0..self.fits.len()).find(is_here) else { continue };
            let factor = self.class_gain_map[pixel] / brightest / declared.white();
            mosaic =
                mosaic.with_channel(declared.name, declared.gain * factor, declared.infrared * factor)?;
        }
        Ok(Some(mosaic))
    }

    /// Returns, for each pixel, the position of the drawn threshold in its posterior, in standard deviations. All positions
    /// are 0 if the data do not determine the spread of the thresholds.
    fn threshold_posterior_draws(&self) -> impl Iterator<Item = f64> + use<> {
        let spread = self.population.sigma_phi;
        let seeds = Seeds { camera: 0, shot: 0, sequence: 0 };
        let pattern = PatternRng::new(seeds, RandomStream::from_name("calibrated thresholds"));
        // More than four standard deviations below the mean, a threshold of the widest posterior would be near zero.
        pattern.normals_if(spread.value > 2.0 * spread.error).map(|z| z.clamp(-4.0, 4.0))
    }
}

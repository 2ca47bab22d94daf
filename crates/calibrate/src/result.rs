//! What a calibration takes as known and what it gives: maps, moments, and the camera they amount to.

use super::population::Population;
use super::snee::SneeMaps;
use crate::formulas::fit::PixelFit;
use spikelane::effects::{Camera, Maps, find};
use spikelane::error::Result;
use spikelane::sensor::Sensor;
use spikelane::unstable::draws::pattern::Pattern;
use spikelane::unstable::draws::{Seeds, Stream};
use spikelane_measure::Estimate;

/// When threshold noise is redrawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Redrawn {
    /// At every readout: noise adds to the rate.
    EveryReadout,
    /// At every reset: it averages out.
    EveryReset,
}

/// Relative standard deviation of a light level of which nobody says how well it is known: that of a laboratory's meter.
pub const LIGHT_UNCERTAINTY: f64 = 0.01;

/// A light level as it was stated and as it was found.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Lamp {
    /// Its file.
    pub file: String,
    /// Light as the set states it.
    pub stated: f64,
    /// Relative standard deviation of what is stated.
    pub uncertainty: f64,
    /// Light found, less the stated; the error holds what no recording tells, the scale of all levels.
    pub deviation: Estimate,
    /// Whether it lies off the line of the others by more than its uncertainty explains; it was left out where the levels set the scale.
    pub wrong: bool,
    /// Change of the light from the first half of its recording to the second, of the mean; `None` where that is not known.
    pub change: Option<Estimate>,
    /// Whether that is more than its error and a thousandth: then its intervals tell no noise.
    pub drifts: bool,
    /// Whether most pixels fire at nearly every readout: nothing is known of it then.
    pub saturated: bool,
    /// Readouts of its recording; 0 for a rate map of unknown length.
    pub readouts: u32,
    /// Mean rate, spikes a readout, of the pixels that have a line.
    pub rate: f64,
    /// Robust spread of these pixels' rates about their own lines at the light found, of the mean rate.
    pub scatter: f64,
}

impl Lamp {
    /// Light found.
    #[must_use]
    pub fn found(&self) -> f64 {
        self.stated + self.deviation.value
    }

    /// The deviation of what was found, and its error, in what was stated; `None` in the dark and where nothing is known.
    #[must_use]
    pub fn relative(&self) -> Option<[f64; 2]> {
        let known = self.stated > 0.0 && !self.saturated;
        known.then(|| [self.deviation.value, self.deviation.error].map(|x| x / self.stated))
    }
}

/// What the estimator takes as known.
#[derive(Clone, Copy, Debug)]
pub struct CalibrateOptions {
    /// Share of the first increment after a spike that the reset loses.
    pub lost_increment: f64,
    /// Relative standard deviation of every light level; `None` takes what the set states, else a hundredth.
    pub light_uncertainty: Option<f64>,
    /// When the threshold noise is redrawn; `None` asks the data.
    pub redrawn: Option<Redrawn>,
    /// Nominal capacitance in femtofarads: sets units, no spike depends on it.
    pub capacitance_ff: f64,
    /// Nominal swing in volts, likewise.
    pub swing_v: f64,
    /// Relative standard error of `a` that is asked for, if any.
    pub precision: Option<f64>,
}

spikelane::unstable::with_methods!(CalibrateOptions {
    with_lost_increment: lost_increment: f64,
    with_light_uncertainty: light_uncertainty: Option<f64>,
    with_redrawn: redrawn: Option<Redrawn>,
    with_capacitance_ff: capacitance_ff: f64,
    with_swing_v: swing_v: f64,
    with_precision: precision: Option<f64>,
});

impl Default for CalibrateOptions {
    fn default() -> Self {
        Self {
            lost_increment: 0.002,
            light_uncertainty: None,
            redrawn: None,
            capacitance_ff: 4.348,
            swing_v: 1.1,
            precision: None,
        }
    }
}

/// What a recording set says about a camera. Maps are row-major, one entry per pixel.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Calibration {
    /// The sensor, with the nominal circuit of the options.
    pub sensor: Sensor,
    /// Every pixel's line; NaN for pixels that tell nothing, of which files hold the population's means.
    pub fits: Vec<PixelFit>,
    /// Posterior mean of the threshold over the nominal one, and its standard deviation.
    pub threshold: Vec<[f64; 2]>,
    /// Moments over pixels without defects.
    pub population: Population,
    /// Threshold noise over the nominal threshold.
    pub sigma_t: Estimate,
    /// Quanta of light per spike of a nominal pixel: photons, counted before the gain.
    pub electrons: Estimate,
    /// Share of the dark current's shot noise that is there.
    pub dark_shot: f64,
    /// When the threshold noise is redrawn.
    pub redrawn: Redrawn,
    /// Whether the data told that rule, or it was given; else it is the nominal one, at every reset.
    pub redrawn_told: bool,
    /// Rate bias found over rate bias of noise redrawn at every readout: 1 or 0 in theory.
    pub bias_share: Estimate,
    /// Light levels, by rising light.
    pub levels: Vec<Lamp>,
    /// Relative standard error of the scale of all levels, which no recording tells: the errors of the gain's and the electrons' population hold it,
    /// those of single pixels do not.
    pub light_scale_error: f64,
    /// By how much the levels found bend against the stated ones: the relative deviation at light 1.0 less that in the dark; `None` with
    /// fewer than three lit levels.
    pub bend: Option<Estimate>,
    /// Whether that is more than the levels' uncertainty explains.
    pub bends: bool,
    /// Pixels that never fired in lit recordings.
    pub dead: Vec<usize>,
    /// Pixels whose dark current lies six robust deviations above the median.
    pub hot: Vec<usize>,
    /// Pixels whose levels do not lie on a line.
    pub misfits: Vec<usize>,
    /// Reset delay that was taken as known.
    pub lost_increment: f64,
    /// What the data could and could not tell, in sentences.
    pub notes: Vec<String>,
    /// The paper's estimator on the same data, when it was run: shown beside, and used for nothing.
    pub paper: Option<SneeMaps>,
}

impl Calibration {
    /// The calibrated camera: maps of gain, dark current and threshold voltage, and the noise found.
    ///
    /// Pixels that tell nothing get the population's means; dead ones a gain and current of zero.
    /// How `a` and `d` split into gain, current and threshold no recording tells of a single pixel. Each
    /// threshold is drawn from its posterior, with one fixed seed, and `a` and `d` follow by what its noise does to the rate: a
    /// map of posterior means would spread less than thresholds do, and the mean of their noise, `E[1 / phi^2]`, would be
    /// too small by three times the posterior's variance, 0.4 % for the published spreads. All of the threshold's spread goes to the voltage.
    ///
    /// # Errors
    /// When a value lies outside the range of its effect.
    pub fn camera(&self) -> Result<Camera> {
        let sensor = self.sensor;
        let to_pa = sensor.capacitance_ff * sensor.swing_v / (sensor.period_s() * 1e3);
        let mut maps = [Vec::new(), Vec::new(), Vec::new()];
        for ((fit, [mean, sd]), z) in self.fits.iter().zip(&self.threshold).zip(self.posterior_draws()) {
            let known = fit.a.is_finite();
            let a = if known { fit.a + z * fit.by_threshold[0] } else { self.population.mean_a.value };
            let d = if known { fit.d + z * fit.by_threshold[1] } else { self.population.mean_d.value };
            let phi = mean + z * sd;
            maps[0].push(a * phi);
            maps[1].push(d * phi * to_pa);
            maps[2].push(sensor.swing_v * phi);
        }
        for p in &self.dead {
            maps[0][*p] = 0.0;
            maps[1][*p] = 0.0;
        }
        let [gain, dark, swing] = maps;
        let redraw = if self.redrawn == Redrawn::EveryReadout { 1.0 } else { 0.0 };
        let mut camera = Camera::ideal(sensor)
            .with(
                find("shot_noise")?
                    .neutral()
                    .with("strength", 1.0)?
                    .with("counts", 1.0)?
                    .with("photons_at_full_scale", self.electrons.value)?,
            )
            .with(
                find("thermal_noise")?
                    .neutral()
                    .with("sigma", self.sigma_t.value * sensor.swing_v)?
                    .with("redraw", redraw)?,
            )
            .with(find("start_phase")?.neutral().with("share", 1.0)?);
        if self.lost_increment > 0.0 {
            camera = camera.with(find("dead_time")?.neutral().with("lost_fraction", self.lost_increment)?);
        }
        if self.dark_shot > 0.0 {
            camera = camera.with(find("dark_shot_noise")?.neutral().with("strength", self.dark_shot)?);
        }
        camera.name = "calibrated".to_owned();
        camera.source = "fitted by calibrate; see calibration.json and report.html".to_owned();
        camera.maps =
            Maps { gain: Some(gain), dark_pa: Some(dark), swing_v: Some(swing), capacitance_ff: None };
        Ok(camera)
    }

    /// Where in its threshold's posterior each pixel of the camera file lies, in standard deviations: zeros where
    /// the data do not tell the spread of thresholds.
    fn posterior_draws(&self) -> impl Iterator<Item = f64> + use<> {
        let spread = self.population.sigma_phi;
        let seeds = Seeds { camera: 0, shot: 0, sequence: 0 };
        let pattern = Pattern::new(seeds, Stream::named("calibrated thresholds"));
        // Beyond, a threshold of the widest posterior would near zero.
        pattern.normals_if(spread.value > 2.0 * spread.error).map(|z| z.clamp(-4.0, 4.0))
    }
}

//! The initial model of a search, with the origin of each parameter.

use crate::prepared::map_populations::reduced;
use crate::prepared::negative_currents::has_negative_currents;
use crate::prepared::recordings::{PreparedSet, Recordings};
use crate::sensors::model::{BASE_KNOBS, effect_or_neutral, published};
use crate::statistics::order::Spread;
use crate::thresholds::{MAX_CALIBRATION_ERROR, MAX_CALIBRATION_FACTOR};
use serde::Serialize;
use spikelane::effects::definition::ParamKind;
use spikelane::effects::{
    Camera, Definition, Maps, bias_voltage, dark_current, prnu, readout_jitter, shot_noise, start_phase,
    thermal_noise,
};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane_calibrate::{self as calibrate, Calibration, NoiseSampling, RecordingSet};

/// Origin of a parameter of the base model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum NumberSource {
    /// Calibrated from these recordings.
    Calibrated,
    /// The published model, because calibration did not determine the parameter.
    Published,
    /// A fit to the recordings that started from the published model, because calibration did not determine the
    /// parameter.
    Fitted,
    /// The camera file.
    Camera,
}

/// A parameter of the initial model of a search.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct BaseParameter {
    /// `effect.key`.
    pub parameter: String,
    /// Value.
    pub value: f64,
    /// Standard error of a calibrated parameter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
    /// Unit; empty for a ratio.
    #[serde(skip_serializing_if = "str::is_empty")]
    pub unit: &'static str,
    /// Origin.
    pub source: NumberSource,
}

impl BaseParameter {
    fn of(effect: &Definition, key: &str, value: f64, error: Option<f64>, source: NumberSource) -> Self {
        let unit = match effect.params.iter().find(|p| p.key == key).map(|p| p.kind) {
            Some(ParamKind::Number { unit, .. }) => unit.symbol(),
            _ => "",
        };
        Self { parameter: format!("{}.{key}", effect.name), value, error, unit, source }
    }
}

/// Returns the camera for the rows from `first_row` on. The row of its jitter band decreases by `first_row`. If the
/// center of the band is above the first row, the band is removed.
fn in_row_band(camera: Camera, first_row: usize) -> Camera {
    let Some(jitter) = camera.effect(readout_jitter::EFFECT.name) else { return camera };
    let moved = jitter.get("row").and_then(|row| jitter.clone().with_value("row", row - first_row as f64));
    match moved {
        Ok(jitter) => camera.with_effect(jitter),
        Err(_) => camera.without_effect(readout_jitter::EFFECT.name),
    }
}

/// The initial model of a search: its camera, the origin of its parameters, and notes for the report.
pub(crate) struct BaseModel {
    pub camera: Camera,
    pub numbers: Vec<BaseParameter>,
    pub notes: Vec<String>,
}

impl BaseModel {
    /// Returns whether a parameter has a published value. The recordings may contradict it, because it belongs to
    /// another camera.
    pub(crate) fn is_guessed(&self) -> bool {
        self.numbers.iter().any(|n| n.source == NumberSource::Published)
    }

    /// Replaces the published parameters by the values in `fitted`.
    pub(crate) fn fitted(mut self, fitted: &Camera) -> Result<Self> {
        let mut moved = Vec::new();
        for n in self.numbers.iter_mut().filter(|n| n.source == NumberSource::Published) {
            let (effect, key) = n.parameter.split_once('.').unwrap_or((&n.parameter, ""));
            if let Some(effect) = fitted.effect(effect) {
                (n.value, n.source) = (effect.get(key)?, NumberSource::Fitted);
                moved.push(n.parameter.as_str());
            }
        }
        if !moved.is_empty() {
            self.notes.push(format!(
                "Starting from these values, the following parameters were fitted to the recordings: {}.",
                moved.join(", ")
            ));
        }
        Ok(self)
    }

    /// Returns the initial model: the `given` camera, or the published model with parameters that are calibrated
    /// from the set. If the pixels of the recordings began together, the pixels of the model begin together as
    /// well.
    pub(crate) fn new(recordings: &Recordings, given: Option<&Camera>) -> Result<Self> {
        let mut base = Self::running(&recordings.fitted, given)?;
        if let Some(over) = recordings.begun_over {
            base.camera = base.camera.with_effect(start_phase::EFFECT.neutral().with_value("share", over)?);
        }
        Ok(base)
    }

    /// Returns the initial model for recordings whose pixels start at random phases.
    fn running(taken: &PreparedSet, given: Option<&Camera>) -> Result<Self> {
        let PreparedSet { set, setup, measured } = taken;
        let calibration = calibration(set);
        if calibration.as_ref().is_ok_and(|c| c.mosaic.is_some()) {
            return Err(color_filter_error(
                "pixels whose light repeats in cells of 2x2, as behind color filters",
            ));
        }
        if let Some(given) = given {
            return Self::of_camera(given, setup.row_band.map_or(0, |(first, _)| first));
        }
        let camera = published(setup)?;
        match calibration {
            Ok(c) => {
                let found = Self { camera, numbers: Vec::new(), notes: Vec::new() }.moved(&c)?;
                if has_negative_currents(setup, &measured.scans) { found.below_zero() } else { Ok(found) }
            }
            Err(why) => {
                let numbers = numbers(&camera, NumberSource::Published);
                let note = format!(
                    "There is no camera file, and the recordings could not be calibrated ({}). The published values of scsim-code are used instead. Provide a camera file if the camera has other values.",
                    why.to_string().trim_end_matches('.')
                );
                Ok(Self { camera, numbers, notes: vec![note] })
            }
        }
    }

    /// Returns the initial model of a given camera. Its pixels start at random phases, because the start is a
    /// property of a recording. Populations with the same medians and spreads replace its maps. `first_row` is the
    /// first compared row.
    fn of_camera(given: &Camera, first_row: usize) -> Result<Self> {
        let mut notes = Vec::new();
        let mut camera = given.clone().with_effect(start_phase::EFFECT.neutral().with_value("share", 1.0)?);
        if first_row > 0 {
            camera = in_row_band(camera, first_row);
        }
        if camera.maps != Maps::default() {
            camera = reduced(camera)?;
            notes.push(
                "The camera file has maps of pixels. A diagnosis compares populations, so the maps are replaced by their medians, their spreads and a log-normal tail of the dark current. A property that only the maps contain, such as hot pixels, is therefore reported as a missing effect.".to_owned(),
            );
        }
        Ok(Self { numbers: numbers(&camera, NumberSource::Camera), camera, notes })
    }

    /// Changes the model to one that keeps negative dark currents.
    fn below_zero(mut self) -> Result<Self> {
        let own = effect_or_neutral(&self.camera, &dark_current::EFFECT);
        self.camera = self.camera.with_effect(own.with_value("negative", 0.0)?);
        self.notes.push(
            "Pixels that are silent in the dark also have less charge in the light. Negative dark currents are therefore kept, although the published model sets negative dark currents to zero.".to_owned(),
        );
        Ok(self)
    }

    /// Replaces the published parameters that calibration determined with small errors.
    fn moved(mut self, c: &Calibration) -> Result<Self> {
        let (mut told, mut untold) = (Vec::new(), Vec::new());
        for (effect, key, value, error) in found(&self.camera, c) {
            let own = effect_or_neutral(&self.camera, effect);
            let published = own.get(key)?;
            let near = (1.0 / MAX_CALIBRATION_FACTOR..MAX_CALIBRATION_FACTOR).contains(&(value / published));
            let sure = error.is_finite() && error < MAX_CALIBRATION_ERROR * value.abs() && near;
            let name = format!("{}.{key}", effect.name);
            let number = if sure {
                self.camera = self.camera.with_effect(own.with_value(key, value)?);
                told.push(name);
                BaseParameter::of(effect, key, value, Some(error), NumberSource::Calibrated)
            } else {
                untold.push(name);
                BaseParameter::of(effect, key, published, None, NumberSource::Published)
            };
            self.numbers.push(number);
        }
        if c.is_noise_sampling_identified {
            let noise_sampling = if c.noise_sampling == NoiseSampling::EveryReadout { 1.0 } else { 0.0 };
            let noise = effect_or_neutral(&self.camera, &thermal_noise::EFFECT);
            self.camera = self.camera.with_effect(noise.with_value("noise_sampling", noise_sampling)?);
        }
        self.notes.push(format!(
            "There is no camera file. The following parameters were calibrated from the recordings: {}.",
            told.join(", ")
        ));
        if !untold.is_empty() {
            self.notes.push(format!(
                "Calibration did not determine {}: the published values are used.",
                untold.join(", ")
            ));
        }
        Ok(self)
    }
}

fn calibration(set: &RecordingSet) -> Result<Calibration> {
    let options = calibrate::CalibrateOptions::default();
    calibrate::measure_levels(set, &mut |_, _| {})
        .and_then(|observed| calibrate::calibrate(&observed, &options))
}

fn numbers(camera: &Camera, source: NumberSource) -> Vec<BaseParameter> {
    let of = |n: &crate::sensors::model::BaseKnob| {
        let value = camera.effect(n.effect.name)?.get(n.key).ok()?;
        Some(BaseParameter::of(n.effect, n.key, value, None, source))
    };
    BASE_KNOBS.iter().filter_map(of).collect()
}

/// Returns the calibrated base parameters: effect, key, value, and standard error.
fn found(camera: &Camera, c: &Calibration) -> Vec<(&'static Definition, &'static str, f64, f64)> {
    let (p, sensor) = (&c.population, &camera.sensor);
    let bias = camera.effect(bias_voltage::EFFECT.name).map_or(0.0, |e| e.values()[0]);
    let swing = sensor.swing_v + bias;
    let told = p.sigma_phi.value > 2.0 * p.sigma_phi.error;
    let phi = if told { p.sigma_phi.value } else { 0.0455 };
    let phi_error = if told { p.sigma_phi.error } else { f64::NAN };
    let inverse = 1.0 + phi * phi;
    let to_pa = sensor.capacitance_ff * swing / (sensor.period_s() * 1e3);
    // Returns the relative spread without that of the thresholds. The calibrated spread includes both.
    let own = |sd: f64, mean: f64| ((sd / mean).powi(2) - phi * phi).max(1e-4).sqrt();
    let own_error = |sd: f64, error: f64, mean: f64| {
        let by_phi = if told { phi * phi_error } else { 0.0 };
        (sd / mean * error / mean).hypot(by_phi) / own(sd, mean)
    };
    let (center_d, spread_d) = usual_dark(c);
    let mean_d = (center_d / inverse).max(1e-6);
    let mean_a = p.mean_a.value / inverse;
    let electrons = camera.operating_point(0.0).electrons;
    let strength = electrons / c.photons_at_full_light.value;
    let relative_d = p.sd_d.error / p.sd_d.value;
    vec![
        (&prnu::EFFECT, "mean", mean_a, p.mean_a.error),
        (
            &prnu::EFFECT,
            "sigma",
            own(p.sd_a.value, p.mean_a.value) * mean_a,
            own_error(p.sd_a.value, p.sd_a.error, p.mean_a.value) * mean_a,
        ),
        (&bias_voltage::EFFECT, "sigma", phi * swing, phi_error * swing),
        (&dark_current::EFFECT, "mean", mean_d * to_pa, p.mean_d.error * to_pa),
        (
            &dark_current::EFFECT,
            "sigma",
            own(spread_d, center_d).min(0.8) * mean_d * to_pa,
            spread_d * relative_d * to_pa,
        ),
        (&thermal_noise::EFFECT, "sigma", c.sigma_t.value * swing, c.sigma_t.error * swing),
        (
            &shot_noise::EFFECT,
            "strength",
            strength,
            strength * c.photons_at_full_light.error / c.photons_at_full_light.value,
        ),
    ]
}

/// Returns the median dark rate and its robust spread. A few hot pixels would double a standard deviation. The
/// search would have to correct the spread before it could name the hot pixels.
fn usual_dark(c: &Calibration) -> (f64, f64) {
    let d: Vec<f64> = c.fits.iter().map(|f| f.d).collect();
    let errors: Vec<f64> = c.fits.iter().map(|f| f.var_d).collect();
    let (spread, error) = (Spread::of(&d), Spread::of(&errors).median());
    (spread.median(), (spread.sd().powi(2) - error).max(0.0).sqrt())
}

/// Returns the error for a camera with color filters. A diagnosis does not support it, because its models have the
/// same light for all pixels.
pub(crate) fn color_filter_error(found: impl std::fmt::Display) -> Error {
    Error::new(ErrorKind::Input, "recordings of a diagnosis")
        .found(found)
        .expected("a camera without color filters, because all pixels of a model receive the same light")
        .remedy("calibrate the set, whose report compares the channels, or compare it with cameras")
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::presets;

    #[test]
    fn a_band_of_jitter_moves_with_the_rows_that_are_compared() {
        let measured = spikelane::presets::builtin("vidar-measured").unwrap();
        let row = |camera: &Camera| camera.effect("readout_jitter").map(|e| e.get("row").unwrap());
        assert_eq!(row(&measured), Some(206.0));
        assert_eq!(row(&in_row_band(measured.clone(), 144)), Some(62.0));
        assert_eq!(row(&in_row_band(measured, 240)), None, "the band lies above");
        let physical = spikelane::presets::builtin("physical").unwrap();
        assert_eq!(in_row_band(physical.clone(), 144), physical);
    }

    #[test]
    fn what_was_guessed_is_fitted_and_what_was_calibrated_stays() {
        let camera = presets::builtin("scsim-code").unwrap();
        let numbers = [
            BaseParameter::of(&prnu::EFFECT, "mean", 1.5, Some(0.01), NumberSource::Calibrated),
            BaseParameter::of(&shot_noise::EFFECT, "strength", 1.0, None, NumberSource::Published),
        ];
        let base = BaseModel { camera: camera.clone(), numbers: numbers.to_vec(), notes: Vec::new() };
        assert!(base.is_guessed());
        let quanta = camera.effect(shot_noise::EFFECT.name).unwrap().clone();
        let found = camera.with_effect(quanta.with_value("strength", 9.0).unwrap());
        let fitted = base.fitted(&found).unwrap();
        assert!(!fitted.is_guessed());
        let said: Vec<_> = fitted.numbers.iter().map(|n| (n.value, n.source)).collect();
        assert_eq!(said, [(1.5, NumberSource::Calibrated), (9.0, NumberSource::Fitted)]);
        assert!(fitted.notes[0].contains("shot_noise.strength") && !fitted.notes[0].contains("prnu"));
    }
}

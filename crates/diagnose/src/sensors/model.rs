//! Camera models with adjustable parameters and lamps.

use crate::events::locations::PinnedEvents;
use crate::light::lamp::{Lamp, lamps_of};
use crate::recordings::setup::Setup;
use crate::sensors::deadline::SimulationContext;
use spikelane::effects::definition::SearchScale;
use spikelane::effects::{
    Camera, Definition, Effect, bias_voltage, capacitor_mismatch, dark_current, prnu, shot_noise,
    start_phase, thermal_noise,
};
use spikelane::error::Result;

/// A camera with its adjustable parameters, and the lamps of the recordings.
#[derive(Clone, Debug)]
pub(crate) struct Model {
    pub camera: Camera,
    pub knobs: Vec<Knob>,
    /// The lamps and sources of the lit recordings.
    pub lamps: Vec<Lamp>,
    /// Number of recordings.
    pub recordings: usize,
    /// Lost and repeated readouts that simulations have at the located readouts.
    pub pinned: PinnedEvents,
    /// Cache and time limit of the simulations of this model.
    pub context: SimulationContext,
}

impl Model {
    /// Creates the base model of a camera. Its knobs are the parameters that calibration fits.
    pub(crate) fn base(camera: Camera, setup: &Setup) -> Self {
        let knob = |parameter: &BaseKnob| {
            let BaseKnob { effect, key, .. } = *parameter;
            let center = camera.effect(effect.name)?.get(key).ok()?;
            let range = (0.02 * center, 20.0 * center);
            (center > 0.0).then_some(Knob {
                effect,
                key,
                scale: SearchScale::Linear,
                center,
                unit: center,
                range,
            })
        };
        let is_determined = |parameter: &&BaseKnob| parameter.is_shown_by_static_scene || !setup.only_still();
        Self {
            knobs: BASE_KNOBS.iter().filter(is_determined).filter_map(knob).collect(),
            lamps: lamps_of(setup),
            recordings: setup.recordings.len(),
            camera,
            pinned: PinnedEvents::default(),
            context: SimulationContext::default(),
        }
    }

    /// Returns this model with another cache and deadline.
    pub(crate) fn with_context(self, context: &SimulationContext) -> Self {
        Self { context: context.clone(), ..self }
    }

    /// Returns the positions of the knobs at which their parameters have the values of `camera`.
    pub(crate) fn places_in(&self, camera: &Camera) -> Vec<f64> {
        self.knobs.iter().map(|knob| knob.position(knob.value_in(camera))).collect()
    }

    /// Returns the camera whose parameters have the knob positions `u`, with the light of each recording.
    /// `lamp_deviations` contains one relative deviation for each lamp, which is added to the offset of the lamp. A
    /// missing element counts as 0.
    pub(crate) fn sample(&self, u: &[f64], lamp_deviations: &[f64]) -> Result<Sample> {
        let mut camera = self.camera.clone();
        for (knob, u) in self.knobs.iter().zip(u) {
            let effect = effect_or_neutral(&camera, knob.effect);
            camera = camera.with_effect(effect.with_value(knob.key, knob.value(*u))?);
        }
        let mut factors = vec![1.0; self.recordings];
        for (i, lamp) in self.lamps.iter().enumerate() {
            let deviation = lamp_deviations.get(i).copied().unwrap_or(0.0);
            for (k, share) in &lamp.shares {
                factors[*k] += share * lamp.offset;
                factors[*k] += share * deviation;
            }
        }
        Ok(Sample { camera, lamps: factors, pinned: self.pinned.clone(), context: self.context.clone() })
    }
}

/// An adjustable parameter of an effect. A search changes its position instead of its value. [`Knob::value`]
/// converts a position to a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Knob {
    pub effect: &'static Definition,
    pub key: &'static str,
    pub scale: SearchScale,
    pub center: f64,
    pub unit: f64,
    /// Smallest and largest allowed value.
    pub range: (f64, f64),
}

impl Knob {
    /// Returns the value of the parameter at position `u`. Depending on `scale`, the value is a linear function of
    /// `u`, of the square root of `u`, or of the exponential of `u`.
    pub(crate) fn value(&self, u: f64) -> f64 {
        let value = match self.scale {
            SearchScale::Linear => self.center + self.unit * u,
            SearchScale::Square => self.center + self.unit * u.max(0.0).sqrt(),
            SearchScale::Log => self.center * u.exp(),
            SearchScale::LogComplement => 1.0 - (1.0 - self.center) * u.exp(),
        };
        value.clamp(self.range.0, self.range.1)
    }

    /// Returns the value of the parameter in `camera`, or the center if `camera` does not contain the effect.
    pub(crate) fn value_in(&self, camera: &Camera) -> f64 {
        camera.effect(self.effect.name).and_then(|e| e.get(self.key).ok()).unwrap_or(self.center)
    }

    /// Returns the position at which the parameter has the value `value`.
    pub(crate) fn position(&self, value: f64) -> f64 {
        let value = value.clamp(self.range.0, self.range.1);
        match self.scale {
            SearchScale::Linear => (value - self.center) / self.unit,
            SearchScale::Square => {
                let x = (value - self.center) / self.unit;
                x * x.abs()
            }
            SearchScale::Log => (value / self.center).ln(),
            SearchScale::LogComplement => ((1.0 - value) / (1.0 - self.center)).ln(),
        }
    }

    /// Limits the position `u` to the range of the parameter.
    pub(crate) fn clamped(&self, u: f64) -> f64 {
        let (a, b) = (self.position(self.range.0), self.position(self.range.1));
        u.clamp(a.min(b), a.max(b))
    }
}

/// A parameter of the base model. Calibration fits it.
pub(crate) struct BaseKnob {
    pub effect: &'static Definition,
    pub key: &'static str,
    /// Relative step of the derivative by this parameter. It is about five times the precision with which 2,000
    /// pixels determine the parameter.
    ///
    /// The derivative is the difference of two simulations, and its noise looks like information about the
    /// parameter. A larger step reduces this noise.
    pub step: f64,
    /// Whether a static scene of unknown light determines the parameter.
    ///
    /// Such a scene contains no information about the gain and the dark current. It determines only one sum of the
    /// variances of shot noise and threshold noise. The strength of the shot noise counts as known, because the
    /// capacitance determines the number of electrons per threshold.
    pub is_shown_by_static_scene: bool,
    /// Whether the parameter is a spread between pixels. Some effects couple spreads; see
    /// [`Definition::couples_spreads`].
    pub is_spread: bool,
}

const fn base_knob(
    effect: &'static Definition,
    key: &'static str,
    step: f64,
    is_shown_by_static_scene: bool,
    is_spread: bool,
) -> BaseKnob {
    BaseKnob { effect, key, step, is_shown_by_static_scene, is_spread }
}

/// The parameters of the base model, in the order of the base knobs.
pub(crate) const BASE_KNOBS: [BaseKnob; 7] = [
    // A change of the mean gain shifts the two whole numbers of readouts between which all intervals vary. With a
    // small step, most intervals keep these two numbers.
    base_knob(&prnu::EFFECT, "mean", 0.01, false, false),
    base_knob(&prnu::EFFECT, "sigma", 0.2, true, true),
    base_knob(&bias_voltage::EFFECT, "sigma", 0.2, true, true),
    base_knob(&dark_current::EFFECT, "mean", 0.05, false, false),
    // A larger step would create many nearly black pixels, whose rates deviate from their lines.
    base_knob(&dark_current::EFFECT, "sigma", 0.08, false, true),
    base_knob(&thermal_noise::EFFECT, "sigma", 0.1, true, false),
    base_knob(&shot_noise::EFFECT, "strength", 0.2, false, false),
];

/// Returns the base parameter that `knob` adjusts, or `None` if `knob` adjusts an added effect.
pub(crate) fn find_base_knob(knob: &Knob) -> Option<&'static BaseKnob> {
    BASE_KNOBS.iter().find(|n| n.effect == knob.effect && n.key == knob.key)
}

/// A camera to simulate. `lamps` contains the factor of the light of each recording, which is near 1.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    pub camera: Camera,
    pub lamps: Vec<f64>,
    /// Lost and repeated readouts that the simulation has at the located readouts.
    pub pinned: PinnedEvents,
    /// Cache and time limit of the simulation.
    pub context: SimulationContext,
}

/// Returns the effect of `camera`, or the effect at its neutral values if the camera does not have it.
pub(crate) fn effect_or_neutral(camera: &Camera, effect: &'static Definition) -> Effect {
    camera.effect(effect.name).cloned().unwrap_or_else(|| effect.neutral())
}

/// Returns the published model with the frame size and the readout rate of `setup`. It is the initial model without
/// a camera file.
pub(crate) fn published(setup: &Setup) -> Result<Camera> {
    let mut camera = spikelane::presets::builtin("scsim-code")?;
    camera.sensor.geometry = setup.geometry;
    camera.sensor.readout_hz = setup.readout_hz;
    let dark = effect_or_neutral(&camera, &dark_current::EFFECT);
    camera = camera
        .with_effect(dark.with_value("negative", 1.0)?)
        .with_effect(shot_noise::EFFECT.neutral().with_value("strength", 1.0)?)
        .with_effect(start_phase::EFFECT.neutral().with_value("share", 1.0)?)
        .without_effect(capacitor_mismatch::EFFECT.name);
    camera.name = "published".to_owned();
    Ok(camera)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base_knobs_are_parameters_of_their_effects() {
        for parameter in &BASE_KNOBS {
            parameter.effect.param_index(parameter.key).unwrap();
        }
    }
}

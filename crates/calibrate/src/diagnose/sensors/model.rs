//! A camera with knobs: the numbers that a diagnosis may turn.

use super::base::{BASE, Number};
use super::context::SimulationContext;
use super::fixed::Pinned;
use super::knob::Knob;
use super::sample::Sample;
use crate::diagnose::protocol::recorded_set::Setup;
use spikelane::effects::Camera;
use spikelane::effects::definition::SearchScale;
use spikelane::error::Result;

/// The lamp of one recording. Its light is the stated light times one plus a relative deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::diagnose) struct Lamp {
    pub recording: usize,
    /// Standard deviation of the relative deviation, as it is known before the recordings are seen.
    pub uncertainty: f64,
    /// The deviation at which sensors are simulated.
    pub offset: f64,
}

/// A camera, its knobs and the lamps of the scenes.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Model {
    pub camera: Camera,
    pub knobs: Vec<Knob>,
    /// The lamps of the lit recordings.
    pub lamps: Vec<Lamp>,
    /// Lost and repeated readouts that are not left to chance.
    pub pinned: Pinned,
    /// How its samples are simulated.
    pub context: SimulationContext,
}

impl Model {
    /// The base model of a camera: what calibration fits, and nothing else.
    pub(crate) fn base(camera: Camera, setup: &Setup) -> Self {
        let knob = |number: &Number| {
            let Number { effect, key, .. } = *number;
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
        let shown = |number: &&Number| number.shown_by_still || !setup.only_still();
        // An unknown scene's light is what its rates say.
        let lit = |k: &usize| {
            setup.recordings[*k].brightness() > 0.0 && setup.recordings[*k].static_scene.is_none()
        };
        let lamp = |k: usize| Lamp {
            recording: k,
            uncertainty: setup.recordings[k].light_uncertainty,
            offset: setup.recordings[k].light_offset,
        };
        Self {
            knobs: BASE.iter().filter(shown).filter_map(knob).collect(),
            lamps: (0..setup.recordings.len()).filter(lit).map(lamp).collect(),
            camera,
            pinned: Pinned::default(),
            context: SimulationContext::default(),
        }
    }

    /// Returns this model with another cache and deadline.
    pub(crate) fn with_context(self, context: &SimulationContext) -> Self {
        Self { context: context.clone(), ..self }
    }

    /// Where the knobs stand in `camera`.
    pub(crate) fn places_in(&self, camera: &Camera) -> Vec<f64> {
        self.knobs.iter().map(|knob| knob.position(knob.value_in(camera))).collect()
    }

    /// The sample at knob positions `u`. `moved` are relative deviations that are added to the offsets of the lamps.
    pub(crate) fn sample(&self, u: &[f64], moved: &[f64], scenes: usize) -> Result<Sample> {
        let mut camera = self.camera.clone();
        for (knob, u) in self.knobs.iter().zip(u) {
            let effect = camera.effect(knob.effect.name).cloned().unwrap_or_else(|| knob.effect.neutral());
            camera = camera.with_effect(effect.with_value(knob.key, knob.value(*u))?);
        }
        let mut factors = vec![1.0; scenes];
        for (i, lamp) in self.lamps.iter().enumerate() {
            factors[lamp.recording] = 1.0 + lamp.offset + moved.get(i).copied().unwrap_or(0.0);
        }
        Ok(Sample { camera, lamps: factors, pinned: self.pinned.clone(), context: self.context.clone() })
    }
}

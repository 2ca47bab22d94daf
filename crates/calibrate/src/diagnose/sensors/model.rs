//! A camera with knobs: the numbers that a diagnosis may turn.

use super::base::{BASE, Number};
use super::fixed::Pinned;
use super::knob::Knob;
use super::lamp::{Lamp, lamps_of};
use super::sample::Sample;
use crate::diagnose::kept::folder::Kept;
use crate::diagnose::protocol::recorded_set::Setup;
use spikelane::effects::Camera;
use spikelane::effects::definition::SearchScale;
use spikelane::error::Result;

/// A camera, its knobs and the lamps of the scenes.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Model {
    pub camera: Camera,
    pub knobs: Vec<Knob>,
    /// The lamps and sources of the lit recordings.
    pub lamps: Vec<Lamp>,
    /// Lost and repeated readouts that are not left to chance.
    pub pinned: Pinned,
    /// Where vectors of its samples are kept.
    pub kept: Option<Kept>,
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
        Self {
            knobs: BASE.iter().filter(shown).filter_map(knob).collect(),
            lamps: lamps_of(setup),
            camera,
            pinned: Pinned::default(),
            kept: None,
        }
    }

    /// The same, whose samples' vectors are looked for in `kept` and put there.
    pub(crate) fn keeping(self, kept: Option<&Kept>) -> Self {
        Self { kept: kept.cloned(), ..self }
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
            let moved = moved.get(i).copied().unwrap_or(0.0);
            for (k, share) in &lamp.shares {
                factors[*k] += share * lamp.offset;
                factors[*k] += share * moved;
            }
        }
        Ok(Sample { camera, lamps: factors, pinned: self.pinned.clone(), kept: self.kept.clone() })
    }
}

//! A camera with knobs: the numbers that a diagnosis may turn.

use super::fixed::Pinned;
use super::simulate::Sample;
use crate::diagnose::protocol::recorded_set::Setup;
use crate::effects::{Camera, find};
use crate::error::Result;

/// How a knob's position becomes a parameter's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::diagnose) enum Scale {
    /// `centre + unit u`.
    Linear,
    /// `centre + unit sqrt(u)`: statistics follow the square of a deviation.
    Square,
    /// `centre exp(u)`: shapes such as time constants.
    Log,
    /// `1 - (1 - centre) exp(u)`: what a readout keeps.
    Kept,
}

/// One number of one effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::diagnose) struct Knob {
    pub effect: &'static str,
    pub key: &'static str,
    pub scale: Scale,
    pub centre: f64,
    pub unit: f64,
    /// Allowed values.
    pub range: (f64, f64),
}

impl Knob {
    pub fn value(&self, u: f64) -> f64 {
        let value = match self.scale {
            Scale::Linear => self.centre + self.unit * u,
            Scale::Square => self.centre + self.unit * u.max(0.0).sqrt(),
            Scale::Log => self.centre * u.exp(),
            Scale::Kept => 1.0 - (1.0 - self.centre) * u.exp(),
        };
        value.clamp(self.range.0, self.range.1)
    }

    /// Its value in `camera`, the centre where that does not have its effect.
    pub fn value_in(&self, camera: &Camera) -> f64 {
        camera.effect(self.effect).and_then(|e| e.get(self.key).ok()).unwrap_or(self.centre)
    }

    /// The position that gives `value`.
    pub fn position(&self, value: f64) -> f64 {
        let value = value.clamp(self.range.0, self.range.1);
        match self.scale {
            Scale::Linear => (value - self.centre) / self.unit,
            Scale::Square => {
                let x = (value - self.centre) / self.unit;
                x * x.abs()
            }
            Scale::Log => (value / self.centre).ln(),
            Scale::Kept => ((1.0 - value) / (1.0 - self.centre)).ln(),
        }
    }

    /// `u` moved into the allowed range.
    pub fn clamped(&self, u: f64) -> f64 {
        let (a, b) = (self.position(self.range.0), self.position(self.range.1));
        u.clamp(a.min(b), a.max(b))
    }
}

/// A camera, its knobs and the lamps of the scenes.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Model {
    pub camera: Camera,
    pub knobs: Vec<Knob>,
    /// Scenes whose light is known to a thousandth only.
    pub lamps: Vec<usize>,
    /// Lost and repeated readouts that are not left to chance.
    pub pinned: Pinned,
}

/// Relative uncertainty of a level.
pub(in crate::diagnose) const LAMP: f64 = 1e-3;

impl Model {
    /// The base model of a camera: what calibration fits, and nothing else.
    pub fn base(camera: Camera, setup: &Setup) -> Self {
        let base = [
            ("prnu", "mean"),
            ("prnu", "sigma"),
            ("bias_voltage", "sigma"),
            ("dark_current", "mean"),
            ("dark_current", "sigma"),
            ("thermal_noise", "sigma"),
            ("shot_noise", "strength"),
        ];
        let knob = |(effect, key): &(&'static str, &'static str)| {
            let centre = camera.effect(effect)?.get(key).ok()?;
            let range = (0.02 * centre, 20.0 * centre);
            (centre > 0.0).then_some(Knob { effect, key, scale: Scale::Linear, centre, unit: centre, range })
        };
        // A still scene of unknown light says nothing of gain and dark current, and gives one variance for
        // quanta and threshold noise together; how many electrons make a threshold follows from the
        // capacitance, so the noise of the light is taken as known.
        const SHOWN: [(&str, &str); 3] =
            [("prnu", "sigma"), ("bias_voltage", "sigma"), ("thermal_noise", "sigma")];
        let known = |k: &Knob| setup.only_still() && !SHOWN.contains(&(k.effect, k.key));
        // An unknown scene's light is what its rates say.
        let lit = |k: &usize| setup.scenes[*k].brightness() > 0.0 && setup.scenes[*k].still.is_none();
        Self {
            knobs: base.iter().filter_map(knob).filter(|k| !known(k)).collect(),
            lamps: (0..setup.scenes.len()).filter(lit).collect(),
            camera,
            pinned: Pinned::default(),
        }
    }

    /// Where the knobs stand in `camera`.
    pub fn places_in(&self, camera: &Camera) -> Vec<f64> {
        self.knobs.iter().map(|knob| knob.position(knob.value_in(camera))).collect()
    }

    /// The sample at knob positions `u` and relative lamp errors `lamps` (one for each scene of [`Model::lamps`]).
    pub fn sample(&self, u: &[f64], lamps: &[f64], scenes: usize) -> Result<Sample> {
        let mut camera = self.camera.clone();
        for (knob, u) in self.knobs.iter().zip(u) {
            let effect = match camera.effect(knob.effect) {
                Some(effect) => effect.clone(),
                None => find(knob.effect)?.neutral(),
            };
            camera = camera.with(effect.with(knob.key, knob.value(*u))?);
        }
        let mut factors = vec![1.0; scenes];
        for (k, off) in self.lamps.iter().zip(lamps) {
            factors[*k] = 1.0 + off;
        }
        Ok(Sample { camera, lamps: factors, pinned: self.pinned.clone() })
    }
}

/// The published model at `setup`'s size: what a diagnosis starts from without a camera file.
pub(in crate::diagnose) fn published(setup: &Setup) -> Result<Camera> {
    let mut camera = crate::presets::builtin("scsim-code")?;
    camera.sensor.geometry = setup.geometry;
    camera.sensor.readout_hz = setup.readout_hz;
    let dark = camera.effect("dark_current").cloned().unwrap_or(find("dark_current")?.neutral());
    camera = camera
        .with(dark.with("negative", 1.0)?)
        .with(find("shot_noise")?.neutral().with("strength", 1.0)?)
        .with(find("start_phase")?.neutral().with("share", 1.0)?)
        .without("capacitor_mismatch");
    camera.name = "published".to_owned();
    Ok(camera)
}

//! A camera: a sensor and its effects.

use std::hash::{Hash as _, Hasher};

use crate::draws::Seeds;
use crate::error::{Error, Kind, Result};
use crate::inputs;
use crate::sensor::{FrontEnd, Sensor};
use crate::spikes::{Crop, Geometry};
use crate::threads;

use super::catalogue::clash;
use super::circuit::Circuit;
use super::definition::{Definition, Operating};
use super::effect::Effect;
use super::model::Model;
use super::{bias_voltage, dark_current, prnu, saturation_clamp, start_phase};

/// Measured per-pixel maps that replace what effects would draw.
///
/// Each holds one value per pixel, row-major, top row first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Maps {
    /// Conversion gain relative to the nominal one.
    pub gain: Option<Vec<f64>>,
    /// Dark current in picoamperes.
    pub dark_pa: Option<Vec<f64>>,
    /// Capacitance in femtofarads.
    pub capacitance_ff: Option<Vec<f64>>,
    /// Threshold voltage in volts.
    pub swing_v: Option<Vec<f64>>,
}

/// A sensor with everything that makes it imperfect.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name in reports.
    pub name: String,
    /// Where its numbers come from.
    pub source: String,
    /// Geometry, rate and nominal circuit.
    pub sensor: Sensor,
    /// How it takes stored codes as light.
    pub light: FrontEnd,
    effects: Vec<Effect>,
    /// Measured maps.
    pub maps: Maps,
    /// The whole sensor, and which of its pixels this camera is.
    pub(super) window: Option<(Geometry, Crop)>,
}

/// The most memory that drawing the fixed pattern takes for each pixel, in bytes: six maps, a copy of each for a window, and
/// four maps of an effect that is being drawn.
const BYTES_PER_PIXEL: usize = 16 * size_of::<f64>();

impl Camera {
    /// A camera without imperfections that starts with empty pixels.
    #[must_use]
    pub fn ideal(sensor: Sensor) -> Self {
        Self {
            name: "ideal".to_owned(),
            source: "no effects".to_owned(),
            sensor,
            light: FrontEnd::default(),
            effects: Vec::new(),
            maps: Maps::default(),
            window: None,
        }
    }

    /// The effects, in canonical order.
    #[must_use]
    pub fn effects(&self) -> &[Effect] {
        &self.effects
    }

    /// The effect called `name`, if this camera has it.
    #[must_use]
    pub fn effect(&self, name: &str) -> Option<&Effect> {
        self.effects.iter().find(|e| e.name() == name)
    }

    /// This camera with `effect` added, or replaced if it has one of that name.
    #[must_use]
    pub fn with(mut self, effect: Effect) -> Self {
        self.effects.retain(|e| e.name() != effect.name());
        self.effects.push(effect);
        // Those of other crates come last, by their names, so that the order in which they were added says nothing.
        let rank =
            |e: &Effect| (super::ALL.iter().position(|d| d.name == e.name()).unwrap_or(usize::MAX), e.name());
        self.effects.sort_by_key(rank);
        self
    }

    /// This camera without the effect called `name`.
    #[must_use]
    pub fn without(mut self, name: &str) -> Self {
        self.effects.retain(|e| e.name() != name);
        self
    }

    /// The camera's noise-free twin: the same sensor, clamp and start phase, no other effect.
    #[must_use]
    pub fn clean_twin(&self) -> Self {
        let mut twin = Self::ideal(self.sensor);
        twin.name = format!("{} (clean)", self.name);
        twin.source.clone_from(&self.source);
        for kept in [&start_phase::EFFECT, &saturation_clamp::EFFECT] {
            if let Some(effect) = self.effect(kept.name) {
                twin = twin.with(effect.clone());
            }
        }
        // The mean offset of the comparator belongs to the nominal threshold.
        if let Some(bias) = self.effect(bias_voltage::EFFECT.name) {
            twin.sensor.swing_v += bias.values()[0];
        }
        twin
    }

    /// Everything that what it records depends on, to the bit. Its name and where its numbers come from are no part of that.
    pub fn hash_exactly(&self, into: &mut impl Hasher) {
        let Self { name: _, source: _, sensor, light, effects, maps, window } = self;
        // Numbers are written with as many digits as tell them from every other one.
        format!("{sensor:?} {light:?} {window:?}").hash(into);
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
        effects.len().hash(into);
        for effect in effects {
            (effect.name(), bits(effect.values())).hash(into);
        }
        let Maps { gain, dark_pa, capacitance_ff, swing_v } = maps;
        for map in [gain, dark_pa, capacitance_ff, swing_v] {
            map.as_deref().map(bits).hash(into);
        }
    }

    /// The operating point of a nominal pixel whose mean increment is
    /// `increment` nominal thresholds per readout, dark current included.
    #[must_use]
    pub fn operating(&self, increment: f64) -> Operating {
        let mut circuit = Circuit::without_maps(&self.sensor);
        let mean = |d: &Definition| self.effect(d.name).map_or(0.0, |e| e.values()[0]);
        circuit.nominal_v += mean(&bias_voltage::EFFECT);
        let from_dark = circuit.thresholds_of_pa(mean(&dark_current::EFFECT));
        let from_light = increment - from_dark;
        let gain = self.effect(prnu::EFFECT.name).map_or(1.0, |e| e.values()[0]);
        Operating {
            light: from_light / (gain * circuit.sensitivity),
            from_light,
            from_dark,
            electrons: circuit.electrons(),
            swing_v: circuit.nominal_v,
            capacitance_ff: circuit.nominal_ff,
            period_s: circuit.period_s,
        }
    }

    /// Draws the fixed pattern of `seeds.camera` and collects the operations.
    ///
    /// # Errors
    /// When a measured map has another size than the sensor, an effect
    /// leaves a pixel without a positive threshold, or an effect of another crate has the name of one of this library.
    pub fn model(&self, seeds: Seeds) -> Result<Model> {
        if let Some((whole, crop)) = self.whole()? {
            return whole.model(seeds).map(|model| model.window(crop));
        }
        let sensor = self.sensor.validated()?;
        let geometry = sensor.geometry;
        inputs::check_memory(
            format_args!("camera of {geometry} pixels"),
            BYTES_PER_PIXEL * geometry.pixels(),
        )?;
        let mut circuit = Circuit::nominal(&sensor);
        let mut ops = Vec::new();
        for effect in &self.effects {
            if super::ALL.iter().any(|d| d.name == effect.name() && *d != effect.definition()) {
                return Err(clash(effect.name()));
            }
            threads::check();
            effect.edit(&sensor, &mut circuit, seeds);
            ops.extend(effect.ops(&sensor));
        }
        self.maps.apply(&mut circuit)?;
        let model = Model { circuit, ops };
        model.check_thresholds()?;
        Ok(model)
    }
}

impl Maps {
    fn apply(&self, circuit: &mut Circuit) -> Result<()> {
        let pixels = circuit.pixels();
        let pairs = [
            ("gain map", &self.gain, &mut circuit.gain),
            ("dark current map", &self.dark_pa, &mut circuit.dark_pa),
            ("capacitance map", &self.capacitance_ff, &mut circuit.capacitance_ff),
            ("threshold voltage map", &self.swing_v, &mut circuit.swing_v),
        ];
        for (what, map, target) in pairs {
            let Some(map) = map else { continue };
            if map.len() != pixels || map.iter().any(|v| !v.is_finite()) {
                return Err(Error::new(Kind::Config, what)
                    .found(format_args!("{} values", map.len()))
                    .expected(format_args!("{pixels} finite values, one per pixel")));
            }
            target.clone_from(map);
        }
        Ok(())
    }
}

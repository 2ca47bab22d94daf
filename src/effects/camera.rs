//! A camera: a sensor and its effects; and the model that they amount to.

use crate::draws::Seeds;
use crate::error::{Error, Kind, Result};
use crate::pixel::{Adaptation, Lag, Law, Op, Quanta, SlowNoise, Telegraph};
use crate::sensor::{FrontEnd, Sensor};
use crate::spikes::{Crop, Geometry};

use super::circuit::Circuit;
use super::definition::{Effect, Operating};

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
        let rank = |e: &Effect| super::ALL.iter().position(|d| d.name == e.name());
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
        for name in ["start_phase", "saturation_clamp"] {
            if let Some(effect) = self.effect(name) {
                twin = twin.with(effect.clone());
            }
        }
        // The mean offset of the comparator belongs to the nominal threshold.
        if let Some(bias) = self.effect("bias_voltage") {
            twin.sensor.swing_v += bias.values()[0];
        }
        twin
    }

    /// The operating point of a nominal pixel whose mean increment is
    /// `increment` nominal thresholds per readout, dark current included.
    #[must_use]
    pub fn operating(&self, increment: f64) -> Operating {
        let mut circuit = Circuit::without_maps(&self.sensor);
        let mean = |name: &str| self.effect(name).map_or(0.0, |e| e.values()[0]);
        circuit.nominal_v += mean("bias_voltage");
        let from_dark = circuit.thresholds_of_pa(mean("dark_current"));
        let from_light = increment - from_dark;
        let gain = self.effect("prnu").map_or(1.0, |e| e.values()[0]);
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
    /// When a measured map has another size than the sensor, or an effect
    /// leaves a pixel without a positive threshold.
    pub fn model(&self, seeds: Seeds) -> Result<Model> {
        if let Some((whole, crop)) = self.whole()? {
            return whole.model(seeds).map(|model| model.window(crop));
        }
        let sensor = self.sensor.validated()?;
        let mut circuit = Circuit::nominal(&sensor);
        let mut ops = Vec::new();
        for effect in &self.effects {
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

/// Shares of the pixel's own threshold, and charges in nominal thresholds, over which the charge at the
/// first readout is uniform.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Phases(Vec<(f64, f64)>);

impl Phases {
    /// The charge of a pixel in nominal thresholds, from two uniform values.
    #[must_use]
    pub fn charge(&self, threshold: f64, first: f64, second: f64) -> f64 {
        let charge = |&(share, charge): &(f64, f64)| share * first * threshold + charge * second;
        self.0.iter().map(charge).sum()
    }
}

/// A camera with its fixed pattern drawn: what a plan is made from.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Every pixel's circuit.
    pub circuit: Circuit,
    /// What happens at readouts.
    pub ops: Vec<Op>,
}

impl Model {
    fn check_thresholds(&self) -> Result<()> {
        let c = &self.circuit;
        let bad = (0..c.pixels()).find(|&p| {
            let finite = c.gain[p].is_finite() && c.dark_pa[p].is_finite();
            !(finite && c.capacitance_ff[p] > 0.0 && c.swing_v[p] > 0.0)
        });
        let Some(p) = bad else { return Ok(()) };
        let width = c.geometry.width();
        Err(Error::new(Kind::Config, format_args!("pixel at row {}, col {}", p / width, p % width))
            .found(format_args!(
                "{:.4} fF, {:.4} V, gain {:.4}, {:.4} pA",
                c.capacitance_ff[p], c.swing_v[p], c.gain[p], c.dark_pa[p]
            ))
            .expected("a positive threshold and finite numbers")
            .remedy("lower the spread of capacitor_mismatch or bias_voltage"))
    }

    /// The exact law of pixel `p`.
    #[must_use]
    pub fn law(&self, p: usize) -> Law {
        let c = &self.circuit;
        let nominal_fc = c.threshold_fc();
        let mut law = Law {
            threshold: c.capacitance_ff[p] * c.swing_v[p] / nominal_fc,
            gain: c.gain[p] * c.sensitivity,
            dark: c.thresholds_of_pa(c.dark_pa[p]),
            ..Law::IDEAL
        };
        for op in &self.ops {
            self.apply(*op, p, &mut law);
        }
        law
    }

    fn apply(&self, op: Op, p: usize, law: &mut Law) {
        let c = &self.circuit;
        match op {
            Op::LightQuanta { quanta, strength } => self.light_quanta(law, c.gain[p], quanta, strength),
            Op::DarkQuanta { strength } => self.dark_quanta(law, strength),
            Op::ThresholdNoise { sigma_v, redraw } => {
                law.noise = law.noise.hypot(c.capacitance_ff[p] * sigma_v / c.threshold_fc());
                law.redraw = redraw;
            }
            Op::FirstIncrement { lost } => law.lost_increment = lost,
            Op::Remainder { lost } => law.lost_remainder = lost,
            Op::Ceiling { thresholds } => law.ceiling = thresholds * law.threshold,
            Op::Flip { missed, spurious } => {
                law.missed += missed;
                law.spurious += spurious;
            }
            Op::Response { quadratic } => law.quadratic = quadratic,
            Op::Flicker { depth, frequency_hz, phase_turns } => {
                law.schedule.depth = depth;
                law.schedule.turns_per_readout = frequency_hz * c.period_s;
                law.schedule.phase_turns = phase_turns;
            }
            Op::Drift { change, readouts } => {
                law.schedule.change = change;
                law.schedule.readouts = readouts;
            }
            Op::Lag { fraction, time_constant } => {
                law.lag = Lag { fraction, kept: kept(time_constant) };
            }
            Op::Crosstalk { share } => law.crosstalk = share,
            Op::Telegraph { rate } => {
                let share = c.telegraph.get(p).copied().unwrap_or(0.0);
                law.telegraph = Telegraph { amplitude: share * law.dark, rate };
            }
            Op::Leak { fraction } => law.leak = fraction,
            Op::SpikeCoupling { charge } => law.coupling = charge,
            Op::ComparatorNoise { sigma } => law.comparator = sigma,
            Op::RowNoise { sigma } => law.row_noise = sigma,
            Op::SlowThresholdNoise { sigma, time_constant } => {
                law.slow = SlowNoise { sigma, kept: kept(time_constant) };
            }
            Op::Adaptation { rise, decay } => law.adaptation = Adaptation { rise, decay },
            Op::SupplyDroop { depth } => law.droop = depth,
            Op::Phase { .. } | Op::DropReadouts { .. } | Op::RepeatReadouts { .. } => {}
        }
    }

    fn light_quanta(&self, law: &mut Law, gain: f64, quanta: Quanta, strength: f64) {
        // Without variance there are no quanta; the dark current's must not find any of light's.
        if strength == 0.0 {
            return;
        }
        let amplitude = strength.sqrt();
        match quanta {
            Quanta::Electrons => {
                law.quantum = amplitude / self.circuit.electrons();
                law.quanta_light = law.gain.max(0.0) * self.circuit.electrons();
            }
            Quanta::Photons(at_threshold) => {
                law.quantum = amplitude * gain.abs() / at_threshold;
                law.quanta_light = self.circuit.sensitivity * at_threshold;
            }
        }
    }

    /// Dark electrons join the light's quanta. Where those are of another size
    /// (photons, or another strength), as many of them as have the variance of
    /// the electrons; only the skew then differs.
    fn dark_quanta(&self, law: &mut Law, strength: f64) {
        let electron = 1.0 / self.circuit.electrons();
        let variance = strength * law.dark.max(0.0) * electron;
        if law.quantum == 0.0 {
            law.quantum = strength.sqrt() * electron;
        }
        if law.quantum > 0.0 {
            law.quanta_dark = variance / (law.quantum * law.quantum);
        }
    }

    /// Charge at the first readout of a pixel, in nominal thresholds, from two uniform values.
    #[must_use]
    pub fn start_charge(&self, threshold: f64, first: f64, second: f64) -> f64 {
        self.phases().charge(threshold, first, second)
    }

    /// What charges at the first readout are drawn from.
    #[must_use]
    pub fn phases(&self) -> Phases {
        let of = |op: &Op| match *op {
            Op::Phase { share, charge_fc } => Some((share, charge_fc / self.circuit.threshold_fc())),
            _ => None,
        };
        Phases(self.ops.iter().filter_map(of).collect())
    }

    /// Electrons in a nominal threshold.
    #[must_use]
    pub fn electrons(&self) -> f64 {
        self.circuit.electrons()
    }
}

/// Share that a decay with this time constant leaves after a readout.
fn kept(time_constant: f64) -> f64 {
    libm::exp(-1.0 / time_constant)
}

//! The model of a camera: the circuits of its pixels and the operations at readouts.

use crate::error::{Result, error};
use crate::pixel::{Adaptation, Lag, Law, Op, Quanta, SlowNoise, Telegraph};
use crate::spikes::Crop;

use super::circuit::Circuit;

/// The distribution of the charge at the first readout: a sum of independent uniform terms.
///
/// Each term is a pair of widths. The first width is in units of the pixel's own threshold, and the second width is in
/// nominal thresholds.
///
/// # Examples
/// ```
/// use spikelane::{Camera, Seeds, Sensor, effects};
/// let phase = effects::find("start_phase")?.neutral().with_value("share", 1.0)?;
/// let camera = Camera::ideal(Sensor::new(8, 1, 20_000.0)?).with_effect(phase);
/// let phases = camera.model(Seeds::default())?.start_phases();
/// // The charge is uniform from 0 to the pixel's own threshold, here 1.5 nominal thresholds.
/// assert_eq!([0.0, 0.5].map(|u| phases.charge(1.5, u, 0.0)), [0.0, 0.75]);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StartPhases(Vec<(f64, f64)>);

impl StartPhases {
    /// Returns the start charge of a pixel in nominal thresholds, computed from the uniform values `first` and `second`
    /// in [0, 1).
    #[must_use]
    pub fn charge(&self, threshold: f64, first: f64, second: f64) -> f64 {
        let charge = |&(share, charge): &(f64, f64)| share * first * threshold + charge * second;
        self.0.iter().map(charge).sum()
    }

    #[cfg(test)]
    pub(crate) fn from_parts(parts: &[(f64, f64)]) -> Self {
        Self(parts.to_vec())
    }

    /// Returns the two widths of every term.
    pub(crate) fn parts(&self) -> &[(f64, f64)] {
        &self.0
    }
}

/// A camera whose fixed pattern has been drawn. Plans are compiled from a model.
///
/// # Examples
/// ```
/// use spikelane::{Camera, Seeds, Sensor, effects};
/// let dead = effects::find("dead_pixels")?.neutral().with_value("fraction", 1.0)?;
/// let model = Camera::ideal(Sensor::new(8, 1, 20_000.0)?).with_effect(dead).model(Seeds::default())?;
/// assert_eq!(model.circuit.pixels(), 8);
/// // Dead pixels collect no charge, whatever the light.
/// assert_eq!((model.law(3).gain, model.law(3).dark), (0.0, 0.0));
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// The circuit constants of every pixel.
    pub circuit: Circuit,
    /// The operations that every readout carries out.
    pub ops: Vec<Op>,
}

impl Model {
    pub(super) fn check_thresholds(&self) -> Result<()> {
        let c = &self.circuit;
        let bad = (0..c.pixels()).find(|&p| {
            let finite = c.gain[p].is_finite() && c.dark_pa[p].is_finite();
            !(finite && c.capacitance_ff[p] > 0.0 && c.swing_v[p] > 0.0)
        });
        let Some(p) = bad else { return Ok(()) };
        let width = c.geometry.width();
        Err(error!(Config, "pixel at row {}, col {}", p / width, p % width;
            found "{:.4} fF, {:.4} V, gain {:.4}, {:.4} pA", c.capacitance_ff[p], c.swing_v[p], c.gain[p], c.dark_pa[p];
            expected "a positive threshold and finite numbers";
            remedy "lower the spread of `capacitor_mismatch` or `bias_voltage`"))
    }

    /// Returns the exact law of pixel `p`.
    #[must_use]
    pub fn law(&self, p: usize) -> Law {
        let c = &self.circuit;
        let nominal_fc = c.threshold_fc();
        let mut law = Law {
            threshold: c.capacitance_ff[p] * c.swing_v[p] / nominal_fc,
            gain: c.gain[p] * c.sensitivity,
            dark: c.thresholds_per_readout(c.dark_pa[p]),
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
            Op::ThresholdNoise { sigma_v, noise_sampling } => {
                law.threshold_noise =
                    law.threshold_noise.hypot(c.capacitance_ff[p] * sigma_v / c.threshold_fc());
                law.noise_sampling = noise_sampling;
            }
            Op::FirstIncrement { lost } => law.lost_increment = lost,
            Op::Remainder { lost } => law.lost_remainder = lost,
            Op::Ceiling { thresholds } => law.ceiling = thresholds * law.threshold,
            Op::Flip { missed_spikes: missed, false_spikes: spurious } => {
                law.missed_spikes += missed;
                law.false_spikes += spurious;
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
                law.lag = Lag { fraction, retention: retention(time_constant) };
            }
            Op::Crosstalk { share } => law.crosstalk = share,
            Op::Telegraph { rate } => {
                let share = c.telegraph.get(p).copied().unwrap_or(0.0);
                law.telegraph = Telegraph { amplitude: share * law.dark, rate };
            }
            Op::CorrelatedQuanta { time_constant } => law.quanta_retention = retention(time_constant),
            Op::ReadoutJitter { width } => {
                law.jitter_width = width * c.jitter_share.get(p).copied().unwrap_or(0.0)
            }
            Op::Leak { fraction } => law.leak = fraction,
            Op::SpikeCoupling { charge } => law.coupling = charge,
            Op::ComparatorNoise { sigma } => law.comparator_noise = sigma,
            Op::RowNoise { sigma } => law.row_noise = sigma,
            Op::SlowThresholdNoise { sigma, time_constant } => {
                law.slow_noise = SlowNoise { sigma, retention: retention(time_constant) };
            }
            Op::Adaptation { rise, retention: decay } => {
                law.adaptation = Adaptation { rise, retention: decay }
            }
            Op::SupplyDroop { depth } => law.droop = depth,
            // A pixel's law does not contain these operations. `start_phases` and the plan's readout faults execute them
            // instead.
            Op::Phase { .. } | Op::DropReadouts { .. } | Op::RepeatReadouts { .. } => {}
        }
    }

    fn light_quanta(&self, law: &mut Law, gain: f64, quanta: Quanta, strength: f64) {
        // If the strength is 0, light has no quanta. `law.quantum` then stays 0, and `dark_quanta` sets the size of the
        // quanta.
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

    /// Adds the electrons of the dark current to the quanta of the light.
    ///
    /// A quantum of the light has another size than an electron if the quanta are photons or if the light has another
    /// noise strength than the dark current. The number of dark quanta is then scaled so that the variance of the dark
    /// charge is unchanged. Only the skewness changes.
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

    /// Returns the charge of a pixel at the first readout in nominal thresholds.
    ///
    /// `first` and `second` are uniform values in [0, 1).
    #[must_use]
    pub fn start_charge(&self, threshold: f64, first: f64, second: f64) -> f64 {
        self.start_phases().charge(threshold, first, second)
    }

    /// Returns the distribution of the charge at the first readout.
    #[must_use]
    pub fn start_phases(&self) -> StartPhases {
        let phase_of = |op: &Op| match *op {
            Op::Phase { share, charge_fc } => Some((share, charge_fc / self.circuit.threshold_fc())),
            _ => None,
        };
        StartPhases(self.ops.iter().filter_map(phase_of).collect())
    }

    /// Returns the number of electrons in a nominal threshold.
    #[must_use]
    pub fn electrons(&self) -> f64 {
        self.circuit.electrons()
    }
}

impl Model {
    /// Returns the part of this model for the pixels of `crop`, which must lie within the sensor.
    pub(super) fn window(mut self, crop: Crop) -> Self {
        #[rustfmt::skip]
        let Circuit {
            geometry, capacitance_ff, swing_v, gain, dark_pa, telegraph, jitter_share,
            // All pixels have the same value of these fields.
            period_s: _, nominal_ff: _, nominal_v: _, sensitivity: _,
        } = &mut self.circuit;
        for column in [capacitance_ff, swing_v, gain, dark_pa, telegraph, jitter_share] {
            if !column.is_empty() {
                *column = crop.pick(*geometry, column);
            }
        }
        if let Ok(part) = crop.geometry(*geometry) {
            *geometry = part;
        }
        self
    }
}

/// Returns the factor by which an exponential decay shrinks during one readout. `time_constant` is in readouts.
fn retention(time_constant: f64) -> f64 {
    libm::exp(-1.0 / time_constant)
}

//! The model that a camera amounts to: its pixels' circuits, and what happens at readouts.

use crate::error::{Error, Kind, Result};
use crate::pixel::{Adaptation, Lag, Law, Op, Quanta, SlowNoise, Telegraph};
use crate::spikes::Crop;

use super::circuit::Circuit;

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

    #[cfg(test)]
    pub(crate) fn of(parts: &[(f64, f64)]) -> Self {
        Self(parts.to_vec())
    }

    /// Shares and charges.
    pub(crate) fn parts(&self) -> &[(f64, f64)] {
        &self.0
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
    pub(super) fn check_thresholds(&self) -> Result<()> {
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
            Op::QuantaSettle { time_constant } => law.settling = kept(time_constant),
            Op::Undecided { width } => law.undecided = width * c.undecided.get(p).copied().unwrap_or(0.0),
            Op::Leak { fraction } => law.leak = fraction,
            Op::SpikeCoupling { charge } => law.coupling = charge,
            Op::ComparatorNoise { sigma } => law.comparator = sigma,
            Op::RowNoise { sigma } => law.row_noise = sigma,
            Op::SlowThresholdNoise { sigma, time_constant } => {
                law.slow = SlowNoise { sigma, kept: kept(time_constant) };
            }
            Op::Adaptation { rise, decay } => law.adaptation = Adaptation { rise, decay },
            Op::SupplyDroop { depth } => law.droop = depth,
            // No law of a pixel at its readouts: `phases`, and the plan's losses.
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

impl Model {
    /// The pixels of `crop`, which lies within this model's sensor.
    pub(super) fn window(mut self, crop: Crop) -> Self {
        let Circuit {
            geometry,
            capacitance_ff,
            swing_v,
            gain,
            dark_pa,
            telegraph,
            undecided,
            // What all pixels share.
            period_s: _,
            nominal_ff: _,
            nominal_v: _,
            sensitivity: _,
        } = &mut self.circuit;
        for column in [capacitance_ff, swing_v, gain, dark_pa, telegraph, undecided] {
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

/// Share that a decay with this time constant leaves after a readout.
fn kept(time_constant: f64) -> f64 {
    libm::exp(-1.0 / time_constant)
}

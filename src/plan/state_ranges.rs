//! The value ranges of a saved state. The kernels require that all values are within these ranges.

use std::ops::RangeInclusive;

use crate::draws::gauss;
use crate::plan::dynamics::{AdaptationRule, Dynamics};
use crate::plan::state::{
    ADAPTATION_COLUMN, LAG_COLUMN, SLOW_NOISE_COLUMN, SimulatorState, TELEGRAPH_COLUMN,
};
use crate::plan::{NoiseTable, Plan, Rules};

/// The last readout that a run supports. At 20 kHz it is 7 million years after the start.
const MAX_READOUT: u64 = 1 << 62;

/// Largest rounding error of one `f32` operation, relative to its result.
const HALF_ULP: f64 = 1.0 / 16_777_216.0;

impl SimulatorState {
    /// Returns a description of a value that no run of `plan` can produce, or `None`.
    ///
    /// The state must have the columns of the plan. If the result is `None`, a run can produce each single value of the
    /// state. `docs/why/fixed-point.md`, "Saved states", derives the ranges.
    pub(crate) fn fault(&self, plan: &Plan) -> Option<&'static str> {
        let is_mask = |column: &[i16]| column.iter().all(|v| matches!(v, 0 | -1));
        if self.readout > MAX_READOUT {
            Some("a number of readouts that no run reaches")
        } else if !is_mask(&self.fired) || !is_mask(&self.slow_state[TELEGRAPH_COLUMN]) {
            Some("a flag that is neither 0 nor 1")
        } else if self.surplus.iter().any(|n| *n < 0) {
            Some("a surplus below 0")
        } else if resets_below_threshold(plan) && self.charge.iter().any(|steps| *steps >= 0) {
            Some("a charge above the threshold after a reset")
        } else if !self.frozen_noise_is_drawable(plan.tables().noise.as_ref()) {
            Some("threshold noise outside the range of all draws")
        } else if plan
            .dynamics()
            .is_some_and(|dynamics| !self.slow_state_is_reachable(dynamics, plan.rules()))
        {
            Some("a threshold or late light that no run reaches")
        } else if !self.last_frame_is_padded(plan.geometry().pixels()) {
            Some("spikes outside the sensor")
        } else {
            None
        }
    }

    /// Returns whether every frozen value is between the noise of the smallest draw and the noise of the largest draw.
    fn frozen_noise_is_drawable(&self, noise: Option<&NoiseTable>) -> bool {
        let frozen = self.frozen_noise.iter().enumerate();
        match noise {
            None => self.frozen_noise.iter().all(|v| *v == 0),
            Some(NoiseTable::Whole(multipliers)) => frozen.zip(multipliers).all(|((_, v), m)| {
                // This is the rounded multiplication of the kernels. Its result is a monotonic function of the draw.
                let scaled = |draw: i16| (i32::from(draw) * i32::from(*m) + (1 << 14)) >> 15;
                (scaled(-gauss::MAX_DRAW)..=scaled(gauss::MAX_DRAW)).contains(&i32::from(*v))
            }),
            Some(NoiseTable::Fine(per_unit)) => frozen.zip(per_unit).all(|((p, whole), per_unit)| {
                let fraction = self.frozen_noise_fraction.get(p).copied().unwrap_or(0) as u16;
                let value = i32::from(*whole) << 16 | i32::from(fraction);
                let max_draw = (f32::from(gauss::MAX_DRAW) * per_unit).round_ties_even() as i32;
                (-max_draw..=max_draw).contains(&value)
            }),
        }
    }

    fn slow_state_is_reachable(&self, dynamics: &Dynamics, rules: &Rules) -> bool {
        let slow = dynamics.slow_noise.map_or(0.0, |slow| f64::from(slow.bound));
        let adapted = dynamics.adaptation.map_or(0.0, max_rise);
        let late = max_effective_light(dynamics, rules);
        let is_within = |at: usize, range: RangeInclusive<f64>| {
            let words = self.slow_state[at].iter().zip(&self.slow_state[at + 1]);
            let mut values = words
                .map(|(high, low)| f32::from_bits(u32::from(*high as u16) << 16 | u32::from(*low as u16)));
            values.all(|value| range.contains(&f64::from(value)))
        };
        is_within(SLOW_NOISE_COLUMN, -slow..=slow)
            && is_within(ADAPTATION_COLUMN, 0.0..=adapted)
            && is_within(LAG_COLUMN, -late..=late)
    }

    /// Returns whether the stored last readout contains only zeros after the last pixel. If the readout has an odd
    /// number of bytes, the unused byte of the last entry must be zero too.
    fn last_frame_is_padded(&self, pixels: usize) -> bool {
        // Each entry contains two bytes, which are the bits of 16 pixels.
        let first = pixels / 16;
        let padding = |at: usize| if at == first { -1_i16 << (pixels % 16) } else { -1 };
        (first..self.last_frame.len()).all(|at| self.last_frame[at] & padding(at) == 0)
    }
}

/// Returns whether the kernels of the plan compute a reset as `max(charge, charge - threshold)` of unsigned words.
///
/// The maximum of the unsigned words is a correct reset only if the charge before the reset is below two thresholds.
/// The charge, which is counted from the threshold, is then negative after the reset.
fn resets_below_threshold(plan: &Plan) -> bool {
    let (tables, rules) = (plan.tables(), plan.rules());
    let is_unbounded = !rules.counts_surplus && tables.ceiling.is_empty();
    is_unbounded && tables.jitter_width.is_empty() && plan.dynamics().is_none() && !rules.has_extras()
}

/// Returns the highest rise `a` of a threshold, including rounding errors. It is the fixed point of
/// `a <- (1 - decay) a + rise`, or `max_rise` if the fixed point is larger.
fn max_rise(adaptation: AdaptationRule) -> f64 {
    let [rise, fall, highest] = [adaptation.rise, adaptation.decay, adaptation.max_rise].map(f64::from);
    let net = fall - 4.0 * HALF_ULP;
    if net > 0.0 { highest.min(rise * (1.0 + HALF_ULP) / net) } else { highest }
}

/// Returns the largest effective light of a pixel, in 1/255 of full scale, including rounding errors.
fn max_effective_light(dynamics: &Dynamics, rules: &Rules) -> f64 {
    let factor = dynamics.schedule.map_or(1.0, |schedule| schedule.max_factor());
    let light = (f64::from(rules.max_light) * factor).min(f64::from(dynamics.peak));
    (light + light * light * f64::from(dynamics.quadratic)) * (1.0 + 16.0 * HALF_ULP)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draws::Seeds;
    use crate::effects::{ALL, Camera};
    use crate::sensor::Sensor;

    fn plan(effects: &[&str]) -> Plan {
        let camera =
            effects.iter().fold(Camera::ideal(Sensor::new(21, 5, 20_000.0).unwrap()), |camera, name| {
                let definition = ALL.iter().find(|d| d.name == *name).unwrap();
                let typical = definition.params.iter().fold(definition.neutral(), |effect, param| {
                    effect.with_value(param.key, param.typical).unwrap()
                });
                camera.with_effect(typical)
            });
        Plan::new(&camera, Seeds::default()).unwrap()
    }

    fn set_word(state: &mut SimulatorState, at: usize, value: f32) {
        state.slow_state[at][3] = (value.to_bits() >> 16) as i16;
        state.slow_state[at + 1][3] = value.to_bits() as i16;
    }

    #[test]
    fn the_smallest_draw_is_the_largest_with_a_minus() {
        assert_eq!((0..=u16::MAX).map(gauss::draw).min(), Some(-gauss::MAX_DRAW));
    }

    #[test]
    fn a_charge_above_the_threshold_is_refused_where_a_reset_leaves_none() {
        let plan = plan(&[]);
        let mut state = plan.initial_state();
        assert_eq!(state.fault(&plan), None);
        state.charge[3] = 0;
        assert!(state.fault(&plan).is_some());
    }

    #[test]
    fn frozen_noise_beyond_the_largest_draw_is_refused() {
        let plan = plan(&["thermal_noise"]);
        let mut state = plan.initial_state();
        assert!(!state.frozen_noise.is_empty(), "the noise is frozen");
        assert_eq!(state.fault(&plan), None);
        state.frozen_noise[3] = i16::MAX;
        assert!(state.fault(&plan).is_some());
    }

    #[test]
    fn lingering_values_beyond_their_bounds_are_refused() {
        for (effect, at, wrong) in [
            ("slow_threshold_noise", SLOW_NOISE_COLUMN, 1.0),
            ("adaptation", ADAPTATION_COLUMN, 2.9),
            ("adaptation", ADAPTATION_COLUMN, -1e-3),
            ("image_lag", LAG_COLUMN, 256.0),
            ("image_lag", LAG_COLUMN, f32::NAN),
        ] {
            let plan = plan(&[effect]);
            let mut state = plan.initial_state();
            assert_eq!(state.fault(&plan), None, "{effect}");
            set_word(&mut state, at, wrong);
            assert!(state.fault(&plan).is_some(), "{effect} {wrong}");
        }
    }
}

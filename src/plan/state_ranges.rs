//! The ranges of a saved state, which the kernels rely on.

use std::ops::RangeInclusive;

use crate::draws::gauss;
use crate::plan::moving::{Adaptation, Moving};
use crate::plan::state::{ADAPTED, LATE, LOW, SLOW, State};
use crate::plan::{NoiseTable, Plan, Rules};

/// The last readout that a run can reach: 7 million years at 20 kHz.
const MAX_READOUT: u64 = 1 << 62;

/// Rounding of one operation of `f32`, relative to its result.
const ROUNDING: f64 = 1.0 / 16_777_216.0;

impl State {
    /// Returns what no run of `plan` leaves behind, if this state holds such a thing. The state has the plan's columns.
    ///
    /// Any other value is a state that a run may have. `docs/why/fixed-point.md`, "Saved states", derives the ranges.
    pub(crate) fn fault(&self, plan: &Plan) -> Option<&'static str> {
        let is_mask = |column: &[i16]| column.iter().all(|v| matches!(v, 0 | -1));
        if self.readout > MAX_READOUT {
            Some("a number of readouts that no run reaches")
        } else if !is_mask(&self.fired) || !is_mask(&self.lingering[LOW]) {
            Some("a mark that is neither set nor unset")
        } else if self.surplus.iter().any(|n| *n < 0) {
            Some("a surplus below 0")
        } else if resets_below_threshold(plan) && self.charge.iter().any(|steps| *steps >= 0) {
            Some("a charge above the threshold after a reset")
        } else if !self.held_is_drawn(plan.tables().noise.as_ref()) {
            Some("threshold noise that no draw gives")
        } else if plan.moving().is_some_and(|moving| !self.lingering_is_reached(moving, plan.rules())) {
            Some("a threshold or late light that no run reaches")
        } else if !self.repeated_is_padded(plan.geometry().pixels()) {
            Some("spikes outside of the sensor")
        } else {
            None
        }
    }

    /// Whether every frozen value is one that the largest draws include.
    fn held_is_drawn(&self, noise: Option<&NoiseTable>) -> bool {
        let held = self.held.iter().enumerate();
        match noise {
            None => self.held.iter().all(|v| *v == 0),
            Some(NoiseTable::Whole(multipliers)) => held.zip(multipliers).all(|((_, v), m)| {
                // The rounding multiply of the kernels, whose result grows with the draw.
                let scaled = |draw: i16| (i32::from(draw) * i32::from(*m) + (1 << 14)) >> 15;
                (scaled(-gauss::LARGEST)..=scaled(gauss::LARGEST)).contains(&i32::from(*v))
            }),
            Some(NoiseTable::Fine(per_unit)) => held.zip(per_unit).all(|((p, whole), per_unit)| {
                let fraction = self.held_fraction.get(p).copied().unwrap_or(0) as u16;
                let value = i32::from(*whole) << 16 | i32::from(fraction);
                let most = (f32::from(gauss::LARGEST) * per_unit).round_ties_even() as i32;
                (-most..=most).contains(&value)
            }),
        }
    }

    fn lingering_is_reached(&self, moving: &Moving, rules: &Rules) -> bool {
        let slow = moving.slow.map_or(0.0, |slow| f64::from(slow.bound));
        let adapted = moving.adaptation.map_or(0.0, highest);
        let late = brightest(moving, rules);
        let is_within = |at: usize, range: RangeInclusive<f64>| {
            let words = self.lingering[at].iter().zip(&self.lingering[at + 1]);
            let mut values = words
                .map(|(high, low)| f32::from_bits(u32::from(*high as u16) << 16 | u32::from(*low as u16)));
            values.all(|value| range.contains(&f64::from(value)))
        };
        is_within(SLOW, -slow..=slow) && is_within(ADAPTED, 0.0..=adapted) && is_within(LATE, -late..=late)
    }

    /// Whether bits behind the last pixel of the last readout, and the second byte of an odd last one, are 0.
    fn repeated_is_padded(&self, pixels: usize) -> bool {
        // Two bytes of a readout are one value.
        let first = pixels / 16;
        let padding = |at: usize| if at == first { -1_i16 << (pixels % 16) } else { -1 };
        (first..self.last.len()).all(|at| self.last[at] & padding(at) == 0)
    }
}

/// Whether the kernel of the plan resets by `max(charge, charge - threshold)` of unsigned words, which requires charge below
/// one threshold before each reset, hence below zero after it.
fn resets_below_threshold(plan: &Plan) -> bool {
    let (tables, rules) = (plan.tables(), plan.rules());
    let is_unbounded = !rules.surplus && tables.ceiling.is_empty();
    is_unbounded && tables.undecided.is_empty() && plan.moving().is_none() && !rules.extras()
}

/// The highest rise of a threshold: the fixed point of `a <- (a - a fall) + rise`, with the rounding of its operations.
fn highest(adaptation: Adaptation) -> f64 {
    let [rise, fall, highest] = [adaptation.rise, adaptation.fall, adaptation.highest].map(f64::from);
    let net = fall - 4.0 * ROUNDING;
    if net > 0.0 { highest.min(rise * (1.0 + ROUNDING) / net) } else { highest }
}

/// The brightest light that acts on a pixel, in 1/255 of full scale, with the rounding of its operations.
fn brightest(moving: &Moving, rules: &Rules) -> f64 {
    let factor = moving.schedule.map_or(1.0, |schedule| schedule.greatest());
    let light = (f64::from(rules.greatest_light) * factor).min(f64::from(moving.peak));
    (light + light * light * f64::from(moving.quadratic)) * (1.0 + 16.0 * ROUNDING)
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
                    effect.with(param.key, param.typical).unwrap()
                });
                camera.with(typical)
            });
        Plan::new(&camera, Seeds::default()).unwrap()
    }

    fn set_word(state: &mut State, at: usize, value: f32) {
        state.lingering[at][3] = (value.to_bits() >> 16) as i16;
        state.lingering[at + 1][3] = value.to_bits() as i16;
    }

    #[test]
    fn the_smallest_draw_is_the_largest_with_a_minus() {
        assert_eq!((0..=u16::MAX).map(gauss::unit).min(), Some(-gauss::LARGEST));
    }

    #[test]
    fn a_charge_above_the_threshold_is_refused_where_a_reset_leaves_none() {
        let plan = plan(&[]);
        let mut state = plan.start();
        assert_eq!(state.fault(&plan), None);
        state.charge[3] = 0;
        assert!(state.fault(&plan).is_some());
    }

    #[test]
    fn frozen_noise_beyond_the_largest_draw_is_refused() {
        let plan = plan(&["thermal_noise"]);
        let mut state = plan.start();
        assert!(!state.held.is_empty(), "the noise is frozen");
        assert_eq!(state.fault(&plan), None);
        state.held[3] = i16::MAX;
        assert!(state.fault(&plan).is_some());
    }

    #[test]
    fn lingering_values_beyond_their_bounds_are_refused() {
        for (effect, at, wrong) in [
            ("slow_threshold_noise", SLOW, 1.0),
            ("adaptation", ADAPTED, 2.9),
            ("adaptation", ADAPTED, -1e-3),
            ("image_lag", LATE, 256.0),
            ("image_lag", LATE, f32::NAN),
        ] {
            let plan = plan(&[effect]);
            let mut state = plan.start();
            assert_eq!(state.fault(&plan), None, "{effect}");
            set_word(&mut state, at, wrong);
            assert!(state.fault(&plan).is_some(), "{effect} {wrong}");
        }
    }
}

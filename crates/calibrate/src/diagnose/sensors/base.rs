//! The numbers of the base model: what calibration fits.

use super::knob::Knob;
use spikelane::effects::{Definition, bias_voltage, dark_current, prnu, shot_noise, thermal_noise};

/// One of them.
pub(in crate::diagnose) struct Number {
    pub effect: &'static Definition,
    pub key: &'static str,
    /// Step for the derivative by it, relative to its value: some five of the deviations to which 2,000 pixels tell it. What
    /// noise moves looks like information, and the less the larger the step is.
    pub step: f64,
    /// Whether a still scene of unknown light shows it. That says nothing of gain and dark current, and gives one variance for
    /// quanta and threshold noise together; how many electrons make a threshold follows from the
    /// capacitance, so the noise of the light is taken as known.
    pub shown_by_still: bool,
    /// Whether it is a spread that effects can couple to others, see [`Definition::couples_spreads`].
    pub is_spread: bool,
}

const fn number(
    effect: &'static Definition,
    key: &'static str,
    step: f64,
    shown_by_still: bool,
    is_spread: bool,
) -> Number {
    Number { effect, key, step, shown_by_still, is_spread }
}

/// In the order of the base knobs.
pub(in crate::diagnose) const BASE: [Number; 7] = [
    // It moves every lattice of intervals; a small step keeps them in place.
    number(&prnu::EFFECT, "mean", 0.01, false, false),
    number(&prnu::EFFECT, "sigma", 0.2, true, true),
    number(&bias_voltage::EFFECT, "sigma", 0.2, true, true),
    number(&dark_current::EFFECT, "mean", 0.05, false, false),
    // Pixels that are nearly black, of which there are suddenly more, stray from their lines.
    number(&dark_current::EFFECT, "sigma", 0.08, false, true),
    number(&thermal_noise::EFFECT, "sigma", 0.1, true, false),
    number(&shot_noise::EFFECT, "strength", 0.2, false, false),
];

/// What is known of a knob's number; nothing of an effect's.
pub(in crate::diagnose) fn number_of(knob: &Knob) -> Option<&'static Number> {
    BASE.iter().find(|n| n.effect == knob.effect && n.key == knob.key)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_of_the_base_model_is_one_of_its_effects() {
        for number in &BASE {
            number.effect.param_index(number.key).unwrap();
        }
    }
}

//! A pixel's law with the threshold in whole steps, and the units of the tables.

use crate::pixel::Law;
use crate::plan::PIXEL_ALIGNMENT;
use crate::plan::step_scale::StepScale;

/// Number of units of an increment in one step.
pub(super) const FRACTION_UNITS_PER_STEP: f64 = 65_536.0;

/// Number of units of light in full scale. The kernels use this unit.
pub(super) const LIGHT_UNITS_AT_FULL_SCALE: f64 = 255.0;

/// A pixel's law, and the threshold in whole steps.
pub(super) struct RoundedLaw<'a> {
    pub law: &'a Law,
    pub threshold_steps: f64,
    /// Number of steps per nominal threshold of charge: the rounded threshold in steps divided by the exact threshold.
    pub steps_per_charge: f64,
}

impl<'a> RoundedLaw<'a> {
    pub(super) fn new(law: &'a Law, scale: &StepScale) -> Self {
        let rounded = (law.threshold * f64::from(scale.steps)).round();
        Self { law, threshold_steps: rounded, steps_per_charge: rounded / law.threshold }
    }
}

/// Converts a probability to units of 2^-32.
pub(super) fn probability(p: f64) -> u32 {
    (p * 4_294_967_296.0).min(f64::from(u32::MAX)) as u32
}

/// Returns a table with one value per pixel, padded with `filler` to a multiple of [`PIXEL_ALIGNMENT`].
pub(super) fn pad<T: Clone>(
    laws: &[RoundedLaw<'_>],
    filler: T,
    value: impl Fn(&RoundedLaw<'_>) -> T,
) -> Vec<T> {
    let padded = laws.len().next_multiple_of(PIXEL_ALIGNMENT);
    // The capacity includes the padding. Otherwise the padding could exceed the capacity, and the vector would double
    // its memory.
    let mut table = Vec::with_capacity(padded);
    table.extend(laws.iter().map(value));
    table.resize(padded, filler);
    table
}

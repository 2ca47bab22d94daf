//! Upper bounds on the error of the fixed-point arithmetic. `docs/why/fixed-point.md` derives these bounds.

use crate::plan::step_scale::StepScale;
use crate::plan::tables::ROUND_UP_MARGIN;

/// Upper bounds on the difference between the integer arithmetic and the exact law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorBounds {
    /// Absolute error of the rate, in spikes per readout.
    ///
    /// If charge is lost (at a clamp, or at a reset that loses a remainder), the rate is a discontinuous function of
    /// the light. `rate_absolute` then bounds the absolute error of the mean increment, in thresholds.
    pub rate_absolute: f64,
    /// Relative error of the rate, or of the mean increment if charge is lost.
    pub rate_relative: f64,
    /// Relative error of the phase variance that each spike adds.
    pub phase_variance_relative: f64,
    /// If the charge is not clamped: the largest surplus charge that is stored exactly, in whole thresholds.
    pub max_surplus: u32,
}

pub(super) fn error_bounds(scale: &StepScale) -> ErrorBounds {
    let f32_half_ulp = 0.5f64.powi(24);
    // Four values are rounded, each by up to half an ulp: the entry of the gain table, its product with the light, the
    // entry of the dark table, and the sum. Rounding to an integer then adds at most half of 1/65,536 step. If
    // increments are rounded up, the tables are also raised by five half ulps and half of 1/65,536 step.
    let (raised, half) = if scale.rounds_increments_up { (ROUND_UP_MARGIN, 0.5) } else { (0.0, 0.0) };
    let rate_relative = 4.0 * f32_half_ulp + raised;
    let rate_absolute = (0.5 + half) / 65_536.0 / f64::from(scale.steps);
    // The multiplier of a deviation is an integer of at least 122 with an error of at most 0.5. The relative error of
    // the variance is twice the relative error of the multiplier.
    let phase_variance_relative = 2.0 * 0.5 / scale.smallest_deviation();
    ErrorBounds { rate_absolute, rate_relative, phase_variance_relative, max_surplus: i16::MAX as u32 }
}

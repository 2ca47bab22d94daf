//! What fixed point may add to the law, derived in `docs/why/fixed-point.md`.

use crate::plan::scale::Scale;
use crate::plan::tables::RAISED;

/// Upper bounds on the difference between the integers and the exact law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Absolute error of the rate in spikes per readout. Where charge is lost (a clamp that is reached, a reset that keeps
    /// no remainder) the rate jumps with the light, and this is the error of the mean increment in thresholds.
    pub rate_absolute: f64,
    /// Relative error of the rate, or of the mean increment where charge is lost.
    pub rate_relative: f64,
    /// Relative error of the phase variance that a spike adds.
    pub phase_variance_relative: f64,
    /// Longest stretch above full scale, in whole thresholds of surplus charge, where charge is not clamped.
    pub longest_surplus: u32,
}

pub(super) fn of(scale: &Scale) -> Bounds {
    let f32_half_ulp = 0.5f64.powi(24);
    // Gain or dark table, product, sum, and the rounding to an integer: four half ulps; the
    // integer itself is known to half of 1/65,536 step.
    // Increments that are rounded up are raised by five and by half a unit besides.
    let (raised, half) = if scale.rounds_up { (RAISED, 0.5) } else { (0.0, 0.0) };
    let rate_relative = 4.0 * f32_half_ulp + raised;
    let rate_absolute = (0.5 + half) / 65_536.0 / f64::from(scale.steps);
    // The standard deviation's integer (half of 122), twice in a variance.
    let phase_variance_relative = 2.0 * 0.5 / scale.smallest_deviation();
    Bounds { rate_absolute, rate_relative, phase_variance_relative, longest_surplus: i16::MAX as u32 }
}

//! Spikes that the readout loses.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `missed_spikes`.
pub static EFFECT: Definition = Definition::new(
    "missed_spikes",
    "A spike is not reported; the charge is gone all the same.",
    "bit errors",
    &[Param::number("probability", Unit::One, (0.0, 1.0), 0.0, 1e-3, "per spike")
        .tried(Tried::amplitude((0.0, 0.2), &[1e-4, 2e-3, 0.02]))],
)
.with_ops(ops)
.with_moments(moments);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Flip { missed: v[0], spurious: 0.0 }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // Thinning a regular train: a reported interval is a geometric number of true ones, of
    // variance v / (1 - v)^2 in true intervals, and the squared rate takes (1 - v)^2 off.
    Some(Moments { rate: -v[0] * at.increment().min(1.0), phase_variance: v[0], spatial_variance: 0.0 })
}

//! A threshold that remembers spikes.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `adaptation`.
pub static EFFECT: Definition = Definition::new(
    "adaptation",
    "Every spike raises the threshold, which then falls back exponentially.",
    "charge trapped at the comparator; spike-frequency adaptation of neuron models",
    &[
        Param::number(
            "rise",
            Unit::One,
            (0.0, 0.02),
            0.0,
            0.001,
            "rise per spike, relative to the threshold",
        )
        .tried(Tried::amplitude((0.0, 0.02), &[0.002])),
        Param::number(
            "decay",
            Unit::One,
            (0.7, 0.9995),
            0.99,
            0.99,
            "share of the rise that a readout leaves",
        )
        .tried(Tried::kept((0.8, 0.999), &[0.85, 0.95, 0.99, 0.998])),
    ],
)
.with_ops(ops)
.with_moments(moments);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Adaptation { rise: v[0], decay: v[1] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // After n = 1/x readouts a rise r has fallen to r d^(n-1), and those of all spikes before add up.
    let x = at.increment();
    let raised = v[0] * libm::pow(v[1], 1.0 / x - 1.0) / (1.0 - libm::pow(v[1], 1.0 / x));
    Some(Moments { rate: x / (1.0 + raised) - x, ..Moments::default() })
}

//! A threshold that remembers spikes.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values, no_edit};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `adaptation`.
pub const EFFECT: Definition = Definition {
    name: "adaptation",
    summary: "Every spike raises the threshold, which then falls back exponentially.",
    source: "charge trapped at the comparator; spike-frequency adaptation of neuron models",
    params: &[
        Param::number("rise", Unit::One, (0.0, 0.01), 0.0, 0.001, "rise per spike, relative to the threshold"),
        Param::number("decay", Unit::One, (0.8, 0.999), 0.99, 0.99, "share of the rise that a readout leaves"),
    ],
    edit: no_edit,
    ops,
    moments,
};

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Adaptation { rise: v[0], decay: v[1] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // After n = 1/x readouts a rise r has fallen to r d^(n-1), and those of all spikes before add up.
    let x = at.increment();
    let raised = v[0] * libm::pow(v[1], 1.0 / x - 1.0) / (1.0 - libm::pow(v[1], 1.0 / x));
    Some(Moments { rate: x / (1.0 + raised) - x, ..Moments::default() })
}

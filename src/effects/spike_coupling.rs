//! A spike that disturbs its neighbours.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values, no_edit};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `spike_coupling`.
pub const EFFECT: Definition = Definition {
    name: "spike_coupling",
    summary: "A spike adds charge to its four neighbours at the next readout.",
    source: "parasitic capacitance between reset lines and neighbouring nodes",
    params: &[
        Param::number("charge", Unit::One, (-0.015, 0.015), 0.0, 0.003, "charge given to each neighbour, in its own thresholds"),
    ],
    edit: no_edit,
    ops,
    moments,
};

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::SpikeCoupling { charge: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // f = x + 4 q f away from the border.
    let x = at.increment();
    Some(Moments { rate: 4.0 * v[0] * x / (1.0 - 4.0 * v[0]), ..Moments::default() })
}

//! Readouts that are written twice.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values, no_edit};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `repeated_readouts`.
pub const EFFECT: Definition = Definition {
    name: "repeated_readouts",
    summary: "All bits of a readout are replaced by those of the readout before it.",
    source: "a sender that repeats its buffer when the next readout is late",
    params: &[
        Param::number("probability", Unit::One, (0.0, 0.5), 0.0, 1e-3, "per readout"),
    ],
    edit: no_edit,
    ops,
    moments,
};

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::RepeatReadouts { probability: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // The two bits differ with probability 2 min(x, 1 - x), 1/x times an interval.
    let x = at.increment().min(1.0);
    Some(Moments { phase_variance: 2.0 * v[0] * x.min(1.0 - x) / x, ..Moments::default() })
}

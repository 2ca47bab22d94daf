//! Noise of the comparison.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values, no_edit};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `comparator_noise`.
pub const EFFECT: Definition = Definition {
    name: "comparator_noise",
    summary: "Every comparison has an error of its own that is not subtracted at the reset: a spike comes early or late, and the next interval makes up for it.",
    source: "input-referred noise of a clocked comparator",
    params: &[
        Param::number("sigma", Unit::One, (0.0, 0.03), 0.0, 0.005, "standard deviation relative to the threshold"),
    ],
    edit: no_edit,
    ops,
    moments,
};

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::ComparatorNoise { sigma: v[0] }]
}

fn moments(_: Values<'_>, _: &Operating) -> Option<Moments> {
    // No charge is gained or lost, so neither rate nor growth of the variance changes.
    Some(Moments::default())
}

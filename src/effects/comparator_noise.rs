//! Noise of the comparison.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `comparator_noise`.
pub static EFFECT: Definition = Definition::new(
    "comparator_noise",
    "Every comparison has an error of its own that is not subtracted at the reset: a \
     spike comes early or late, and the next interval makes up for it.",
    "input-referred noise of a clocked comparator",
    &[Param::number(
        "sigma",
        Unit::One,
        (0.0, 0.06),
        0.0,
        0.005,
        "standard deviation relative to the threshold",
    )
    .tried(Tried::deviation((0.0, 0.05), &[0.004, 0.015]))],
)
.with_ops(ops)
.with_moments(moments);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::ComparatorNoise { sigma: v[0] }]
}

fn moments(_: Values<'_>, _: &Operating) -> Option<Moments> {
    // No charge is gained or lost, so neither rate nor growth of the variance changes.
    Some(Moments::default())
}

//! The reset takes time: the first increment after a spike is shortened.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values, no_edit};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `dead_time`.
pub const EFFECT: Definition = Definition {
    name: "dead_time",
    summary: "The first increment after a spike, light and dark, loses a share of itself.",
    source: "published code of SCSim: 100 ns of 50 us",
    params: &[Param::number(
        "lost_fraction",
        Unit::One,
        (0.0, 0.5),
        0.0,
        0.002,
        "lost share of one increment",
    )],
    edit: no_edit,
    ops,
    moments,
};

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::FirstIncrement { lost: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // f = x - r x f while x < 1.
    let x = at.increment();
    Some(Moments { rate: x / (1.0 + v[0] * x) - x, ..Moments::default() })
}

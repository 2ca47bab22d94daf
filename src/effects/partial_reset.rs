//! A reset that does not keep all of the charge above the threshold.

use crate::effects::definition::{Definition, Param, Values, no_edit};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `partial_reset`.
pub const EFFECT: Definition = Definition {
    name: "partial_reset",
    summary: "A spike loses a share of the charge that exceeds the threshold: 0 is a soft reset, 1 a hard one.",
    source: "hard reset: SpikeCV's image converter, SpikingSIM",
    params: &[Param::number(
        "lost_remainder",
        Unit::One,
        (0.0, 1.0),
        0.0,
        0.05,
        "lost share of the remaining charge",
    )],
    edit: no_edit,
    ops,
    moments: |_, _| None,
};

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Remainder { lost: v[0] }]
}

//! A reset that does not keep all of the charge above the threshold.

use crate::effects::definition::{Definition, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `partial_reset`.
pub static EFFECT: Definition = Definition::new(
    "partial_reset",
    "A spike loses a share of the charge that exceeds the threshold: 0 is a soft \
     reset, 1 a hard one.",
    "hard reset: SpikeCV's image converter, SpikingSIM",
    &[Param::number(
        "lost_remainder",
        Unit::One,
        (0.0, 1.0),
        0.0,
        0.05,
        "lost share of the remaining charge",
    )
    .tried(Tried::amplitude((0.0, 1.0), &[0.02, 0.25, 0.8]))],
)
.with_ops(ops);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Remainder { lost: v[0] }]
}

//! Light that reaches the neighbours.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `crosstalk`.
pub static EFFECT: Definition = Definition::new(
    "crosstalk",
    "A pixel gives a share of its light to its four neighbours and gets theirs; at \
     the border the share stays.",
    "optical crosstalk between microlenses; diffusion of carriers",
    &[Param::number(
        "share",
        Unit::One,
        (0.0, 0.12),
        0.0,
        0.02,
        "share of the light given to the four neighbours together",
    )
    .tried(Tried::amplitude((0.0, 0.12), &[0.004, 0.03]))],
)
.with_ops(ops)
.with_moments(moments)
.part_of_a_scene();

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Crosstalk { share: v[0] }]
}

fn moments(_: Values<'_>, _: &Operating) -> Option<Moments> {
    // Even light stays as it is.
    Some(Moments::default())
}

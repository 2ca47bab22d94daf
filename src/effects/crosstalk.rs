//! Light that reaches the neighbours.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values, no_edit};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `crosstalk`.
pub const EFFECT: Definition = Definition {
    name: "crosstalk",
    summary: "A pixel gives a share of its light to its four neighbours and gets theirs; at the border the share stays.",
    source: "optical crosstalk between microlenses; diffusion of carriers",
    params: &[
        Param::number("share", Unit::One, (0.0, 0.06), 0.0, 0.02, "share of the light given to the four neighbours together"),
    ],
    edit: no_edit,
    ops,
    moments,
};

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Crosstalk { share: v[0] }]
}

fn moments(_: Values<'_>, _: &Operating) -> Option<Moments> {
    // Even light stays as it is.
    Some(Moments::default())
}

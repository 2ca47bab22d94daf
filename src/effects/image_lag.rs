//! Light that arrives late.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values, no_edit};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `image_lag`.
pub const EFFECT: Definition = Definition {
    name: "image_lag",
    summary: "A share of the light joins an exponential queue and turns into charge later; nothing is lost.",
    source: "incomplete charge transfer of pinned photodiodes",
    params: &[
        Param::number("fraction", Unit::One, (0.0, 0.05), 0.0, 0.01, "late share of the light"),
        Param::number("time_constant", Unit::Readout, (1.0, 20000.0), 50.0, 50.0, "after which 1/e of it is still to come"),
    ],
    edit: no_edit,
    ops,
    moments,
};

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Lag { fraction: v[0], time_constant: v[1] }]
}

fn moments(_: Values<'_>, _: &Operating) -> Option<Moments> {
    // Steady light arrives in full; the first frame is taken to have been there before.
    Some(Moments::default())
}

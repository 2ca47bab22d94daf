//! Light that arrives late.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `image_lag`.
pub static EFFECT: Definition = Definition::new(
    "image_lag",
    "A share of the light joins an exponential queue and turns into charge later; \
     nothing is lost.",
    "incomplete charge transfer of pinned photodiodes",
    &[
        Param::number("fraction", Unit::One, (0.0, 0.1), 0.0, 0.01, "late share of the light")
            .tried(Tried::amplitude((0.0, 0.1), &[0.01])),
        Param::number(
            "time_constant",
            Unit::Readout,
            (1.0, 20000.0),
            50.0,
            50.0,
            "after which 1/e of it is still to come",
        )
        .tried(Tried::shape((2.0, 600.0), &[8.0, 40.0, 150.0])),
    ],
)
.with_ops(ops)
.with_moments(moments)
.part_of_a_scene();

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Lag { fraction: v[0], time_constant: v[1] }]
}

fn moments(_: Values<'_>, _: &Operating) -> Option<Moments> {
    // Steady light arrives in full, once the first of it has come late.
    Some(Moments::default())
}

//! Charge is not proportional to light.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `response_nonlinearity`.
pub static EFFECT: Definition = Definition::new(
    "response_nonlinearity",
    "Light acts as light (1 + b light): the gain changes with the light; the dark \
     current keeps its own.",
    "linearity error of EMVA 1288; the diode's capacitance depends on its voltage",
    &[Param::number(
        "quadratic",
        Unit::One,
        (-0.2, 0.2),
        0.0,
        0.02,
        "relative change of the response at full scale",
    )
    .tried(Tried::amplitude((-0.15, 0.15), &[-0.01, 0.01, 0.06, -0.06]))],
)
.with_ops(ops)
.with_moments(moments)
.part_of_a_scene();

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Response { quadratic: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    Some(Moments { rate: v[0] * at.light * at.from_light, ..Moments::default() })
}

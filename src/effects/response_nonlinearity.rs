//! Charge is not proportional to light.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values, no_edit};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `response_nonlinearity`.
pub const EFFECT: Definition = Definition {
    name: "response_nonlinearity",
    summary: "Light acts as light (1 + b light): the gain changes with the light; the dark current keeps its own.",
    source: "linearity error of EMVA 1288; the diode's capacitance depends on its voltage",
    params: &[
        Param::number("quadratic", Unit::One, (-0.1, 0.1), 0.0, 0.02, "relative change of the response at full scale"),
    ],
    edit: no_edit,
    ops,
    moments,
};

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Response { quadratic: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    Some(Moments { rate: v[0] * at.light * at.from_light, ..Moments::default() })
}

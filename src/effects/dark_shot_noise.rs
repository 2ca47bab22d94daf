//! Shot noise of the dark current.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values, no_edit};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `dark_shot_noise`.
pub const EFFECT: Definition = Definition {
    name: "dark_shot_noise",
    summary: "The dark current arrives in electrons, as light does.",
    source: "Poisson statistics; absent from SCSim",
    params: &[Param::number(
        "strength",
        Unit::One,
        (0.0, 100.0),
        0.0,
        1.0,
        "factor on the variance; 1 is the physics",
    )],
    edit: no_edit,
    ops,
    moments,
};

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::DarkQuanta { strength: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    let phase_variance = v[0] * at.from_dark / at.increment() / at.electrons;
    Some(Moments { phase_variance, ..Moments::default() })
}

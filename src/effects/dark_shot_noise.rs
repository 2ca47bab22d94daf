//! Shot noise of the dark current.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `dark_shot_noise`.
pub static EFFECT: Definition = Definition::new(
    "dark_shot_noise",
    "The dark current arrives in electrons, as light does.",
    "Poisson statistics; absent from SCSim",
    &[Param::number(
        "strength",
        Unit::One,
        (0.0, 10_000.0),
        0.0,
        1.0,
        "factor on the variance; 1 is the physics",
    )
    .tried(Tried::amplitude((0.0, 2.0), &[0.4]))],
)
.with_ops(ops)
.with_moments(moments)
.part_of_a_scene();

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::DarkQuanta { strength: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    let phase_variance = v[0] * at.from_dark / at.increment() / at.electrons;
    Some(Moments { phase_variance, ..Moments::default() })
}

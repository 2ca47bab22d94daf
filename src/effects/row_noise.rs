//! Noise that a row shares.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `row_noise`.
pub static EFFECT: Definition = Definition::new(
    "row_noise",
    "At every readout all thresholds of a row move together: compared with and \
     subtracted.",
    "row noise of EMVA 1288: the line driver and its supply",
    &[Param::number(
        "sigma",
        Unit::One,
        (0.0, 0.06),
        0.0,
        0.005,
        "standard deviation relative to the threshold",
    )
    .tried(Tried::deviation((0.0, 0.05), &[0.002, 0.012]))],
)
.with_ops(ops)
.with_moments(moments);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::RowNoise { sigma: v[0] }]
}

fn moments(_: Values<'_>, _: &Operating) -> Option<Moments> {
    // Drawn at every readout it selects its low draws, as thermal_noise does; no closed form in general.
    None
}

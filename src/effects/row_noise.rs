//! Noise that a row shares.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values, no_edit};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `row_noise`.
pub const EFFECT: Definition = Definition {
    name: "row_noise",
    summary: "At every readout all thresholds of a row move together: compared with and subtracted.",
    source: "row noise of EMVA 1288: the line driver and its supply",
    params: &[
        Param::number("sigma", Unit::One, (0.0, 0.03), 0.0, 0.005, "standard deviation relative to the threshold"),
    ],
    edit: no_edit,
    ops,
    moments,
};

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::RowNoise { sigma: v[0] }]
}

fn moments(_: Values<'_>, _: &Operating) -> Option<Moments> {
    // Drawn at every readout it selects its low draws, as thermal_noise does; no closed form in general.
    None
}

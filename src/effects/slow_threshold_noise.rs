//! A threshold that wanders.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values, no_edit};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `slow_threshold_noise`.
pub const EFFECT: Definition = Definition {
    name: "slow_threshold_noise",
    summary: "The threshold wanders about its mean with a correlation time of many readouts (Ornstein-Uhlenbeck).",
    source: "low-frequency noise of the comparator; one time constant of a 1/f spectrum",
    params: &[
        Param::number("sigma", Unit::One, (0.0, 0.01), 0.0, 0.003, "standard deviation relative to the threshold"),
        Param::number("time_constant", Unit::Readout, (100.0, 20000.0), 1000.0, 1000.0, "the correlation falls to 1/e"),
    ],
    edit: no_edit,
    ops,
    moments,
};

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::SlowThresholdNoise { sigma: v[0], time_constant: v[1] }]
}

fn moments(_: Values<'_>, _: &Operating) -> Option<Moments> {
    // Between that of a frozen and of a redrawn threshold; no closed form in general.
    None
}

//! A threshold that wanders.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `slow_threshold_noise`.
pub static EFFECT: Definition = Definition::new(
    "slow_threshold_noise",
    "The threshold wanders about its mean with a correlation time of many readouts \
     (Ornstein-Uhlenbeck).",
    "low-frequency noise of the comparator; one time constant of a 1/f spectrum",
    &[
        Param::number(
            "sigma",
            Unit::One,
            (0.0, 0.02),
            0.0,
            0.003,
            "standard deviation relative to the threshold",
        )
        .tried(Tried::deviation((0.0, 0.02), &[0.002, 0.006])),
        Param::number(
            "time_constant",
            Unit::Readout,
            (30.0, 50000.0),
            1000.0,
            1000.0,
            "the correlation falls to 1/e",
        )
        .tried(Tried::shape((30.0, 5e4), &[150.0, 1000.0, 6000.0])),
    ],
)
.with_ops(ops)
.with_moments(moments);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::SlowThresholdNoise { sigma: v[0], time_constant: v[1] }]
}

fn moments(_: Values<'_>, _: &Operating) -> Option<Moments> {
    // Between that of a frozen and of a redrawn threshold; no closed form in general.
    None
}

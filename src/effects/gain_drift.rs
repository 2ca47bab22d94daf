//! The gain changes slowly and steadily.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `gain_drift`.
pub static EFFECT: Definition = Definition::new(
    "gain_drift",
    "The gain of the light changes linearly over a number of readouts, and stays there.",
    "temperature and lamp drift during a recording",
    &[
        Param::number(
            "relative_change",
            Unit::One,
            (-0.5, 0.5),
            0.0,
            0.01,
            "change of the gain when it is over",
        )
        .tried(Tried::amplitude((-0.3, 0.3), &[0.004, -0.004, 0.05, -0.05])),
        Param::number(
            "duration",
            Unit::Readout,
            (1.0, 1e9),
            10000.0,
            10000.0,
            "readouts that the change takes: the length of the recording",
        )
        .tried(Tried::recording_length()),
    ],
)
.with_ops(ops)
.with_moments(moments);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Drift { change: v[0], readouts: v[1] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // The mean over the duration is half of the change.
    Some(Moments { rate: 0.5 * v[0] * at.from_light, ..Moments::default() })
}

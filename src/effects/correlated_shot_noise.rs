//! Shot noise that arrives over some readouts.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `correlated_shot_noise`. It holds for the quanta of light and dark current alike: both are gathered in one
/// photodiode. The mean of the light is not late; `image_lag` is for that.
pub static EFFECT: Definition = Definition::new(
    "correlated_shot_noise",
    "The photodiode's bandwidth: what the quanta of light and dark current stray from their mean by flows into the pixel \
     exponentially. Neighbouring readouts share it, and over long times nothing of it is missing.",
    "shot noise through a first-order low-pass (Schottky noise of a photocurrent beside the diode's resistance and capacitance); \
     the still rows of a static recording of a 400x250 camera have 12 readouts",
    &[Param::number(
        "time_constant",
        Unit::Readout,
        (0.0, 100.0),
        0.0,
        12.0,
        "after which 1/e of what the quanta strayed by is still to come; it needs `shot_noise` or `dark_shot_noise`",
    )
    .tried(Tried::amplitude((0.0, 100.0), &[2.0, 8.0, 30.0]))],
)
.with_ops(ops)
.with_moments(moments);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::QuantaSettle { time_constant: v[0] }]
}

fn moments(_: Values<'_>, _: &Operating) -> Option<Moments> {
    // Nothing is lost: neither the rate nor the long-time growth of the variance changes.
    Some(Moments::default())
}

//! Light that swings with the mains or the refresh of a screen.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `flicker`.
pub static EFFECT: Definition = Definition::new(
    "flicker",
    "Light is multiplied by 1 + m sin(2 pi f t + p).",
    "lamps at twice the frequency of the mains; screens at their refresh rate",
    &[
        Param::number("depth", Unit::One, (0.0, 0.2), 0.0, 0.02, "amplitude relative to the light")
            .tried(Tried::amplitude((0.0, 0.2), &[0.01])),
        Param::number("frequency_hz", Unit::Hertz, (0.0, 1e6), 100.0, 100.0, "swings per second")
            .tried(Tried::line((1.0, 1e4), &[80.0, 400.0, 2000.0])),
        Param::number("phase", Unit::One, (0.0, 1.0), 0.0, 0.0, "phase at the first readout, in turns"),
    ],
)
.with_ops(ops)
.with_moments(moments);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Flicker { depth: v[0], frequency_hz: v[1], phase_turns: v[2] }]
}

fn moments(_: Values<'_>, _: &Operating) -> Option<Moments> {
    // Over whole swings the mean stays.
    Some(Moments::default())
}

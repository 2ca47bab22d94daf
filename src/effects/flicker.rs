//! Light that swings with the mains or the refresh of a screen.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values, no_edit};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `flicker`.
pub const EFFECT: Definition = Definition {
    name: "flicker",
    summary: "Light is multiplied by 1 + m sin(2 pi f t + p).",
    source: "lamps at twice the frequency of the mains; screens at their refresh rate",
    params: &[
        Param::number("depth", Unit::One, (0.0, 0.1), 0.0, 0.02, "amplitude relative to the light"),
        Param::number("frequency_hz", Unit::Hertz, (0.0, 1e6), 100.0, 100.0, "swings per second"),
        Param::number("phase", Unit::One, (0.0, 1.0), 0.0, 0.0, "phase at the first readout, in turns"),
    ],
    edit: no_edit,
    ops,
    moments,
};

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Flicker { depth: v[0], frequency_hz: v[1], phase_turns: v[2] }]
}

fn moments(_: Values<'_>, _: &Operating) -> Option<Moments> {
    // Over whole swings the mean stays.
    Some(Moments::default())
}

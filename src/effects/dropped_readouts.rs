//! Readouts that are lost on the way.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values, no_edit};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `dropped_readouts`.
pub const EFFECT: Definition = Definition {
    name: "dropped_readouts",
    summary: "All bits of a readout are lost; the scene goes on, and the file still holds the number of frames that was asked for.",
    source: "a full buffer or a lost packet between camera and disk",
    params: &[
        Param::number("probability", Unit::One, (0.0, 0.5), 0.0, 1e-3, "per readout"),
    ],
    edit: no_edit,
    ops,
    moments,
};

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::DropReadouts { probability: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // Phase advances by x unseen and takes Bernoulli(x) spikes along, p/x times an interval.
    Some(Moments { phase_variance: v[0] * (1.0 - at.increment().min(1.0)), ..Moments::default() })
}

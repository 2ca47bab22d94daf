//! Readouts that are written twice.

use crate::effects::definition::{Definition, Events, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `repeated_readouts`.
pub static EFFECT: Definition = Definition::new(
    "repeated_readouts",
    "All bits of a readout are replaced by those of the readout before it.",
    "a sender that repeats its buffer when the next readout is late",
    &[Param::number("probability", Unit::One, (0.0, 0.5), 0.0, 1e-3, "per readout")
        .tried(Tried::amplitude((0.0, 0.2), &[0.001, 0.01]))],
)
.with_ops(ops)
.with_moments(moments)
.with_events(Events::RepeatedReadouts);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::RepeatReadouts { probability: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // The two bits differ with probability 2 min(x, 1 - x), 1/x times an interval.
    let x = at.increment().min(1.0);
    Some(Moments { phase_variance: 2.0 * v[0] * x.min(1.0 - x) / x, ..Moments::default() })
}

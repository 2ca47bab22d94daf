//! Readouts that are lost on the way.

use crate::effects::definition::{Definition, Events, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `dropped_readouts`.
pub static EFFECT: Definition = Definition::new(
    "dropped_readouts",
    "All bits of a readout are lost; the scene goes on, and the file still holds the \
     number of frames that was asked for.",
    "a full buffer or a lost packet between camera and disk",
    &[Param::number("probability", Unit::One, (0.0, 0.5), 0.0, 1e-3, "per readout")
        .tried(Tried::amplitude((0.0, 0.2), &[0.001, 0.01]))],
)
.with_ops(ops)
.with_moments(moments)
.with_events(Events::LostReadouts);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::DropReadouts { probability: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // Phase advances by x unseen and takes Bernoulli(x) spikes along, p/x times an interval.
    Some(Moments { phase_variance: v[0] * (1.0 - at.increment().min(1.0)), ..Moments::default() })
}

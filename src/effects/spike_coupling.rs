//! A spike that disturbs its neighbours.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `spike_coupling`.
pub static EFFECT: Definition = Definition::new(
    "spike_coupling",
    "A spike adds charge to its four neighbours at the next readout.",
    "parasitic capacitance between reset lines and neighbouring nodes",
    &[Param::number(
        "charge",
        Unit::One,
        (-0.03, 0.03),
        0.0,
        0.003,
        "charge given to each neighbour, in its own thresholds",
    )
    .tried(Tried::amplitude((-0.03, 0.03), &[0.001, -0.001, 0.008, -0.008]))],
)
.with_ops(ops)
.with_moments(moments)
.part_of_a_scene();

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::SpikeCoupling { charge: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // f = x + 4 q f away from the border.
    let x = at.increment();
    Some(Moments { rate: 4.0 * v[0] * x / (1.0 - 4.0 * v[0]), ..Moments::default() })
}

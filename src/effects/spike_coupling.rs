//! Spikes that change the charge of the neighboring pixels.

use crate::effects::definition::{AmbiguityGroup, Definition, Moments, OperatingPoint, Param, SearchSpec, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `spike_coupling`.
pub static EFFECT: Definition = Definition::new(
    "spike_coupling",
    "A spike of a pixel adds charge to its four neighbors at the next readout.",
    "parasitic capacitance between reset lines and neighboring nodes",
    &[Param::number(
        "charge",
        Unit::Dimensionless,
        (-0.03, 0.03),
        0.0,
        0.003,
        "charge that each neighbor receives, relative to the threshold of the neighbor",
    )
    .with_search(SearchSpec::amplitude((-0.03, 0.03), &[0.001, -0.001, 0.008, -0.008]))],
)
.with_ops(ops)
.with_moments(moments)
.scene_like()
.with_ambiguity_groups(&[AmbiguityGroup::Neighbors]);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::SpikeCoupling { charge: v[0] }]
}

fn moments(v: Values<'_>, at: &OperatingPoint) -> Option<Moments> {
    // Let x be the increment and q the charge that a spike adds to each neighbor. Away from the border, the rate f
    // solves f = x + 4 q f.
    let x = at.increment();
    Some(Moments { rate: 4.0 * v[0] * x / (1.0 - 4.0 * v[0]), ..Moments::default() })
}

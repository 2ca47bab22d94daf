//! Spikes that change the charge of the neighboring pixels.

use super::prelude::*;

/// The effect `spike_coupling`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "spike_coupling",
    "A spike of a pixel adds charge to its four neighbors at the next readout.",
    "parasitic capacitance between reset lines and neighboring nodes",
    &[Param::number("charge", Unit::Dimensionless, (-0.03, 0.03), 0.0, 0.003, "charge that each neighbor receives, relative to the threshold of the neighbor")
        .with_search(SearchSpec::amplitude((-0.03, 0.03), &[0.001, -0.001, 0.008, -0.008]))],
)
.with_ops(|v, _| vec![Op::SpikeCoupling { charge: v[0] }])
.with_moments(|v, at| {
    // Let x be the increment and q the charge that a spike adds to each neighbor. Away from the border, the rate f
    // solves f = x + 4 q f.
    let x = at.increment();
    Some(Moments { rate: 4.0 * v[0] * x / (1.0 - 4.0 * v[0]), ..Moments::default() })
})
.scene_like()
.with_ambiguity_groups(&[AmbiguityGroup::Neighbors]);

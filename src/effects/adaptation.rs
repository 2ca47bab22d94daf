//! Adaptation: every spike raises the threshold, which then decays.

use super::prelude::*;

/// The effect `adaptation`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "adaptation",
    "Every spike raises the threshold of its pixel. The threshold then decays exponentially to its original value.",
    "charge trapped at the comparator; spike-frequency adaptation of neuron models",
    &[
        Param::number("rise", Unit::Dimensionless, (0.0, 0.02), 0.0, 0.001, "rise of the threshold per spike, relative to the threshold")
            .with_search(SearchSpec::amplitude((0.0, 0.02), &[0.002])),
        Param::number("retention", Unit::Dimensionless, (0.7, 0.9995), 0.99, 0.99, "share of the threshold rise that remains after one readout")
            .with_search(SearchSpec::retention((0.8, 0.999), &[0.85, 0.95, 0.99, 0.998])),
    ],
)
.with_ops(|v, _| vec![Op::Adaptation { rise: v[0], retention: v[1] }])
.with_moments(|v, at| {
    // Let r be the threshold rise of a spike, d the retention per readout, and n = 1/x the readouts per interval. At the
    // next spike the rise is r d^(n-1). The rises of all earlier spikes add up to a geometric series.
    let x = at.increment();
    let raised = v[0] * libm::pow(v[1], 1.0 / x - 1.0) / (1.0 - libm::pow(v[1], 1.0 / x));
    Some(Moments { rate: x / (1.0 + raised) - x, ..Moments::default() })
})
.with_ambiguity_groups(&[AmbiguityGroup::Response, AmbiguityGroup::Memory]);

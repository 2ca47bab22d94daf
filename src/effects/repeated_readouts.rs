//! Readouts that are written twice.

use super::prelude::*;

/// The effect `repeated_readouts`.
pub static EFFECT: Definition = Definition::new(
    "repeated_readouts",
    "The file contains the spikes of the previous readout again in place of the spikes of a readout.",
    "a sender that repeats its buffer if the next readout is late",
    &[Param::number("probability", Unit::Dimensionless, (0.0, 0.5), 0.0, 1e-3, "probability that the previous readout replaces a readout")
        .with_search(SearchSpec::amplitude((0.0, 0.2), &[0.001, 0.01]))],
)
.with_ops(|v, _| vec![Op::RepeatReadouts { probability: v[0] }])
.with_moments(|v, at| {
    // Let x be the increment. The bits of two successive readouts differ with probability 2 min(x, 1 - x).
    // An interval contains 1/x readouts.
    let x = at.increment().min(1.0);
    Some(Moments { phase_variance: 2.0 * v[0] * x.min(1.0 - x) / x, ..Moments::default() })
})
.with_event_kind(EventKind::RepeatedReadouts)
.with_ambiguity_groups(&[AmbiguityGroup::SingleReadouts]);

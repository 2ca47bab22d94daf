//! Spikes that are not reported.

use super::prelude::*;

/// The effect `missed_spikes`.
pub static EFFECT: Definition = Definition::new(
    "missed_spikes",
    "The camera does not report a spike of a pixel. The pixel is reset as after every spike.",
    "bit errors",
    &[Param::number("probability", Unit::Dimensionless, (0.0, 1.0), 0.0, 1e-3, "probability that a spike is not reported")
        .with_search(SearchSpec::amplitude((0.0, 0.2), &[1e-4, 2e-3, 0.02]))],
)
.with_ops(|v, _| vec![Op::Flip { missed_spikes: v[0], false_spikes: 0.0 }])
// Let v be the probability that a spike is missed. A reported interval then consists of a geometric number of equal
// true intervals. The variance of the number of true intervals is v / (1 - v)^2. The squared rate has the factor (1
// - v)^2. The product of the variance and this factor is v.
.with_moments(|v, at| Some(Moments { rate: -v[0] * at.increment().min(1.0), phase_variance: v[0], spatial_variance: 0.0 }))
.with_ambiguity_groups(&[AmbiguityGroup::SingleReadouts, AmbiguityGroup::IrregularIntervals]);

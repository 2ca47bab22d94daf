//! Spikes that are not reported.

use crate::effects::definition::{AmbiguityGroup, Definition, Moments, OperatingPoint, Param, SearchSpec, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `missed_spikes`.
pub static EFFECT: Definition = Definition::new(
    "missed_spikes",
    "The camera does not report a spike of a pixel. The pixel is reset as after every spike.",
    "bit errors",
    &[Param::number("probability", Unit::Dimensionless, (0.0, 1.0), 0.0, 1e-3, "probability that a spike is not reported")
        .with_search(SearchSpec::amplitude((0.0, 0.2), &[1e-4, 2e-3, 0.02]))],
)
.with_ops(ops)
.with_moments(moments)
.with_ambiguity_groups(&[AmbiguityGroup::SingleReadouts, AmbiguityGroup::IrregularIntervals]);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Flip { missed_spikes: v[0], false_spikes: 0.0 }]
}

fn moments(v: Values<'_>, at: &OperatingPoint) -> Option<Moments> {
    // Let v be the probability that a spike is missed. A reported interval then consists of a geometric number of equal
    // true intervals. The variance of the number of true intervals is v / (1 - v)^2. The squared rate has the factor (1
    // - v)^2. The product of the variance and this factor is v.
    Some(Moments { rate: -v[0] * at.increment().min(1.0), phase_variance: v[0], spatial_variance: 0.0 })
}

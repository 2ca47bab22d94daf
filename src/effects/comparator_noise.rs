//! Noise of the comparator.

use super::prelude::*;

/// The effect `comparator_noise`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "comparator_noise",
    "Every comparison has a random error that the reset does not subtract. An early or late spike changes the next interval by the opposite amount.",
    "input-referred noise of a clocked comparator",
    &[Param::number("sigma", Unit::Dimensionless, (0.0, 0.06), 0.0, 0.005, "standard deviation of the error of one comparison, relative to the threshold")
        .with_search(SearchSpec::deviation((0.0, 0.05), &[0.004, 0.015]))],
)
.with_ops(|v, _| vec![Op::ComparatorNoise { sigma: v[0] }])
// The noise changes comparisons but adds no charge, so the mean rate is unchanged. The errors of the comparisons do
// not add up, so `phase_variance` is 0.
.with_moments(|_, _| Some(Moments::default()))
.with_ambiguity_groups(&[AmbiguityGroup::IrregularIntervals]);

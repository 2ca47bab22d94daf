//! Low-frequency noise of the threshold.

use super::prelude::*;

/// The effect `slow_threshold_noise`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "slow_threshold_noise",
    "The threshold fluctuates around its mean with a correlation time of many readouts (Ornstein-Uhlenbeck process).",
    "low-frequency noise of the comparator; one time constant of a 1/f spectrum",
    &[
        Param::number("sigma", Unit::Dimensionless, (0.0, 0.02), 0.0, 0.003, "standard deviation of the fluctuation, relative to the threshold")
            .with_search(SearchSpec::deviation((0.0, 0.02), &[0.002, 0.006])),
        Param::number("time_constant", Unit::Readout, (30.0, 50000.0), 1000.0, 1000.0, "time after which the correlation of the fluctuation is 1/e")
            .with_search(SearchSpec::shape((30.0, 5e4), &[150.0, 1000.0, 6000.0])),
    ],
)
.with_ops(|v, _| vec![Op::SlowThresholdNoise { sigma: v[0], time_constant: v[1] }])
// No moments: the threshold noise lies between two limits: a threshold that is frozen until the reset, and a threshold that is
// redrawn at every readout. Between these limits the moments have no closed form.
.with_ambiguity_groups(&[AmbiguityGroup::SlowChange, AmbiguityGroup::Memory, AmbiguityGroup::IrregularIntervals]);

//! Low-frequency noise of the threshold.

use crate::effects::definition::{AmbiguityGroup, Definition, Moments, OperatingPoint, Param, SearchSpec, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `slow_threshold_noise`.
pub static EFFECT: Definition = Definition::new(
    "slow_threshold_noise",
    "The threshold fluctuates around its mean with a correlation time of many readouts (Ornstein-Uhlenbeck process).",
    "low-frequency noise of the comparator; one time constant of a 1/f spectrum",
    &[
        Param::number(
            "sigma",
            Unit::Dimensionless,
            (0.0, 0.02),
            0.0,
            0.003,
            "standard deviation of the fluctuation, relative to the threshold",
        )
        .with_search(SearchSpec::deviation((0.0, 0.02), &[0.002, 0.006])),
        Param::number(
            "time_constant",
            Unit::Readout,
            (30.0, 50000.0),
            1000.0,
            1000.0,
            "time after which the correlation of the fluctuation is 1/e",
        )
        .with_search(SearchSpec::shape((30.0, 5e4), &[150.0, 1000.0, 6000.0])),
    ],
)
.with_ops(ops)
.with_moments(moments)
.with_ambiguity_groups(&[AmbiguityGroup::SlowChange, AmbiguityGroup::Memory, AmbiguityGroup::IrregularIntervals]);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::SlowThresholdNoise { sigma: v[0], time_constant: v[1] }]
}

fn moments(_: Values<'_>, _: &OperatingPoint) -> Option<Moments> {
    // The threshold noise lies between two limits: a threshold that is frozen until the reset, and a threshold that is
    // redrawn at every readout. Between these limits the moments have no closed form.
    None
}

//! Slow, steady change of the gain.

use super::prelude::*;

/// The effect `gain_drift`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "gain_drift",
    "The gain changes linearly over a number of readouts and then stays constant.",
    "drift of temperature and lamp during a recording",
    &[
        Param::number("relative_change", Unit::Dimensionless, (-0.5, 0.5), 0.0, 0.01, "total relative change of the gain")
            .with_search(SearchSpec::amplitude((-0.3, 0.3), &[0.004, -0.004, 0.05, -0.05])),
        Param::number("duration", Unit::Readout, (1.0, 1e9), 10000.0, 10000.0, "duration of the change from the first readout, such as the length of the recording")
            .with_search(SearchSpec::recording_length()),
    ],
)
.with_ops(|v, _| vec![Op::Drift { change: v[0], readouts: v[1] }])
// The gain changes linearly, so the mean change during the drift is half of the final change.
.with_moments(|v, at| Some(Moments { rate: 0.5 * v[0] * at.from_light, ..Moments::default() }))
.with_ambiguity_groups(&[AmbiguityGroup::SlowChange])
.with_caveat("a lamp that drifts through all recordings has the same statistics");

//! Shot noise of the dark current.

use crate::effects::definition::{AmbiguityGroup, Definition, Moments, OperatingPoint, Param, SearchSpec, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `dark_shot_noise`.
pub static EFFECT: Definition = Definition::new(
    "dark_shot_noise",
    "The dark current consists of single electrons. The number of electrons in a readout has a Poisson distribution.",
    "Poisson statistics; absent from SCSim",
    &[Param::number(
        "strength",
        Unit::Dimensionless,
        (0.0, 10_000.0),
        0.0,
        1.0,
        "factor on the variance of the number of electrons; 1 is Poisson noise",
    )
    .with_search(SearchSpec::amplitude((0.0, 2.0), &[0.4]))],
)
.with_ops(ops)
.with_moments(moments)
.scene_like()
.with_ambiguity_groups(&[AmbiguityGroup::DarkSpikes]);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::DarkQuanta { strength: v[0] }]
}

fn moments(v: Values<'_>, at: &OperatingPoint) -> Option<Moments> {
    let phase_variance = v[0] * at.from_dark / at.increment() / at.electrons;
    Some(Moments { phase_variance, ..Moments::default() })
}

//! Delayed arrival of a part of the light.

use crate::effects::definition::{AmbiguityGroup, Definition, Moments, OperatingPoint, Param, SearchSpec, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `image_lag`.
pub static EFFECT: Definition = Definition::new(
    "image_lag",
    "A share of the light becomes charge with an exponential delay. No light is lost.",
    "incomplete charge transfer of pinned photodiodes",
    &[
        Param::number("fraction", Unit::Dimensionless, (0.0, 0.1), 0.0, 0.01, "delayed share of the light")
            .with_search(SearchSpec::amplitude((0.0, 0.1), &[0.01])),
        Param::number(
            "time_constant",
            Unit::Readout,
            (1.0, 20000.0),
            50.0,
            50.0,
            "time after which 1/e of the delayed light has not become charge yet",
        )
        .with_search(SearchSpec::shape((2.0, 600.0), &[8.0, 40.0, 150.0])),
    ],
)
.with_ops(ops)
.with_moments(moments)
.scene_like()
.with_ambiguity_groups(&[AmbiguityGroup::Memory]);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Lag { fraction: v[0], time_constant: v[1] }]
}

fn moments(_: Values<'_>, _: &OperatingPoint) -> Option<Moments> {
    // Steady light arrives in full after the initial delay.
    Some(Moments::default())
}

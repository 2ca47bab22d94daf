//! Delayed arrival of a part of the light.

use super::prelude::*;

/// The effect `image_lag`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "image_lag",
    "A share of the light becomes charge with an exponential delay. No light is lost.",
    "incomplete charge transfer of pinned photodiodes",
    &[
        Param::number("fraction", Unit::Dimensionless, (0.0, 0.1), 0.0, 0.01, "delayed share of the light")
            .with_search(SearchSpec::amplitude((0.0, 0.1), &[0.01])),
        Param::number("time_constant", Unit::Readout, (1.0, 20000.0), 50.0, 50.0, "time after which 1/e of the delayed light has not become charge yet")
            .with_search(SearchSpec::shape((2.0, 600.0), &[8.0, 40.0, 150.0])),
    ],
)
.with_ops(|v, _| vec![Op::Lag { fraction: v[0], time_constant: v[1] }])
// Steady light arrives in full after the initial delay.
.with_moments(|_, _| Some(Moments::default()))
.scene_like()
.with_ambiguity_groups(&[AmbiguityGroup::Memory]);

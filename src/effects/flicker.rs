//! Light that oscillates with the mains or with the refresh of a screen.

use super::prelude::*;

/// The effect `flicker`.
pub static EFFECT: Definition = Definition::new(
    "flicker",
    "The light oscillates: at the time t, the light is multiplied by 1 + m sin(2 pi (f t + p)).",
    "lamps flicker at twice the mains frequency, screens at their refresh rate",
    &[
        Param::number("depth", Unit::Dimensionless, (0.0, 0.2), 0.0, 0.02, "amplitude m of the oscillation, relative to the mean light")
            .with_search(SearchSpec::amplitude((0.0, 0.2), &[0.01])),
        Param::number("frequency_hz", Unit::Hertz, (0.0, 1e6), 100.0, 100.0, "frequency f of the oscillation")
            .with_search(SearchSpec::frequency((1.0, 1e4), &[80.0, 400.0, 2000.0])),
        Param::number("phase", Unit::Dimensionless, (0.0, 1.0), 0.0, 0.0, "phase p at the first readout, in periods: 0.25 is a quarter period"),
    ],
)
.with_ops(|v, _| vec![Op::Flicker { depth: v[0], frequency_hz: v[1], phase_turns: v[2] }])
// A sine has the mean 0 in a whole number of periods, so the mean light is unchanged.
.with_moments(|_, _| Some(Moments::default()))
.with_ambiguity_groups(&[AmbiguityGroup::SlowChange])
.with_caveat("a flickering lamp has the same statistics, so the cause is the lamp and not the camera");

//! Shot noise of the dark current.

use super::prelude::*;

/// The effect `dark_shot_noise`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "dark_shot_noise",
    "The dark current consists of single electrons. The number of electrons in a readout has a Poisson distribution.",
    "Poisson statistics; absent from SCSim",
    &[Param::number("strength", Unit::Dimensionless, (0.0, 10_000.0), 0.0, 1.0, "factor on the variance of the number of electrons; 1 is Poisson noise")
        .with_search(SearchSpec::amplitude((0.0, 2.0), &[0.4]))],
)
.with_ops(|v, _| vec![Op::DarkQuanta { strength: v[0] }])
.with_moments(|v, at| {
    let phase_variance = v[0] * at.from_dark / at.increment() / at.electrons;
    Some(Moments { phase_variance, ..Moments::default() })
})
.scene_like()
.with_ambiguity_groups(&[AmbiguityGroup::DarkSpikes]);

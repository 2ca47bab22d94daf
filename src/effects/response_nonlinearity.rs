//! Charge that is not proportional to the light.

use super::prelude::*;

/// The effect `response_nonlinearity`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "response_nonlinearity",
    "The charge is not proportional to the light: light x, relative to full scale, adds the charge of x (1 + b x). The dark current does not change.",
    "linearity error of EMVA 1288; the capacitance of the diode depends on its voltage",
    &[Param::number("quadratic", Unit::Dimensionless, (-0.2, 0.2), 0.0, 0.02, "b, the relative change of the charge at full scale")
        .with_search(SearchSpec::amplitude((-0.15, 0.15), &[-0.01, 0.01, 0.06, -0.06]))],
)
.with_ops(|v, _| vec![Op::Response { quadratic: v[0] }])
.with_moments(|v, at| Some(Moments { rate: v[0] * at.light * at.from_light, ..Moments::default() }))
.scene_like()
.with_ambiguity_groups(&[AmbiguityGroup::Response]);

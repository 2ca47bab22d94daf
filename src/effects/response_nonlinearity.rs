//! Charge that is not proportional to the light.

use crate::effects::definition::{AmbiguityGroup, Definition, Moments, OperatingPoint, Param, SearchSpec, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `response_nonlinearity`.
pub static EFFECT: Definition = Definition::new(
    "response_nonlinearity",
    "The charge is not proportional to the light: light x, relative to full scale, adds the charge of x (1 + b x). The dark current does not change.",
    "linearity error of EMVA 1288; the capacitance of the diode depends on its voltage",
    &[Param::number(
        "quadratic",
        Unit::Dimensionless,
        (-0.2, 0.2),
        0.0,
        0.02,
        "b, the relative change of the charge at full scale",
    )
    .with_search(SearchSpec::amplitude((-0.15, 0.15), &[-0.01, 0.01, 0.06, -0.06]))],
)
.with_ops(ops)
.with_moments(moments)
.scene_like()
.with_ambiguity_groups(&[AmbiguityGroup::Response]);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Response { quadratic: v[0] }]
}

fn moments(v: Values<'_>, at: &OperatingPoint) -> Option<Moments> {
    Some(Moments { rate: v[0] * at.light * at.from_light, ..Moments::default() })
}

//! Light that reaches the neighboring pixels.

use crate::effects::definition::{AmbiguityGroup, Definition, Moments, OperatingPoint, Param, SearchSpec, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `crosstalk`.
pub static EFFECT: Definition = Definition::new(
    "crosstalk",
    "Every pixel loses a share of its light to its four neighbors. Each neighbor receives a quarter of this share. At the border of the sensor, the quarter of a missing neighbor stays in the pixel.",
    "optical crosstalk between microlenses; diffusion of carriers",
    &[Param::number(
        "share",
        Unit::Dimensionless,
        (0.0, 0.12),
        0.0,
        0.02,
        "share of the light of each pixel that its four neighbors receive together",
    )
    .with_search(SearchSpec::amplitude((0.0, 0.12), &[0.004, 0.03]))],
)
.with_ops(ops)
.with_moments(moments)
.scene_like()
.with_ambiguity_groups(&[AmbiguityGroup::Neighbors]);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Crosstalk { share: v[0] }]
}

fn moments(_: Values<'_>, _: &OperatingPoint) -> Option<Moments> {
    // Under uniform light a pixel receives as much light from its neighbors as it loses.
    Some(Moments::default())
}

//! Light that reaches the neighboring pixels.

use super::prelude::*;

/// The effect `crosstalk`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "crosstalk",
    "Every pixel loses a share of its light to its four neighbors. Each neighbor receives a quarter of this share. At the border of the sensor, the quarter of a missing neighbor stays in the pixel.",
    "optical crosstalk between microlenses; diffusion of carriers",
    &[Param::number("share", Unit::Dimensionless, (0.0, 0.12), 0.0, 0.02, "share of the light of each pixel that its four neighbors receive together")
        .with_search(SearchSpec::amplitude((0.0, 0.12), &[0.004, 0.03]))],
)
.with_ops(|v, _| vec![Op::Crosstalk { share: v[0] }])
// Under uniform light a pixel receives as much light from its neighbors as it loses.
.with_moments(|_, _| Some(Moments::default()))
.scene_like()
.with_ambiguity_groups(&[AmbiguityGroup::Neighbors]);

//! Upper limit of the charge that a pixel stores.

use super::prelude::*;

/// The effect `saturation_clamp`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "saturation_clamp",
    "The charge that a pixel stores has an upper limit. A pixel in light above full scale therefore stops firing when the light ends.",
    "bright outdoor recordings saturate without an afterglow",
    &[Param::number("largest_charge", Unit::Dimensionless, (1.0, f64::INFINITY), f64::INFINITY, 1.5, "largest stored charge, relative to the threshold of the pixel")
        .with_search(SearchSpec::amplitude((1.0, 2.0), &[1.7, 1.3]))],
)
.with_ops(|v, _| vec![Op::Ceiling { thresholds: v[0] }])
// The clamp removes no charge if the limit exceeds one threshold by more than an increment.
.with_moments(|v, at| (at.increment() < v[0] - 1.0).then(Moments::default))
.scene_like()
.with_onset()
.with_ambiguity_groups(&[AmbiguityGroup::Response]);

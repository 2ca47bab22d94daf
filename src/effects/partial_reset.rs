//! Loss of charge above the threshold at a reset.

use super::prelude::*;

/// The effect `partial_reset`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "partial_reset",
    "The reset after a spike also removes a share of the charge above the threshold. The share is 0 for a soft reset and 1 for a hard reset.",
    "hard reset: image converter of SpikeCV, SpikingSIM",
    &[Param::number("lost_remainder", Unit::Dimensionless, (0.0, 1.0), 0.0, 0.05, "share of the charge above the threshold that a reset removes")
        .with_search(SearchSpec::amplitude((0.0, 1.0), &[0.02, 0.25, 0.8]))],
)
.with_ops(|v, _| vec![Op::Remainder { lost: v[0] }])
.with_ambiguity_groups(&[AmbiguityGroup::Response]);

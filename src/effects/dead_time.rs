//! Dead time of the reset: the first increment after a spike is smaller.

use super::prelude::*;

/// The effect `dead_time`.
pub static EFFECT: Definition = Definition::new(
    "dead_time",
    "After a spike, a pixel loses a share of the charge that light and dark current add in the next readout.",
    "published code of SCSim: 100 ns of 50 us",
    &[Param::number("lost_fraction", Unit::Dimensionless, (0.0, 0.5), 0.0, 0.002, "share of the charge of one readout that is lost")
        .with_search(SearchSpec::amplitude((0.0, 0.15), &[0.012, 0.06]))],
)
.with_ops(|v, _| vec![Op::FirstIncrement { lost: v[0] }])
.with_moments(|v, at| {
    // Let x be the increment and r the share of an increment that is lost after a spike. Below saturation (x < 1), the
    // rate f solves f = x - r x f.
    let x = at.increment();
    Some(Moments { rate: x / (1.0 + v[0] * x) - x, ..Moments::default() })
})
.scene_like()
.in_base_model()
.with_ambiguity_groups(&[AmbiguityGroup::Response]);

//! Leakage of the stored charge.

use super::prelude::*;

/// The effect `leak`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "leak",
    "At every readout, a share of the stored charge is lost before new charge is added.",
    "junction leakage in proportion to the stored voltage",
    &[Param::number("fraction_per_readout", Unit::Dimensionless, (0.0, 4e-3), 0.0, 5e-4, "share of the stored charge that is lost at each readout")
        .with_search(SearchSpec::amplitude((0.0, 4e-3), &[4e-5, 5e-4]))],
)
.with_ops(|v, _| vec![Op::Leak { fraction: v[0] }])
.with_moments(|v, at| {
    // Let x be the increment and k the share of the charge that leaks per readout. The charge needs -ln(1 - k/x)/k
    // readouts to rise from zero to one threshold. If x <= k, the charge stays below the threshold.
    let x = at.increment();
    let rate = if v[0] >= x { 0.0 } else { v[0] / -libm::log1p(-v[0] / x) };
    let rate = if v[0] == 0.0 { 0.0 } else { rate - x };
    Some(Moments { rate, ..Moments::default() })
})
.scene_like()
.with_ambiguity_groups(&[AmbiguityGroup::Response]);

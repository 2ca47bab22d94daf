//! Droop of the supply under load.

use super::prelude::*;

/// The effect `supply_droop`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "supply_droop",
    "All thresholds decrease in proportion to the number of pixels that fired at the previous readout.",
    "resistance of the supply grid: the threshold depends on the reset voltage",
    &[Param::number("depth", Unit::Dimensionless, (-0.06, 0.06), 0.0, 0.005, "relative decrease of all thresholds after a readout at which every pixel fired")
        .with_search(SearchSpec::amplitude((-0.06, 0.06), &[0.002, -0.002, 0.015, -0.015]))],
)
.with_ops(|v, _| vec![Op::SupplyDroop { depth: v[0] }])
.with_moments(|v, at| {
    // Let x be the increment and f the rate. The droop lowers the threshold to 1 - depth f, so f (1 - depth f) = x. To
    // second order in x, f - x = depth x^2.
    let x = at.increment();
    Some(Moments { rate: v[0] * x * x, ..Moments::default() })
})
.scene_like();

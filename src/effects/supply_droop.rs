//! A supply that sags with the load.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `supply_droop`.
pub static EFFECT: Definition = Definition::new(
    "supply_droop",
    "All thresholds fall in proportion to the share of the pixels that fired at the \
     readout before.",
    "resistance of the supply grid: the threshold follows the reset voltage",
    &[Param::number(
        "depth",
        Unit::One,
        (-0.06, 0.06),
        0.0,
        0.005,
        "relative fall of the threshold when every pixel fired",
    )
    .tried(Tried::amplitude((-0.06, 0.06), &[0.002, -0.002, 0.015, -0.015]))],
)
.with_ops(ops)
.with_moments(moments)
.part_of_a_scene();

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::SupplyDroop { depth: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // f (1 - depth f) = x, to second order.
    let x = at.increment();
    Some(Moments { rate: v[0] * x * x, ..Moments::default() })
}

//! A supply that sags with the load.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values, no_edit};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `supply_droop`.
pub const EFFECT: Definition = Definition {
    name: "supply_droop",
    summary: "All thresholds fall in proportion to the share of the pixels that fired at the readout before.",
    source: "resistance of the supply grid: the threshold follows the reset voltage",
    params: &[
        Param::number("depth", Unit::One, (-0.03, 0.03), 0.0, 0.005, "relative fall of the threshold when every pixel fired"),
    ],
    edit: no_edit,
    ops,
    moments,
};

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::SupplyDroop { depth: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // f (1 - depth f) = x, to second order.
    let x = at.increment();
    Some(Moments { rate: v[0] * x * x, ..Moments::default() })
}

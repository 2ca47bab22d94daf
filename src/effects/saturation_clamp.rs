//! The charge that a pixel stores is bounded.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values, no_edit};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `saturation_clamp`.
pub const EFFECT: Definition = Definition {
    name: "saturation_clamp",
    summary: "A pixel brighter than full scale does not store its surplus, so it stops firing when the light goes.",
    source: "bright outdoor recordings saturate without an afterglow",
    params: &[Param::number(
        "largest_charge",
        Unit::One,
        (1.0, f64::INFINITY),
        f64::INFINITY,
        1.5,
        "in the pixel's own thresholds",
    )],
    edit: no_edit,
    ops,
    moments,
};

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Ceiling { thresholds: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // No trace below saturation, as long as the largest charge exceeds one threshold by an increment.
    (at.increment() < v[0] - 1.0).then(Moments::default)
}

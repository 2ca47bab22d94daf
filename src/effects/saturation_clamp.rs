//! The charge that a pixel stores is bounded.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `saturation_clamp`.
pub static EFFECT: Definition = Definition::new(
    "saturation_clamp",
    "A pixel brighter than full scale does not store its surplus, so it stops firing \
     when the light goes.",
    "bright outdoor recordings saturate without an afterglow",
    &[Param::number(
        "largest_charge",
        Unit::One,
        (1.0, f64::INFINITY),
        f64::INFINITY,
        1.5,
        "in the pixel's own thresholds",
    )
    .tried(Tried::amplitude((1.0, 2.0), &[1.7, 1.3]))],
)
.with_ops(ops)
.with_moments(moments)
.part_of_a_scene()
.setting_in_late();

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Ceiling { thresholds: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // No trace below saturation, as long as the largest charge exceeds one threshold by an increment.
    (at.increment() < v[0] - 1.0).then(Moments::default)
}

//! Stored charge leaks away.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `leak`.
pub static EFFECT: Definition = Definition::new(
    "leak",
    "At every readout the stored charge loses a share of itself, before new charge \
     arrives.",
    "junction leakage in proportion to the stored voltage",
    &[Param::number(
        "fraction_per_readout",
        Unit::One,
        (0.0, 4e-3),
        0.0,
        5e-4,
        "lost share of the stored charge",
    )
    .tried(Tried::amplitude((0.0, 4e-3), &[4e-5, 5e-4]))],
)
.with_ops(ops)
.with_moments(moments)
.part_of_a_scene();

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Leak { fraction: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // Filling up to one threshold takes -ln(1 - k/x)/k readouts; without end where x <= k.
    let x = at.increment();
    let rate = if v[0] >= x { 0.0 } else { v[0] / -libm::log1p(-v[0] / x) };
    let rate = if v[0] == 0.0 { 0.0 } else { rate - x };
    Some(Moments { rate, ..Moments::default() })
}

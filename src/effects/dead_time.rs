//! The reset takes time: the first increment after a spike is shortened.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `dead_time`.
pub static EFFECT: Definition = Definition::new(
    "dead_time",
    "The first increment after a spike, light and dark, loses a share of itself.",
    "published code of SCSim: 100 ns of 50 us",
    &[Param::number("lost_fraction", Unit::One, (0.0, 0.5), 0.0, 0.002, "lost share of one increment")
        .tried(Tried::amplitude((0.0, 0.15), &[0.012, 0.06]))],
)
.with_ops(ops)
.with_moments(moments)
.part_of_a_scene()
.of_the_base_model();

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::FirstIncrement { lost: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // f = x - r x f while x < 1.
    let x = at.increment();
    Some(Moments { rate: x / (1.0 + v[0] * x) - x, ..Moments::default() })
}

//! Pixels that never fire on their own.

use crate::draws::pattern::Pattern;
use crate::effects::circuit::Circuit;
use crate::effects::definition::{Definition, Moments, Operating, Param, Values, no_ops};
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `dead_pixels`.
pub const EFFECT: Definition = Definition {
    name: "dead_pixels",
    summary: "A share of the pixels gathers no charge at all.",
    source: "low-light recordings of a real camera",
    params: &[Param::number("fraction", Unit::One, (0.0, 1.0), 0.0, 0.003, "share of the pixels")],
    edit,
    ops: no_ops,
    moments,
};

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, pattern: &mut Pattern) {
    if v[0] == 0.0 {
        return;
    }
    for (p, u) in pattern.uniforms().enumerate().take(circuit.pixels()) {
        if u < v[0] {
            circuit.gain[p] = 0.0;
            circuit.dark_pa[p] = 0.0;
        }
    }
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    Some(Moments { rate: -v[0] * at.increment(), phase_variance: 0.0, spatial_variance: v[0] * (1.0 - v[0]) })
}

//! Dark current that switches.

use crate::draws::pattern::Pattern;
use crate::effects::circuit::Circuit;
use crate::effects::definition::{Definition, Moments, Operating, Param, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `telegraph_dark`.
pub const EFFECT: Definition = Definition {
    name: "telegraph_dark",
    summary: "The dark current of some pixels switches at random between two values, equally far from its mean.",
    source: "random telegraph signal of single traps, as in active-pixel sensors",
    params: &[
        Param::number("amplitude", Unit::One, (0.0, 1.0), 0.0, 0.3, "distance of both values from the mean, relative to the pixel's dark current"),
        Param::number("pixels", Unit::One, (0.0, 1.0), 0.0, 0.05, "share of the pixels"),
        Param::number("rate", Unit::One, (0.0, 0.5), 1e-3, 1e-3, "probability of switching per readout"),
    ],
    edit,
    ops,
    moments,
};

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, pattern: &mut Pattern) {
    if v[0] == 0.0 || v[1] == 0.0 {
        return;
    }
    let member = |u: f64| if u < v[1] { v[0] } else { 0.0 };
    circuit.telegraph = pattern.uniforms().take(circuit.pixels()).map(member).collect();
}

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Telegraph { rate: v[2] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // Sums of a signal whose correlation is (1 - 2p)^k grow by (1 - p)/p per readout; a walk for
    // intervals much longer than 1/p readouts.
    let walk = if v[2] == 0.0 { 0.0 } else { (1.0 - v[2]) / v[2] };
    let phase_variance = v[1] * (v[0] * at.from_dark).powi(2) * walk / at.increment();
    Some(Moments { phase_variance, ..Moments::default() })
}

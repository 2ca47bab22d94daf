//! Dark current that switches.

use crate::draws::pattern::Pattern;
use crate::effects::circuit::Circuit;
use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `telegraph_dark`. Its counts of odd intervals set in and saturate within a decade: tried from a tenth of
/// a current on, weak ones looked like false spikes.
pub static EFFECT: Definition = Definition::new(
    "telegraph_dark",
    "The dark current of some pixels switches at random between two values, equally \
     far from its mean.",
    "random telegraph signal of single traps, as in active-pixel sensors",
    &[
        Param::number(
            "amplitude",
            Unit::One,
            (0.0, 1.0),
            0.0,
            0.3,
            "distance of both values from the mean, relative to the pixel's dark current",
        )
        .tried(Tried::amplitude((0.0, 1.0), &[0.008, 0.03, 0.15])),
        Param::number("pixels", Unit::One, (0.0, 1.0), 0.0, 0.05, "share of the pixels")
            .tried(Tried::shape((0.01, 1.0), &[0.2])),
        Param::number("rate", Unit::One, (0.0, 0.5), 1e-3, 1e-3, "probability of switching per readout")
            .tried(Tried::shape((1e-4, 1e-2), &[1e-3])),
    ],
)
.with_edit(edit)
.with_ops(ops)
.with_moments(moments);

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

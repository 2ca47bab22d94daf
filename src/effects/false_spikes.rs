//! Silent readouts that report a spike.

use crate::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `false_spikes`.
pub static EFFECT: Definition = Definition::new(
    "false_spikes",
    "A silent readout reports a spike that the pixel did not make.",
    "bit errors; SpikingSIM's inherent noise",
    &[Param::number("probability", Unit::One, (0.0, 1.0), 0.0, 1e-3, "per silent readout")
        .tried(Tried::amplitude((0.0, 0.05), &[4e-6, 6e-5, 1e-3]))],
)
.with_ops(ops)
.with_moments(moments);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::Flip { missed: 0.0, spurious: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    let x = at.increment().min(1.0);
    let rate = v[0] * (1.0 - x);
    // For many intervals D(n) times the squared rate grows by the variance over the mean of the
    // counts; only the false ones vary.
    let phase_variance = if rate == 0.0 { 0.0 } else { rate * (1.0 - v[0]) / (x + rate) };
    Some(Moments { rate, phase_variance, spatial_variance: 0.0 })
}

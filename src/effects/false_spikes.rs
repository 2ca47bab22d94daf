//! Silent readouts that report a spike.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values, no_edit};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `false_spikes`.
pub const EFFECT: Definition = Definition {
    name: "false_spikes",
    summary: "A silent readout reports a spike that the pixel did not make.",
    source: "bit errors; SpikingSIM's inherent noise",
    params: &[Param::number("probability", Unit::One, (0.0, 1.0), 0.0, 1e-3, "per silent readout")],
    edit: no_edit,
    ops,
    moments,
};

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

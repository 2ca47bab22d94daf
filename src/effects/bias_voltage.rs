//! Offset of the comparator's threshold voltage, different in every pixel.

use crate::draws::pattern::Pattern;
use crate::effects::circuit::Circuit;
use crate::effects::definition::{Definition, Moments, Operating, Param, Values};
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `bias_voltage`.
pub static EFFECT: Definition = Definition::new(
    "bias_voltage",
    "The threshold voltage has an offset of its own in every pixel; its mean belongs \
     to the nominal threshold.",
    "SCSim, arXiv 2405.16790, Algorithm 1, the map V_S",
    &[
        Param::number("mean", Unit::Volt, (-10.0, 10.0), 0.0, -0.0076, "mean over the pixels"),
        Param::number("sigma", Unit::Volt, (0.0, 10.0), 0.0, 0.0497, "Gaussian spread over the pixels"),
    ],
)
.with_edit(edit)
.with_moments(moments);

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, pattern: &mut Pattern) {
    // Full scale is defined by the mean pixel, so a mean offset moves it along (the
    // published code's full-scale current is that of 1.0924 V, not of 1.1 V).
    circuit.nominal_v += v[0];
    for (swing, z) in circuit.swing_v.iter_mut().zip(pattern.normals_if(v[1] != 0.0)) {
        *swing += v[0] + v[1] * z;
    }
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // The mean of 1/(1 + e) is 1 + var(e) to second order.
    let variance = (v[1] / at.swing_v).powi(2);
    // A mean offset moves full scale along, so light keeps its rate; a current in amperes does not.
    let dark = -at.from_dark * v[0] / (at.swing_v + v[0]);
    Some(Moments { rate: at.increment() * variance + dark, phase_variance: 0.0, spatial_variance: variance })
}

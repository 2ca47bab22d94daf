//! Offset of the comparator's threshold voltage, drawn separately for every pixel.

use super::prelude::*;

/// The effect `bias_voltage`.
pub static EFFECT: Definition = Definition::new(
    "bias_voltage",
    "The threshold voltage of every pixel has its own constant offset. The nominal threshold includes the mean offset.",
    "SCSim, arXiv 2405.16790, Algorithm 1, the map V_S",
    &[
        Param::number("mean", Unit::Volt, (-10.0, 10.0), 0.0, -0.0076, "mean offset over the pixels"),
        Param::number("sigma", Unit::Volt, (0.0, 10.0), 0.0, 0.0497, "Gaussian standard deviation of the offset over the pixels"),
    ],
)
.with_edit(edit)
.with_moments(|v, at| {
    // The rate is proportional to 1/(1 + e), where e is the relative threshold offset of a pixel with mean 0. To second
    // order, the mean of 1/(1 + e) is 1 + var(e).
    let variance = (v[1] / at.swing_v).powi(2);
    // The mean offset shifts full scale too, so the rate from light is unchanged. The dark current is a fixed current in
    // amperes, so the rate from the dark current changes.
    let dark = -at.from_dark * v[0] / (at.swing_v + v[0]);
    Some(Moments { rate: at.increment() * variance + dark, phase_variance: 0.0, spatial_variance: variance })
});

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, pattern: &mut PatternRng) {
    // Full scale is defined for a pixel with the mean threshold, so the mean offset shifts full scale too. In the
    // published code, the full-scale current corresponds to 1.0924 V and not to 1.1 V.
    circuit.nominal_v += v[0];
    for (swing, z) in circuit.swing_v.iter_mut().zip(pattern.normals_if(v[1] != 0.0)) {
        *swing += v[0] + v[1] * z;
    }
}

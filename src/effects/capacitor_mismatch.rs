//! Differences in capacitance between pixels.

use super::prelude::*;

/// The effect `capacitor_mismatch`.
pub static EFFECT: Definition = Definition::new(
    "capacitor_mismatch",
    "The capacitance of the charge node varies from pixel to pixel, and the threshold charge varies with it.",
    "SCSim, arXiv 2405.16790, Algorithm 1, the map C_S",
    &[Param::number("sigma", Unit::Femtofarad, (0.0, 1e3), 0.0, 0.0128, "Gaussian standard deviation of the capacitance over the pixels")],
)
.with_edit(edit)
.with_moments(|v, at| {
    let variance = (v[0] / at.capacitance_ff).powi(2);
    Some(Moments { rate: at.increment() * variance, phase_variance: 0.0, spatial_variance: variance })
});

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, pattern: &mut PatternRng) {
    if v[0] == 0.0 {
        return;
    }
    for (c, z) in circuit.capacitance_ff.iter_mut().zip(pattern.normals()) {
        *c += v[0] * z;
    }
}

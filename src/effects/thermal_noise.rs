//! Noise of the threshold: kTC noise of the reset and additional noise in volts.

use super::prelude::*;
use crate::pixel::NoiseSampling;
use crate::units::BOLTZMANN_J_PER_K;

/// The effect `thermal_noise`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "thermal_noise",
    "The threshold of every pixel has random noise, which acts on the comparison and on the reset. A new noise value is drawn at every readout, or after every reset.",
    "SCSim, arXiv 2405.16790, Algorithm 1, V_T; kT/C; psi from the mean of the largest draw",
    &[
        Param::number("temperature", Unit::Kelvin, (0.0, 1000.0), 0.0, 293.0, "temperature of the kTC noise of the nominal capacitance; 0 K disables kTC noise"),
        Param::number("sigma", Unit::Volt, (0.0, 1.0), 0.0, 0.0, "standard deviation of additional noise, added in quadrature to kTC noise"),
        Param::choice("noise_sampling", &["every-reset", "every-readout"], 0, "when a new noise value is drawn: after every reset of the pixel, or at every readout"),
    ],
)
.with_ops(ops)
.with_moments(moments);

fn ops(v: Values<'_>, sensor: &Sensor) -> Vec<Op> {
    let noise_sampling = if v[2] == 0.0 { NoiseSampling::EveryReset } else { NoiseSampling::EveryReadout };
    let sigma_v = sigma_v(v, sensor.capacitance_ff);
    vec![Op::ThresholdNoise { sigma_v, noise_sampling }]
}

fn moments(v: Values<'_>, at: &OperatingPoint) -> Option<Moments> {
    if v[2] != 0.0 {
        // The threshold is redrawn at every readout. A pixel is more likely to fire when its draw is low, and in
        // general this bias has no closed form.
        return None;
    }
    let relative = sigma_v(v, at.capacitance_ff) / at.swing_v;
    Some(Moments { phase_variance: relative * relative, ..Moments::default() })
}

/// Returns `sqrt(sigma^2 + kT/C)` in volts.
fn sigma_v(v: Values<'_>, capacitance_ff: f64) -> f64 {
    let ktc = BOLTZMANN_J_PER_K * v[0] / (capacitance_ff * 1e-15);
    (v[1] * v[1] + ktc).sqrt()
}

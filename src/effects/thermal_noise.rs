//! Thermal noise of the threshold: kTC noise of the reset, and any further noise given in volts.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values};
use crate::pixel::{Op, Redraw};
use crate::sensor::Sensor;
use crate::units::BOLTZMANN_J_PER_K;
use crate::units::Unit;

/// The effect `thermal_noise`.
pub static EFFECT: Definition = Definition::new(
    "thermal_noise",
    "The threshold carries noise, compared with and subtracted; drawn at every \
     readout or frozen from reset to reset.",
    "SCSim, arXiv 2405.16790, Algorithm 1, V_T; kT/C; psi from the mean of the \
     largest draw",
    &[
        Param::number(
            "temperature",
            Unit::Kelvin,
            (0.0, 1000.0),
            0.0,
            293.0,
            "adds kTC noise of the nominal capacitor; 0 K adds none",
        ),
        Param::number("sigma", Unit::Volt, (0.0, 1.0), 0.0, 0.0, "further noise, added in quadrature"),
        Param::choice("redraw", &["every-reset", "every-readout"], 0, "when a new value is drawn"),
    ],
)
.with_ops(ops)
.with_moments(moments);

fn ops(v: Values<'_>, sensor: &Sensor) -> Vec<Op> {
    let redraw = if v[2] == 0.0 { Redraw::EveryReset } else { Redraw::EveryReadout };
    let sigma_v = sigma_v(v, sensor.capacitance_ff);
    vec![Op::ThresholdNoise { sigma_v, redraw }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    if v[2] != 0.0 {
        // Drawn at every readout the noise selects its low draws; no closed form in general.
        return None;
    }
    let relative = sigma_v(v, at.capacitance_ff) / at.swing_v;
    Some(Moments { phase_variance: relative * relative, ..Moments::default() })
}

/// `sqrt(sigma^2 + kT/C)` in volts.
fn sigma_v(v: Values<'_>, capacitance_ff: f64) -> f64 {
    let ktc = BOLTZMANN_J_PER_K * v[0] / (capacitance_ff * 1e-15);
    (v[1] * v[1] + ktc).sqrt()
}

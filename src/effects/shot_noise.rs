//! Photon shot noise: light arrives in whole quanta.

use crate::effects::definition::{Definition, Moments, Operating, Param, Values};
use crate::pixel::{Op, Quanta};
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `shot_noise`.
pub static EFFECT: Definition = Definition::new(
    "shot_noise",
    "Light arrives in quanta; the number in a readout is Poisson.",
    "SCSim, arXiv 2405.16790, Algorithm 1; Poisson statistics",
    &[
        Param::number(
            "strength",
            Unit::One,
            (0.0, 10_000.0),
            0.0,
            1.0,
            "factor on the variance; 1 is the physics",
        ),
        Param::choice(
            "counts",
            &["electrons", "photons"],
            0,
            "electrons after the gain, as the circuit holds them, or photons before it",
        ),
        Param::number(
            "photons_at_full_scale",
            Unit::Electron,
            (100.0, 1e9),
            5e4,
            5e4,
            "photons in a nominal threshold of light, when photons are counted",
        ),
    ],
)
.with_ops(ops)
.with_moments(moments);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    let quanta = if v[1] == 0.0 { Quanta::Electrons } else { Quanta::Photons(v[2]) };
    vec![Op::LightQuanta { quanta, strength: v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // A spike gathers x/f of charge from N = K x_light/f quanta, each 1/K: variance x_light/(f K).
    let per_threshold = if v[1] == 0.0 { at.electrons } else { v[2] };
    let phase_variance = v[0] * at.from_light / at.increment() / per_threshold;
    Some(Moments { phase_variance, ..Moments::default() })
}

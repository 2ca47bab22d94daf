//! Photon shot noise: light arrives in whole quanta.

use super::prelude::*;
use crate::pixel::Quanta;

/// The effect `shot_noise`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "shot_noise",
    "Light consists of single quanta. The number of quanta in a readout has a Poisson distribution.",
    "SCSim, arXiv 2405.16790, Algorithm 1; Poisson statistics",
    &[
        Param::number("strength", Unit::Dimensionless, (0.0, 10_000.0), 0.0, 1.0, "factor on the variance of the number of quanta; 1 is Poisson noise"),
        Param::choice("counts", &["electrons", "photons"], 0, "kind of the quanta: electrons after the gain of the pixel, or photons before the gain"),
        Param::number("photons_at_full_scale", Unit::Electron, (100.0, 1e9), 5e4, 5e4, "photons per nominal threshold; used only if the quanta are photons"),
    ],
)
.with_ops(|v, _| {
    let quanta = if v[1] == 0.0 { Quanta::Electrons } else { Quanta::Photons(v[2]) };
    vec![Op::LightQuanta { quanta, strength: v[0] }]
})
.with_moments(|v, at| {
    // Let x = x_light + x_dark be the increment, f the rate in spikes per readout, and K the quanta per threshold.
    // Below saturation f = x. Between two spikes the light adds N = K x_light/f quanta of 1/K each.
    // The variance of their charge is N/K^2 = x_light/(f K).
    let per_threshold = if v[1] == 0.0 { at.electrons } else { v[2] };
    let phase_variance = v[0] * at.from_light / at.increment() / per_threshold;
    Some(Moments { phase_variance, ..Moments::default() })
});

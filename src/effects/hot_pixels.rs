//! Pixels whose dark current is much higher than the mean.

use super::prelude::*;

/// The effect `hot_pixels`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "hot_pixels",
    "A share of the pixels has many times the mean dark current.",
    "calibration maps: 0.69 % of the pixels exceed five robust deviations",
    &[
        Param::number("fraction", Unit::Dimensionless, (0.0, 1.0), 0.0, 0.007, "share of the pixels that are hot")
            .with_search(SearchSpec::amplitude((0.0, 0.05), &[0.004])),
        Param::number("factor", Unit::Dimensionless, (0.0, 1e4), 1.0, 8.0, "dark current of a hot pixel, relative to the mean dark current of the sensor")
            .with_search(SearchSpec::shape((1.5, 60.0), &[5.0, 12.0])),
        Param::number("tail", Unit::Dimensionless, (0.0, 1.0), 0.0, 0.0, "exponent of a Pareto law. For every share q from 0 to 1, the hottest share q of the hot pixels has at least `factor` times q^-tail")
            .omit_if_neutral(),
    ],
)
.with_edit(edit)
.with_moments(moments)
.scene_like()
.with_event_kind(EventKind::Pixels)
.with_ambiguity_groups(&[AmbiguityGroup::DarkSpikes]);

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, pattern: &mut PatternRng) {
    if v[0] == 0.0 {
        return;
    }
    let mean = circuit.dark_pa.iter().sum::<f64>() / circuit.dark_pa.len() as f64;
    for (dark, u) in circuit.dark_pa.iter_mut().zip(pattern.uniforms()) {
        if u < v[0] {
            // Let u be the uniform draw of a pixel. Pixels with u < fraction are hot. For hot pixels, u / fraction is
            // uniform in [0, 1).
            let factor = if v[2] == 0.0 { v[1] } else { v[1] * libm::pow((u / v[0]).max(1e-6), -v[2]) };
            *dark += (factor - 1.0) * mean;
        }
    }
}

fn moments(v: Values<'_>, at: &OperatingPoint) -> Option<Moments> {
    if v[2] > 0.0 {
        // A few pixels dominate the moments of a Pareto distribution. If the tail parameter is 1/2 or more, the variance
        // is infinite.
        return None;
    }
    let extra = (v[1] - 1.0) * at.from_dark / at.increment();
    Some(Moments {
        rate: v[0] * (v[1] - 1.0) * at.from_dark,
        phase_variance: 0.0,
        spatial_variance: v[0] * (1.0 - v[0]) * extra * extra,
    })
}

//! Dark current of the photodiode. The current differs between pixels.

use super::prelude::*;

/// The effect `dark_current`.
pub static EFFECT: Definition = Definition::new(
    "dark_current",
    "Every pixel has its own constant dark current, which adds charge without light.",
    "SCSim, arXiv 2405.16790, Algorithm 1",
    &[
        Param::number("mean", Unit::Picoampere, (-1e3, 1e6), 0.0, 0.4442, "mean dark current over the pixels"),
        Param::number("sigma", Unit::Picoampere, (0.0, 1e6), 0.0, 0.1731, "Gaussian standard deviation of the dark current over the pixels"),
        Param::choice("negative", &["kept", "zero"], 1, "treatment of pixels with a negative current: the current is kept, or set to zero"),
    ],
)
.with_edit(edit)
.with_moments(|v, at| {
    // If `negative` is `zero`, negative currents are set to zero. If sigma is below 0.4 of the mean, this changes the mean
    // by less than 0.1 %.
    let thresholds = |pa: f64| pa * at.period_s * 1e3 / (at.capacitance_ff * at.swing_v);
    let relative = thresholds(v[1]) / (at.increment() + thresholds(v[0]));
    Some(Moments { rate: thresholds(v[0]), phase_variance: 0.0, spatial_variance: relative * relative })
});

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, pattern: &mut PatternRng) {
    for (dark, z) in circuit.dark_pa.iter_mut().zip(pattern.normals_if(v[1] != 0.0)) {
        *dark += v[0] + v[1] * z;
        if v[2] != 0.0 {
            *dark = dark.max(0.0);
        }
    }
}

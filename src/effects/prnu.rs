//! Photo-response non-uniformity: a different conversion gain in every pixel.

use super::prelude::*;

/// The effect `prnu`.
pub static EFFECT: Definition = Definition::new(
    "prnu",
    "Every pixel converts light to charge with its own gain. The gain does not affect the dark current.",
    "SCSim, arXiv 2405.16790, Algorithm 1, the map alpha",
    &[
        Param::number("mean", Unit::Dimensionless, (0.0, 100.0), 1.0, 1.0, "mean gain over the pixels"),
        Param::number("sigma", Unit::Dimensionless, (0.0, 1.0), 0.0, 0.02, "Gaussian standard deviation of the gain over the pixels"),
    ],
)
.with_edit(edit)
.with_moments(moments);

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, pattern: &mut PatternRng) {
    for (gain, z) in circuit.gain.iter_mut().zip(pattern.normals_if(v[1] != 0.0)) {
        *gain *= v[0] + v[1] * z;
    }
}

fn moments(v: Values<'_>, at: &OperatingPoint) -> Option<Moments> {
    let share = at.from_light / at.increment();
    Some(Moments {
        rate: (v[0] - 1.0) * at.from_light,
        phase_variance: 0.0,
        spatial_variance: share * share * v[1] * v[1],
    })
}

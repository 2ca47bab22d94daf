//! Log-normal dark current, as in calibration maps of real cameras.

use super::prelude::*;

/// The effect `dark_tail`.
pub static EFFECT: Definition = Definition::new(
    "dark_tail",
    "A log-normal factor with mean 1 multiplies the dark current of each pixel. The factor makes a few pixels hot and makes no current negative.",
    "calibration maps of a 400x250 camera: standard deviation of the logarithm 0.43, no negative currents",
    &[Param::number("log_sigma", Unit::Dimensionless, (0.0, 3.0), 0.0, 0.43, "standard deviation of the logarithm of the factor")
        .with_search(SearchSpec::deviation((0.0, 1.5), &[0.2, 0.5]))],
)
.with_edit(edit)
.with_moments(|v, at| {
    // A log-normal factor with mean one has the variance exp(sigma^2) - 1.
    let share = at.from_dark / at.increment();
    Some(Moments { spatial_variance: share * share * libm::expm1(v[0] * v[0]), ..Moments::default() })
})
.scene_like()
.with_ambiguity_groups(&[AmbiguityGroup::DarkSpikes]);

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, pattern: &mut PatternRng) {
    if v[0] == 0.0 {
        return;
    }
    for (dark, z) in circuit.dark_pa.iter_mut().zip(pattern.normals()) {
        *dark *= libm::exp(v[0] * z - 0.5 * v[0] * v[0]);
    }
}

//! Threshold offset that all pixels of a row share.

use super::prelude::*;

/// The effect `row_pattern`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "row_pattern",
    "All pixels of a row have the same constant threshold offset, because they share one comparator supply.",
    "column and row fixed-pattern noise of EMVA 1288, release 4.0, section 4",
    &[Param::number("sigma", Unit::Dimensionless, (0.0, 0.1), 0.0, 0.01, "Gaussian standard deviation of the offset over the rows, relative to the nominal threshold")
        .with_search(SearchSpec::deviation((0.0, 0.1), &[0.006, 0.025]))],
)
.with_edit(edit)
.with_moments(|v, at| {
    // The rate is proportional to 1/(1 + e), where e is the relative threshold offset of a row with mean 0. To second
    // order, the mean of 1/(1 + e) is 1 + var(e).
    let variance = v[0] * v[0];
    Some(Moments { rate: at.increment() * variance, phase_variance: 0.0, spatial_variance: variance })
})
.scene_like()
.with_ambiguity_groups(&[AmbiguityGroup::SpatialPattern]);

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, pattern: &mut PatternRng) {
    if v[0] == 0.0 {
        return;
    }
    let width = circuit.geometry.width();
    let offsets: Vec<f64> = pattern.normals().take(circuit.geometry.height()).collect();
    let sigma_v = v[0] * circuit.nominal_v;
    for (p, swing) in circuit.swing_v.iter_mut().enumerate() {
        *swing += sigma_v * offsets[p / width];
    }
}

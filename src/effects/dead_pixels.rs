//! Pixels that gather no charge.

use super::prelude::*;

/// The effect `dead_pixels`.
pub static EFFECT: Definition = Definition::new(
    "dead_pixels",
    "A share of the pixels collects no charge.",
    "low-light recordings of a real camera",
    &[Param::number("fraction", Unit::Dimensionless, (0.0, 1.0), 0.0, 0.003, "share of the pixels that are dead")
        .with_search(SearchSpec::amplitude((0.0, 0.05), &[0.005]))],
)
.with_edit(edit)
.with_moments(|v, at| Some(Moments { rate: -v[0] * at.increment(), phase_variance: 0.0, spatial_variance: v[0] * (1.0 - v[0]) }))
.scene_like()
.with_event_kind(EventKind::Pixels);

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, pattern: &mut PatternRng) {
    if v[0] == 0.0 {
        return;
    }
    for (p, u) in pattern.uniforms().enumerate().take(circuit.pixels()) {
        if u < v[0] {
            circuit.gain[p] = 0.0;
            circuit.dark_pa[p] = 0.0;
        }
    }
}

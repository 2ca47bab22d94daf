//! Dark current that switches between two values.

use super::prelude::*;

/// The effect `telegraph_dark`.
///
/// The number of irregular intervals increases from zero to its maximum while the amplitude increases by a factor of
/// ten. A search that starts at an amplitude of 0.1 therefore mistakes weak switching for false spikes.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "telegraph_dark",
    "The dark current of some pixels switches at random between two values. The values are above and below the mean dark current of the pixel by the same amount.",
    "random telegraph signal of single traps, as in active-pixel sensors",
    &[
        Param::number("amplitude", Unit::Dimensionless, (0.0, 1.0), 0.0, 0.3, "distance of each value from the mean dark current of the pixel, relative to this mean")
            .with_search(SearchSpec::amplitude((0.0, 1.0), &[0.008, 0.03, 0.15])),
        Param::number("fraction", Unit::Dimensionless, (0.0, 1.0), 0.0, 0.05, "share of the pixels that switch")
            .with_search(SearchSpec::shape((0.01, 1.0), &[0.2])),
        Param::number("rate", Unit::Dimensionless, (0.0, 0.5), 1e-3, 1e-3, "probability per readout that the dark current of such a pixel switches")
            .with_search(SearchSpec::shape((1e-4, 1e-2), &[1e-3])),
    ],
)
.with_edit(edit)
.with_ops(|v, _| vec![Op::Telegraph { rate: v[2] }])
.with_moments(|v, at| {
    // Let p be the switching probability per readout. The correlation of the signal after k readouts is (1 - 2p)^k.
    // The variance of the sum of the signal grows by (1 - p)/p per readout if an interval is much longer than 1/p
    // readouts.
    let walk = if v[2] == 0.0 { 0.0 } else { (1.0 - v[2]) / v[2] };
    let phase_variance = v[1] * (v[0] * at.from_dark).powi(2) * walk / at.increment();
    Some(Moments { phase_variance, ..Moments::default() })
})
.with_ambiguity_groups(&[AmbiguityGroup::DarkSpikes, AmbiguityGroup::SlowChange]);

fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, pattern: &mut PatternRng) {
    if v[0] == 0.0 || v[1] == 0.0 {
        return;
    }
    let member = |u: f64| if u < v[1] { v[0] } else { 0.0 };
    circuit.telegraph = pattern.uniforms().take(circuit.pixels()).map(member).collect();
}

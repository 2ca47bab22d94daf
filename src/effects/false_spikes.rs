//! Readouts that report a spike although the pixel did not fire.

use super::prelude::*;

/// The effect `false_spikes`.
pub static EFFECT: Definition = Definition::new(
    "false_spikes",
    "The camera reports a spike of a pixel that did not fire at this readout.",
    "bit errors; inherent noise of SpikingSIM",
    &[Param::number("probability", Unit::Dimensionless, (0.0, 1.0), 0.0, 1e-3, "probability of a false spike, per pixel and readout without a spike")
        .with_search(SearchSpec::amplitude((0.0, 0.05), &[4e-6, 6e-5, 1e-3]))],
)
.with_ops(|v, _| vec![Op::Flip { missed_spikes: 0.0, false_spikes: v[0] }])
.with_moments(|v, at| {
    let x = at.increment().min(1.0);
    let rate = v[0] * (1.0 - x);
    // Over many readouts, the phase variance equals the variance of a spike count divided by the mean of the spike
    // count. Only the number of false spikes is random.
    let phase_variance = if rate == 0.0 { 0.0 } else { rate * (1.0 - v[0]) / (x + rate) };
    Some(Moments { rate, phase_variance, spatial_variance: 0.0 })
})
.with_ambiguity_groups(&[AmbiguityGroup::DarkSpikes, AmbiguityGroup::IrregularIntervals]);

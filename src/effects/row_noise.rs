//! Threshold noise that all pixels of a row share.

use super::prelude::*;

/// The effect `row_noise`.
#[rustfmt::skip]
pub static EFFECT: Definition = Definition::new(
    "row_noise",
    "At every readout, a random value shifts the thresholds of all pixels of a row. The shift acts on the comparison and on the reset.",
    "row noise of EMVA 1288: the line driver and its supply",
    &[Param::number("sigma", Unit::Dimensionless, (0.0, 0.06), 0.0, 0.005, "standard deviation of the shift, relative to the threshold")
        .with_search(SearchSpec::deviation((0.0, 0.05), &[0.002, 0.012]))],
)
.with_ops(|v, _| vec![Op::RowNoise { sigma: v[0] }])
// No moments: the threshold is redrawn at every readout. A pixel is more likely to fire when its draw is low, and in general
// this bias has no closed form.
.with_ambiguity_groups(&[AmbiguityGroup::SingleReadouts, AmbiguityGroup::IrregularIntervals]);

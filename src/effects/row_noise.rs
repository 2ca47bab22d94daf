//! Threshold noise that all pixels of a row share.

use crate::effects::definition::{AmbiguityGroup, Definition, Moments, OperatingPoint, Param, SearchSpec, Values};
use crate::pixel::Op;
use crate::sensor::Sensor;
use crate::units::Unit;

/// The effect `row_noise`.
pub static EFFECT: Definition = Definition::new(
    "row_noise",
    "At every readout, a random value shifts the thresholds of all pixels of a row. The shift acts on the comparison and on the reset.",
    "row noise of EMVA 1288: the line driver and its supply",
    &[Param::number(
        "sigma",
        Unit::Dimensionless,
        (0.0, 0.06),
        0.0,
        0.005,
        "standard deviation of the shift, relative to the threshold",
    )
    .with_search(SearchSpec::deviation((0.0, 0.05), &[0.002, 0.012]))],
)
.with_ops(ops)
.with_moments(moments)
.with_ambiguity_groups(&[AmbiguityGroup::SingleReadouts, AmbiguityGroup::IrregularIntervals]);

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::RowNoise { sigma: v[0] }]
}

fn moments(_: Values<'_>, _: &OperatingPoint) -> Option<Moments> {
    // The threshold is redrawn at every readout. A pixel is more likely to fire when its draw is low, and in general
    // this bias has no closed form.
    None
}

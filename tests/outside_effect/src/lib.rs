//! An example effect that another crate defines: a supply that droops under load and adds noise to whole rows.

use spikelane::Sensor;
use spikelane::effects::definition::{Definition, Moments, OperatingPoint, Param, SearchSpec, Values};
use spikelane::pixel::Op;
use spikelane::units::Unit;

/// The effect `weak_supply`. It combines two operations that every backend supports.
pub static WEAK_SUPPLY: Definition = Definition::new(
    "weak_supply",
    "All thresholds fall with the spikes of the readout before, and those of a row shake together.",
    "an example of an effect in another crate",
    &[Param::number(
        "sag",
        Unit::Dimensionless,
        (0.0, 0.06),
        0.0,
        0.01,
        "relative fall of the threshold when every pixel fired",
    )
    .with_search(SearchSpec::amplitude((0.0, 0.06), &[0.004, 0.02]))],
)
.with_ops(ops)
.with_moments(moments)
.scene_like();

/// Standard deviation of the row noise in the pixel's own thresholds, per unit of `sag`.
pub const ROW_NOISE: f64 = 0.5;

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::SupplyDroop { depth: v[0] }, Op::RowNoise { sigma: ROW_NOISE * v[0] }]
}

fn moments(v: Values<'_>, at: &OperatingPoint) -> Option<Moments> {
    // Let x be the increment. The rate f solves f (1 - sag f) = x. To second order, f = x + sag x^2. A reset subtracts
    // the row noise together with the threshold, so the row noise adds phase variance.
    let x = at.increment();
    Some(Moments::default().with_rate(v[0] * x * x).with_phase_variance((ROW_NOISE * v[0]).powi(2)))
}

/// The programs in the documentation pages. Doc tests of this crate compile and run these programs, as a user's crate
/// would.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
#[doc = include_str!("../../../src/README.md")]
#[doc = include_str!("../../../docs/guides/embedding.md")]
#[doc = include_str!("../../../docs/reference/scenes.md")]
pub struct Pages;

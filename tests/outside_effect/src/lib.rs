//! A supply that is too weak: it sags with the load, and the lines that drive the rows shake.

use spikelane::Sensor;
use spikelane::effects::definition::{Definition, Moments, Operating, Param, Tried, Values};
use spikelane::pixel::Op;
use spikelane::units::Unit;

/// The effect `weak_supply`, made of two operations that every backend has.
pub static WEAK_SUPPLY: Definition = Definition::new(
    "weak_supply",
    "All thresholds fall with the spikes of the readout before, and those of a row shake together.",
    "an example of an effect in another crate",
    &[Param::number(
        "sag",
        Unit::One,
        (0.0, 0.06),
        0.0,
        0.01,
        "relative fall of the threshold when every pixel fired",
    )
    .tried(Tried::amplitude((0.0, 0.06), &[0.004, 0.02]))],
)
.with_ops(ops)
.with_moments(moments)
.part_of_a_scene();

/// Row noise, in own thresholds, per sag.
pub const ROW_NOISE: f64 = 0.5;

fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
    vec![Op::SupplyDroop { depth: v[0] }, Op::RowNoise { sigma: ROW_NOISE * v[0] }]
}

fn moments(v: Values<'_>, at: &Operating) -> Option<Moments> {
    // f (1 - sag f) = x, to second order; the noise of a row is subtracted with its threshold.
    let x = at.increment();
    Some(Moments::default().with_rate(v[0] * x * x).with_phase_variance((ROW_NOISE * v[0]).powi(2)))
}

/// The programs of the pages are what an embedder writes, too: cargo's tests compile and run them from here.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/guides/embedding.md")]
#[doc = include_str!("../../../docs/reference/scenes.md")]
pub struct Pages;

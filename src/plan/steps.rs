//! A pixel's law in whole steps, and the units that tables are in.

use crate::pixel::Law;
use crate::plan::LANES;
use crate::plan::scale::Scale;

/// Steps times 65,536: the unit of increments.
pub(super) const FRACTION: f64 = 65_536.0;

/// The kernels' unit of light is this part of full scale.
pub(super) const FULL_SCALE: f64 = 255.0;

/// A pixel's law and its threshold in whole steps.
pub(super) struct Rounded<'a> {
    pub law: &'a Law,
    pub whole: f64,
    /// Steps per nominal threshold of charge: the pixel's own rounded threshold sets the unit.
    pub unit: f64,
}

impl<'a> Rounded<'a> {
    pub(super) fn new(law: &'a Law, scale: &Scale) -> Self {
        let whole = (law.threshold * f64::from(scale.steps)).round();
        Self { law, whole, unit: whole / law.threshold }
    }
}

/// A probability in units of 2^-32.
pub(super) fn probability(p: f64) -> u32 {
    (p * 4_294_967_296.0).min(f64::from(u32::MAX)) as u32
}

/// A value of every pixel, with `filler` behind the last up to whole lanes.
pub(super) fn pad<T: Clone>(laws: &[Rounded<'_>], filler: T, value: impl Fn(&Rounded<'_>) -> T) -> Vec<T> {
    let padded = laws.len().next_multiple_of(LANES);
    // Room for the padding from the start: a vector that grows by a little asks for twice its memory.
    let mut table = Vec::with_capacity(padded);
    table.extend(laws.iter().map(value));
    table.resize(padded, filler);
    table
}

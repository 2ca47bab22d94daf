//! One recording to one scan: what every statistic needs of its pixels and readouts.

pub(super) mod bits;
pub(super) mod coincidences;
pub(super) mod intervals;
pub(super) mod pixel;
pub(super) mod scan;
pub(super) mod stretches;

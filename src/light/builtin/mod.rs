//! Built-in light: the test chart, random objects, and interpolation between frames.

pub(crate) mod chart;
pub(super) mod flow_interpolator;
pub(super) mod objects;

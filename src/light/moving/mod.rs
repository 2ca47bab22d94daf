//! Light that is made here: charts, objects, and motion over a picture.

pub(super) mod between;
pub(crate) mod chart;
pub(super) mod objects;

//! Light that is made here: charts, objects, and motion over a picture.

pub(super) mod between;
pub mod chart;
#[cfg(feature = "files")]
pub mod motion;
pub(super) mod objects;

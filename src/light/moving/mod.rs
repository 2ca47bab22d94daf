//! Light that is made here: charts, objects, and motion over a picture.

pub(super) mod between;
pub mod chart;
mod chart_drawn;
mod chart_scene;
#[cfg(feature = "files")]
pub mod motion;
pub(super) mod objects;

//! Light that is made here: charts, objects, and motion over a picture.

pub(super) mod between;
pub(crate) mod chart;
mod chart_drawn;
mod chart_scene;
pub(super) mod objects;

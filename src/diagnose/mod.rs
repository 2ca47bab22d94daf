//! Finding, naming and adding what the model of a camera lacks.

mod bits;
mod candidates;
mod edges;
mod lines;
mod maps;
mod metric;
mod model;
mod reference;
mod scan;
mod setup;
mod spread;
mod time;
mod vector;

pub use reference::{Limits, Progress, Reference};
pub use setup::{Part, Scene, Setup};
pub use vector::Statistic;

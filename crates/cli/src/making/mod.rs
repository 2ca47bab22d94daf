//! Commands that make streams, scenes and data sets.

pub(super) mod closing;
pub(super) mod dataset;
pub(super) mod drawn;
pub(super) mod first_run;
pub(super) mod forecast;
pub(super) mod images;
pub(super) mod light;
pub(super) mod live;
mod names;
pub(super) mod scene;
pub(super) mod simulate;

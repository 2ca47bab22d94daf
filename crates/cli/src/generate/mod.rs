//! Commands that generate streams, scenes and datasets.

pub(super) mod builtin_light;
pub(super) mod dataset;
pub(super) mod first_run;
pub(super) mod forecast;
pub(super) mod images;
pub(super) mod light;
pub(super) mod live;
pub(super) mod scene;
pub(super) mod simulate;
pub(super) mod summary;

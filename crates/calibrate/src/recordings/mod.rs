//! Recording sets: plans, files, measurements and checks.

pub(super) mod check;
pub(super) mod color_filters;
pub(super) mod drift;
pub(super) mod light_change;
pub(super) mod light_unit;
pub(super) mod measure_levels;
pub(super) mod observations;
pub(super) mod protocol;
pub(super) mod published_maps;
pub(super) mod recorded_camera;
pub(super) mod recording_set;
pub(super) mod sources;

//! The scans of a set to one vector of statistics.

pub(super) mod all;
pub(super) mod entry;
pub(super) mod lines;
pub(super) mod maps;
pub(super) mod measured;
pub(super) mod quantiles;
pub(super) mod rate_maps;
pub(super) mod readouts;
pub(super) mod steps;
pub(super) mod transforms;

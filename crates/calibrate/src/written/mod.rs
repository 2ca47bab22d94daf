//! What a calibration writes: camera, maps, report.

pub(super) mod output;
pub(super) mod page;
mod verdict;

//! Output of a calibration: camera file, maps and reports.

pub(super) mod files;
pub(super) mod html_report;
mod verdict;

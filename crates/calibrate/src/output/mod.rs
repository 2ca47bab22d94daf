//! Output of a calibration: camera file, maps and reports.

mod emva_1288;
pub(super) mod files;
pub(super) mod html_report;
mod verdict;

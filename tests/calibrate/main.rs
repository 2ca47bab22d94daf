//! Calibrations of sensors whose numbers are known.

#[cfg(feature = "cli")]
#[path = "../../study/labs/best.rs"]
mod best;
#[path = "../calibrate_support/mod.rs"]
mod calibrate_support;
#[cfg(feature = "cli")]
#[path = "../../study/labs/judge.rs"]
#[allow(dead_code, reason = "the study makes tables of it")]
mod judge;
#[cfg(feature = "cli")]
#[path = "../../study/labs/lab.rs"]
#[allow(dead_code, reason = "the study makes tables of it")]
mod lab;

#[cfg(feature = "cli")]
mod labs;
mod recovery;
mod round_trip;
mod sets;

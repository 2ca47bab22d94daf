//! Calibrations of sensors whose numbers are known.

#[path = "../calibrate_support/mod.rs"]
mod calibrate_support;

mod recovery;
mod round_trip;
mod sets;

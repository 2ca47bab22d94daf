//! Tests calibrations of sensors whose parameters are known.

#[path = "../calibrate_support/mod.rs"]
mod calibrate_support;

mod mosaic;
mod recording_sets;
mod recovery;
mod robustness;
mod round_trip;
mod sources;
mod unsteady_light;

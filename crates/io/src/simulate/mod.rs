//! Whole runs from files to files: a source of light becomes a stream with its sidecar.
//!
//! The module re-exports [`spikelane::simulate`], so that one path has all of simulation.

mod ahead;
mod clear;
mod feed;
mod readouts;
mod run;
mod sidecar;
mod writing;

pub use ahead::Ahead;
pub use clear::images::{ImageFacts, ImageFile, ImageForm, linear_png};
pub use clear::looks::{Glance, Looks, light_at};
pub use readouts::Readouts;
pub use run::{Outcome, Run, Written, run, run_looking};
pub use sidecar::{CameraFacts, LightFacts, SensorFacts, Sidecar, StreamFacts, save_camera};
pub use spikelane::simulate::*;

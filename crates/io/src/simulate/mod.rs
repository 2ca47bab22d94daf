//! Simulates a light source from files, and writes the stream and its sidecar to files.
//!
//! The module re-exports [`spikelane::simulate`], so that one path covers the whole simulation.

mod batch_writer;
mod feed;
mod read_ahead;
mod readouts;
mod reference;
mod run;
mod sidecar;

pub use read_ahead::ReadAhead;
pub use readouts::ReadoutStream;
pub use reference::images::{ImageFacts, ImageFile, ImageFormat, linear_png};
pub use reference::light_tap::{LightSample, LightTap, light_at};
pub use run::{RunObserver, RunOptions, RunSummary, run};
pub use sidecar::{CameraFacts, LightFacts, MosaicFacts, SensorFacts, Sidecar, StreamFacts, save_camera};
pub use spikelane::simulate::*;

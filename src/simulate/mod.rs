//! Light in, spikes out: plans run over tiles, on one thread or several.

#[cfg(feature = "files")]
mod ahead;
#[cfg(feature = "files")]
mod feed;
mod frame;
mod frames;
#[cfg(feature = "files")]
mod images;
#[cfg(feature = "files")]
mod looks;
#[cfg(feature = "threads")]
mod pool;
#[cfg(feature = "files")]
mod readouts;
#[cfg(feature = "files")]
mod run;
#[cfg(feature = "files")]
pub mod saved;
mod segments;
#[cfg(feature = "files")]
mod sidecar;
mod simulator;
mod tiles;
#[cfg(feature = "files")]
mod writing;

#[cfg(feature = "files")]
pub use ahead::Ahead;
pub use frame::FrameRef;
#[cfg(feature = "files")]
pub use images::{ImageFacts, ImageFile, ImageForm, linear_png};
#[cfg(feature = "files")]
pub use looks::{Glance, Looks, light_at};
#[cfg(feature = "threads")]
pub use pool::Pool;
#[cfg(feature = "files")]
pub use readouts::Readouts;
#[cfg(feature = "files")]
pub use run::{Outcome, Run, Written, run, run_looking};
#[cfg(feature = "files")]
pub use sidecar::{CameraFacts, LightFacts, SensorFacts, Sidecar, StreamFacts, save_camera};
pub use simulator::Simulator;

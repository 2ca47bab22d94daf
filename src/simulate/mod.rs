//! Light in, spikes out: plans run over tiles, on one thread or several.

#[cfg(feature = "files")]
mod ahead;
#[cfg(feature = "files")]
mod feed;
mod frame;
#[cfg(feature = "files")]
mod run;
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
pub use run::{Glance, Outcome, Run, Written, run};
#[cfg(feature = "files")]
pub use sidecar::{CameraFacts, LightFacts, SensorFacts, Sidecar, StreamFacts, save_camera};
pub use simulator::Simulator;

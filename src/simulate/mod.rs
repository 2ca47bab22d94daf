//! Light in, spikes out: plans run over tiles, on one thread or several.

#[cfg(feature = "files")]
mod ahead;
#[cfg(feature = "files")]
mod clear;
#[cfg(feature = "files")]
mod feed;
mod frame;
mod frames;
#[cfg(feature = "files")]
mod readouts;
#[cfg(feature = "files")]
mod run;
#[cfg(feature = "files")]
mod saved;
mod segments;
#[cfg(feature = "files")]
mod sidecar;
mod simulator;
mod tiles;
#[cfg(feature = "files")]
mod writing;

pub use crate::kernels::Samples;
#[cfg(feature = "threads")]
pub use crate::threads::Pool;
#[cfg(all(feature = "files", feature = "internals"))]
#[doc(hidden)]
pub use ahead::Ahead;
#[cfg(all(feature = "files", not(feature = "internals")))]
pub(crate) use ahead::Ahead;
#[cfg(all(feature = "files", feature = "internals"))]
#[doc(hidden)]
pub use clear::images::ImageFile;
#[cfg(all(feature = "files", not(feature = "internals")))]
pub(crate) use clear::images::ImageFile;
#[cfg(all(feature = "files", feature = "internals"))]
#[doc(hidden)]
pub use clear::images::linear_png;
#[cfg(all(feature = "files", not(feature = "internals")))]
pub(crate) use clear::images::linear_png;
#[cfg(feature = "files")]
pub use clear::images::{ImageFacts, ImageForm};
#[cfg(all(feature = "files", feature = "internals"))]
#[doc(hidden)]
pub use clear::looks::light_at;
#[cfg(all(feature = "files", not(feature = "internals")))]
pub(crate) use clear::looks::light_at;
#[cfg(all(feature = "files", feature = "internals"))]
#[doc(hidden)]
pub use clear::looks::{Glance, Looks};
#[cfg(all(feature = "files", not(feature = "internals")))]
pub(crate) use clear::looks::{Glance, Looks};
pub use frame::FrameRef;
#[cfg(all(feature = "files", feature = "internals"))]
#[doc(hidden)]
pub use readouts::Readouts;
#[cfg(all(feature = "files", not(feature = "internals")))]
pub(crate) use readouts::Readouts;
#[cfg(all(feature = "files", feature = "internals"))]
#[doc(hidden)]
pub use run::run_looking;
#[cfg(all(feature = "files", not(feature = "internals")))]
pub(crate) use run::run_looking;
#[cfg(feature = "files")]
pub use run::{Outcome, Run, Written, run};
#[cfg(feature = "files")]
pub use sidecar::{CameraFacts, LightFacts, SensorFacts, Sidecar, StreamFacts, save_camera};
pub use simulator::Simulator;

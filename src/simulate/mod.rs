//! Light in, spikes out: plans run over tiles, on one thread or several.

mod frame;
mod frames;
#[cfg(feature = "presets")]
mod saved;
pub(crate) mod segments;
mod simulator;
mod tiles;

pub use crate::kernels::Samples;
#[cfg(feature = "threads")]
pub use crate::threads::Pool;
pub use frame::FrameRef;
pub use simulator::Simulator;

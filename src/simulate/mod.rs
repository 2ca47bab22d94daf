//! Light in, spikes out: plans run over tiles, on one thread or several.

mod frame;
mod simulator;

pub use frame::FrameRef;
pub use simulator::Simulator;

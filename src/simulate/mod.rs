//! The simulator. It runs the kernels of a plan on the tiles of the sensor, on one thread or several threads.

mod exposure_meter;
mod frame_ref;
mod frame_sequence;
mod light;
mod options;
#[cfg(feature = "presets")]
mod save;
pub(crate) mod segments;
mod simulator;
mod tiles;

pub use crate::kernels::Samples;
#[cfg(feature = "threads")]
pub use crate::threads::Pool;
pub use exposure_meter::ExposureFault;
pub use frame_ref::FrameRef;
pub use light::Light;
pub use options::SimulatorOptions;
pub use simulator::Simulator;

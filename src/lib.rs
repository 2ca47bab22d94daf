//! Spike-camera simulation: light in, bit-packed spike streams out.

pub mod error;
pub mod spikes;

pub use error::{Error, Kind, Result};
pub use spikes::{Geometry, Packed};
pub mod draws;
pub mod effects;
pub mod pixel;
pub mod sensor;
pub mod units;

//! Spike-camera simulation: light in, bit-packed spike streams out.

pub mod error;
#[cfg(feature = "scene")]
pub mod scene;
pub mod spikes;

pub use error::{Error, Kind, Result};
pub use spikes::{Geometry, Packed};

//! Spike-camera simulation: light in, bit-packed spike streams out.

pub mod error;
#[cfg(feature = "files")]
pub mod formats;
pub mod spikes;
#[cfg(feature = "files")]
pub mod storage;

pub use error::{Error, Kind, Result};
pub use spikes::{Geometry, Packed};

//! Stream formats: how packed frames lie in files.
//!
//! One file per format ([`Layout`] lists them, `docs/reference/formats.md` states each by rule);
//! [`Reader`] opens any of them, [`StreamWriter`] writes any, [`convert`] goes between.

mod container;
mod convert;
mod dataset_config;
mod events;
mod frames;
mod layouts;
mod opening;
mod origin;
mod reader;
mod readings;
mod sidecar;
mod size;
mod source;
mod writer;

pub use convert::convert;
#[cfg(feature = "internals")]
#[doc(hidden)]
pub use events::EVENTS;
#[cfg(not(feature = "internals"))]
pub(crate) use events::EVENTS;
pub use events::write_events;
pub use frames::Frames;
#[cfg(feature = "internals")]
#[doc(hidden)]
pub use layouts::codec::Codec;
#[cfg(not(feature = "internals"))]
pub(crate) use layouts::codec::Codec;
pub use layouts::layout::Layout;
pub use opening::Opening;
pub use origin::{Lost, Origin};
pub use reader::Reader;
pub use readings::{Reading, Readings};
#[cfg(feature = "internals")]
#[doc(hidden)]
pub use sidecar::candidates as sidecar_paths;
#[cfg(not(feature = "internals"))]
pub(crate) use sidecar::candidates as sidecar_paths;
#[cfg(feature = "cli")]
pub(crate) use writer::own_sidecar;
pub use writer::{Finished, StreamWriter};

pub use crate::spikes::Crop;
#[cfg(feature = "scene")]
pub use crate::storage::OutputSet;
pub use crate::storage::write_small;

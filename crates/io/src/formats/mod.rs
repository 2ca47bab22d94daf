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
pub use events::EVENTS;
pub use events::write_events;
pub use frames::Frames;
pub use layouts::codec::Codec;
pub use layouts::layout::Layout;
pub use opening::Opening;
pub use origin::{Lost, Origin};
pub use reader::Reader;
pub use readings::{Reading, Readings};
pub use sidecar::found_beside as sidecar_beside;
pub use writer::own_sidecar;
pub use writer::{Finished, StreamWriter};

pub use crate::storage::{OutputSet, write_small};
pub use spikelane::spikes::Crop;

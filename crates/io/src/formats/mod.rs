//! Stream formats: how packed frames are stored in files.
//!
//! Each layout has its own file. [`Layout`] lists the layouts, and `docs/reference/formats.md` specifies the formats.
//! [`StreamReader`] opens every format, and [`StreamWriter`] writes every layout. [`convert`] copies a stream to
//! another layout.

mod convert;
mod dataset_config;
mod events;
mod foreign_format;
mod frames;
mod layout_guesses;
mod layouts;
mod open_options;
mod origin;
mod reader;
mod sidecar;
mod size;
mod source;
mod tfi;
mod writer;

pub use convert::{convert, convert_to};
pub use events::{EVENTS_LAYOUT, write_events};
pub use frames::StreamFrames;
pub use layout_guesses::{LayoutGuess, LayoutGuesses};
pub use layouts::codec::Codec;
pub use layouts::layout::Layout;
pub use open_options::OpenOptions;
pub use origin::{GeometryOrigin, MissingFrames};
pub use reader::StreamReader;
pub use sidecar::find_sidecar;
pub use writer::{StreamSummary, StreamWriter, sidecar_path};

pub use crate::storage::{OutputSet, write_small};
pub use spikelane::spikes::Crop;

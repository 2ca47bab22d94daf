//! Writer handles. This module uses no pointers.
#![forbid(unsafe_code)]

use std::path::Path;

use spikelane::{Geometry, Result};
use spikelane_io::formats::{Layout, StreamWriter};

use crate::error::usage;

/// The content of a writer handle: a stream, or `None` after the stream is finished.
pub struct Writer(Option<StreamWriter>);

impl Writer {
    pub fn create(path: &str, width: u32, height: u32, layout: &str, force: bool) -> Result<Self> {
        let geometry = Geometry::new(width, height)?;
        let stream = StreamWriter::create_growing(Path::new(path), Layout::parse(layout)?, geometry, force)?;
        Ok(Self(Some(stream)))
    }

    pub fn write(&mut self, packed: &[u8]) -> Result<()> {
        let Some(stream) = &mut self.0 else { return Err(finished_error()) };
        stream.write_frames(stream.written(), packed)
    }

    pub fn finish(&mut self) -> Result<()> {
        let stream = self.0.take().ok_or_else(finished_error)?;
        stream.finish().map(drop)
    }
}

fn finished_error() -> spikelane::Error {
    usage("writer", "a stream that was finished", "one that is being written", "make another writer")
}

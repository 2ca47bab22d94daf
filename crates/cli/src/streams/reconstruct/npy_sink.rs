//! Writes pictures as a NumPy array.

use std::path::Path;

use spikelane::unstable::npy::{self, Element};
use spikelane::{Geometry, Result};
use spikelane_io::storage::FileWriter;

use super::sinks::PictureSink;

/// An array of f32 with the shape (height, width) or (pictures, height, width). It is written one picture at a time.
pub(crate) struct NpySink(FileWriter);

impl NpySink {
    /// Creates an array of `pictures` pictures. If `pictures` is `None`, the array contains one picture and has the shape
    /// (height, width).
    pub(crate) fn new(path: &Path, force: bool, geometry: Geometry, pictures: Option<usize>) -> Result<Self> {
        let sides = [geometry.height(), geometry.width()];
        let shape: Vec<u64> = pictures.into_iter().chain(sides).map(|n| n as u64).collect();
        let header = npy::header_bytes(Element::F32, &shape);
        let bytes = header.len() + 4 * pictures.unwrap_or(1) * geometry.pixels();
        let mut writer = FileWriter::create(path, bytes as u64, force)?;
        writer.write_all(&header)?;
        Ok(Self(writer))
    }
}

impl PictureSink for NpySink {
    fn encode(&self, values: &[f32]) -> Result<Vec<u8>> {
        Ok(values.iter().flat_map(|v| v.to_le_bytes()).collect())
    }

    fn write(&mut self, _: usize, encoded: &[u8]) -> Result<()> {
        self.0.write_all(encoded)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.0.finish().map(drop)
    }
}

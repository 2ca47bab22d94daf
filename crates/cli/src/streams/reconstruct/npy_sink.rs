//! Writes pictures as a NumPy array.

use std::path::Path;

use spikelane::unstable::npy::{self, Element};
use spikelane::{Geometry, Result};
use spikelane_io::storage::FileWriter;

use super::sinks::PictureSink;

/// An array of f32 with the shape (height, width) or (pictures, height, width). Color pictures have a last axis of length
/// 3. The array is written one picture at a time.
pub(crate) struct NpySink(FileWriter);

impl NpySink {
    /// Creates an array of `pictures` pictures. If `pictures` is `None`, the array contains one picture and has the shape
    /// (height, width).
    ///
    /// `channels` is 1 for gray pictures, and 3 for color pictures.
    pub(crate) fn new(
        path: &Path,
        force: bool,
        geometry: Geometry,
        channels: usize,
        pictures: Option<usize>,
    ) -> Result<Self> {
        let sides = [geometry.height(), geometry.width()];
        let shape: Vec<u64> = pictures
            .into_iter()
            .chain(sides)
            .chain((channels > 1).then_some(channels))
            .map(|n| n as u64)
            .collect();
        let header = npy::header_bytes(Element::F32, &shape);
        let bytes = header.len() + 4 * pictures.unwrap_or(1) * geometry.pixels() * channels;
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

//! Pictures as a NumPy array.

use std::path::Path;

use spikelane::unstable::npy::{self, Element};
use spikelane::{Geometry, Result};
use spikelane_io::storage::Writer;

use super::sinks::Sink;

/// (height, width), or (pictures, height, width) of f32, written as they come.
pub(crate) struct Npy(Writer);

impl Npy {
    /// An array of so many pictures; a plain picture without a number.
    pub(crate) fn new(path: &Path, force: bool, geometry: Geometry, pictures: Option<usize>) -> Result<Self> {
        let sides = [geometry.height(), geometry.width()];
        let shape: Vec<u64> = pictures.into_iter().chain(sides).map(|n| n as u64).collect();
        let header = npy::header(Element::F32, &shape);
        let bytes = header.len() + 4 * pictures.unwrap_or(1) * geometry.pixels();
        let mut writer = Writer::create(path, bytes as u64, force)?;
        writer.write_all(&header)?;
        Ok(Self(writer))
    }
}

impl Sink for Npy {
    fn encode(&self, values: &[f32]) -> Result<Vec<u8>> {
        Ok(values.iter().flat_map(|v| v.to_le_bytes()).collect())
    }

    fn put(&mut self, _: usize, encoded: &[u8]) -> Result<()> {
        self.0.write_all(encoded)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.0.finish().map(drop)
    }
}

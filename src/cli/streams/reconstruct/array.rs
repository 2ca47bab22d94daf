//! Pictures as a NumPy array.

use std::path::Path;

use crate::storage::Writer;
use crate::{Geometry, Result};

use super::sinks::Sink;

/// (height, width), or (pictures, height, width) of f32, written as they come.
pub(crate) struct Npy(Writer);

impl Npy {
    /// An array of so many pictures; a plain picture without a number.
    pub(crate) fn new(path: &Path, force: bool, geometry: Geometry, pictures: Option<usize>) -> Result<Self> {
        let (h, w) = (geometry.height(), geometry.width());
        let shape = pictures.map_or_else(|| format!("({h}, {w})"), |n| format!("({n}, {h}, {w})"));
        let header = header(&shape);
        let bytes = header.len() + 4 * pictures.unwrap_or(1) * geometry.pixels();
        let mut writer = Writer::create(path, bytes as u64, force)?;
        writer.write_all(&header)?;
        Ok(Self(writer))
    }
}

/// Version 1.0 of the format: magic, length, a Python literal, padded to a multiple of 64 bytes.
fn header(shape: &str) -> Vec<u8> {
    let mut text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}");
    let padded = (10 + text.len() + 1).next_multiple_of(64) - 10;
    text.push_str(&" ".repeat(padded - 1 - text.len()));
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes
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
